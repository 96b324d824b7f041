#include "importers/scan_path.h"

#include "core/input_guard.h"

namespace roomtex {

ScanPath SplitScanPath(const std::string& path) {
  const std::string file = FileOf(path);
  return {file, file.size() < path.size() ? path.substr(file.size() + 1) : ""};
}

}  // namespace roomtex
