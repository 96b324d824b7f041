#include "texture/view/gltf_elements.h"

#include <algorithm>
#include <cctype>

namespace roomtex {

const char* GltfElements::At(size_t i) const {
  if (i < first || i >= end) {
    constexpr size_t kBlock = 1 << 20;  // bytes
    first = i;
    end = std::min(count, i + std::max<size_t>(kBlock / stride, 1));
    block.resize((end - first - 1) * stride + size);
    file->Read(begin + static_cast<int64_t>(first * stride), block.data(),
               static_cast<int64_t>(block.size()));
  }
  return block.data() + (i - first) * stride;
}

float GltfElements::Float(size_t i, int k) const {
  switch (type) {
    case 5121:
      return static_cast<float>(As<uint8_t>(i, k)) / (normalized ? 255.0f : 1.0f);
    case 5123:
      return static_cast<float>(As<uint16_t>(i, k)) / (normalized ? 65535.0f : 1.0f);
    default:
      return As<float>(i, k);
  }
}

uint32_t GltfElements::Index(size_t i) const {
  return type == 5121 ? As<uint8_t>(i, 0) : type == 5123 ? As<uint16_t>(i, 0) : As<uint32_t>(i, 0);
}

std::string PathOfLink(const std::string& link) {
  std::string path;
  for (size_t i = 0; i < link.size(); ++i) {
    const bool is_code = link[i] == '%' && i + 2 < link.size() &&
                         std::isxdigit(link[i + 1] & 255) && std::isxdigit(link[i + 2] & 255);
    path += is_code ? static_cast<char>(std::stoi(link.substr(i + 1, 2), nullptr, 16)) : link[i];
    if (is_code) i += 2;
  }
  return path;
}

}  // namespace roomtex
