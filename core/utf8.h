#pragma once
// Characters of more than one byte.

#include <cstddef>
#include <string_view>

namespace roomtex {

// Bytes of the UTF-8 character that begins at text[i]; 0 if none does.
size_t Utf8Bytes(std::string_view text, size_t i);

}  // namespace roomtex
