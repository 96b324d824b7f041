#pragma once
#include <string>

namespace roomtex {

const std::string& BinFolder();     // of the built commands
const std::string& SourceFolder();  // of this checkout
// Real rooms and files that lie beside the checkout, or not; without a slash at the end.
std::string DataFolder(const std::string& name);

}  // namespace roomtex
