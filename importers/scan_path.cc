#include "importers/scan_path.h"

#include <filesystem>

namespace roomtex {

ScanPath SplitScanPath(const std::string& path) {
  std::error_code error;
  if (std::filesystem::exists(path, error)) return {path, ""};
  for (size_t at = path.find('#'); at != std::string::npos; at = path.find('#', at + 1)) {
    const std::string file = path.substr(0, at);
    if (at + 1 < path.size() && std::filesystem::is_regular_file(file, error)) {
      return {file, path.substr(at + 1)};
    }
  }
  return {path, ""};
}

}  // namespace roomtex
