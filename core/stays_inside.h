#pragma once

#include <string>

namespace roomtex {

// Files of a folder are named by other files: such a name must not be a road out of the folder.
// False for absolute paths and for "..".
bool StaysInside(const std::string& name);

}  // namespace roomtex
