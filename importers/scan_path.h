#pragma once
// How a scan is named on the command line: a file, or one scan of a file with several.

#include <string>

namespace roomtex {

// "site.e57#tower" or "site.e57#2" is the scan of that name or number in site.e57. A file whose own
// name has a # wins over such a part.
struct ScanPath {
  std::string file;
  std::string part;  // "" = all scans of the file
};
ScanPath SplitScanPath(const std::string& path);

}  // namespace roomtex
