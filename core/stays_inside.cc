#include "core/stays_inside.h"

#include <algorithm>
#include <filesystem>

namespace roomtex {

bool StaysInside(const std::string& name) {
  const std::filesystem::path path(name);
  return !path.is_absolute() &&
         std::none_of(path.begin(), path.end(), [](const auto& part) { return part == ".."; });
}

}  // namespace roomtex
