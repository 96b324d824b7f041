#pragma once
// Compressed glTF for readers that know nothing of it.

#include <string>

namespace roomtex {

// The bytes of a binary glTF file without EXT_meshopt_compression: its views unpacked into the one
// buffer. Anything else comes back as it is. Throws InputError (with `path`) for a compressed view
// that is broken.
std::string UnpackGlb(const std::string& path, std::string bytes);

}  // namespace roomtex
