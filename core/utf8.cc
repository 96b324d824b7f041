#include "core/utf8.h"

namespace roomtex {

size_t Utf8Bytes(std::string_view text, size_t i) {
  const auto byte = [&](size_t k) { return static_cast<unsigned char>(text[k]); };
  const size_t count = byte(i) < 0x80                      ? 1
                       : byte(i) >= 0xc2 && byte(i) < 0xe0 ? 2
                       : byte(i) >= 0xe0 && byte(i) < 0xf0 ? 3
                       : byte(i) >= 0xf0 && byte(i) < 0xf5 ? 4
                                                           : 0;
  if (i + count > text.size()) return 0;
  for (size_t k = i + 1; k < i + count; ++k) {
    if ((byte(k) & 0xc0) != 0x80) return 0;
  }
  return count;
}

}  // namespace roomtex
