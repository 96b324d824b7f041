#include "core/jpeg_facts.h"

#include <cstddef>
#include <string_view>

namespace roomtex {
namespace {

// The start of a frame of any kind of coding; the three between them are tables and an extension.
bool IsFrame(int marker) {
  return marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
}

}  // namespace

JpegFacts FindJpegFacts(const std::vector<unsigned char>& bytes) {
  constexpr size_t kComponentsAt = 7;  // behind length, precision, height and width
  constexpr int kApp14 = 0xee;
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  JpegFacts facts;
  size_t i = 2;
  while (i + 1 < bytes.size()) {
    if (bytes[i] != 0xff || bytes[i + 1] == 0xff) {
      ++i;  // coded data or fill bytes
      continue;
    }
    const int marker = bytes[i + 1];
    if (marker == 0xd9) {
      facts.is_whole = true;
      return facts;
    }
    i += 2;
    const bool stands_alone = marker == 0 || marker == 1 || (marker >= 0xd0 && marker <= 0xd7);
    if (stands_alone) continue;
    if (i + 1 >= bytes.size()) return facts;
    if (IsFrame(marker) && i + kComponentsAt < bytes.size()) {
      facts.num_components = bytes[i + kComponentsAt];
    }
    if (marker == kApp14 && text.substr(i + 2, 5) == "Adobe") facts.has_adobe_marker = true;
    i += static_cast<size_t>(bytes[i] << 8 | bytes[i + 1]);  // length of the segment
  }
  return facts;
}

}  // namespace roomtex
