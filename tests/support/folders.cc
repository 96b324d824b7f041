#include "tests/support/folders.h"

namespace roomtex {

const std::string& BinFolder() {
  static const std::string folder = ROOMTEX_BIN;
  return folder;
}

const std::string& SourceFolder() {
  static const std::string folder = ROOMTEX_SOURCE;
  return folder;
}

std::string DataFolder(const std::string& name) {
  return SourceFolder() + "/../shared/data/" + name;
}

}  // namespace roomtex
