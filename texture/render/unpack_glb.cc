// EXT_meshopt_compression undone, so that a reader of glTF without it reads the file.

#include "texture/render/unpack_glb.h"

#include <cstring>

#include <meshoptimizer.h>

#include "core/error.h"
#include "core/json_text.h"

namespace roomtex {
namespace {

constexpr size_t kHeader = 12, kChunkHeader = 8;
constexpr size_t kMostUnpacked = size_t{4} << 30;

uint32_t WordAt(const std::string& bytes, size_t offset) {
  uint32_t word = 0;
  if (offset + sizeof word <= bytes.size()) std::memcpy(&word, bytes.data() + offset, sizeof word);
  return word;
}

void Put(uint32_t word, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&word), sizeof word);
}

InputError Broken(const std::string& path, const std::string& what) {
  return {path, "", what, "Write it again with roomtex-texture"};
}

// Unpacks one view behind `binary` and makes it a plain one.
void UnpackView(const std::string& path, Json* view, std::string* binary) {
  const Json packed = view->at("extensions").at("EXT_meshopt_compression");
  const size_t offset = packed.at("byteOffset"), length = packed.at("byteLength");
  const size_t stride = packed.at("byteStride"), count = packed.at("count");
  const bool is_index = packed.at("mode") == "TRIANGLES";
  // Both encodings take more than a byte for 1024 bytes.
  const bool possible =
      offset <= binary->size() && length <= binary->size() - offset && stride > 0 &&
      stride <= 256 && count <= kMostUnpacked / stride && count * stride / 1024 <= length &&
      (is_index ? (stride == 2 || stride == 4) && count % 3 == 0 : stride % 4 == 0);
  if (!possible) throw Broken(path, "has a compressed view that is not inside the file");
  std::string unpacked(count * stride, '\0');
  const auto* from = reinterpret_cast<const unsigned char*>(binary->data()) + offset;
  const int failed = is_index
                         ? meshopt_decodeIndexBuffer(unpacked.data(), count, stride, from, length)
                         : meshopt_decodeVertexBuffer(unpacked.data(), count, stride, from, length);
  if (failed != 0) throw Broken(path, "has a compressed view that cannot be unpacked");
  binary->resize((binary->size() + 3) / 4 * 4);
  (*view)["buffer"] = 0;
  (*view)["byteOffset"] = binary->size();
  (*view)["byteLength"] = unpacked.size();
  view->erase("extensions");
  *binary += unpacked;
}

}  // namespace

std::string UnpackGlb(const std::string& path, std::string bytes) {
  const size_t json_length = WordAt(bytes, kHeader);
  const size_t binary_at = kHeader + kChunkHeader + json_length;
  if (binary_at + kChunkHeader > bytes.size()) return bytes;
  Json gltf = ParseJson(bytes.substr(kHeader + kChunkHeader, json_length), path,
                        "Write it again with roomtex-texture");
  if (!gltf.is_object() || !gltf.contains("bufferViews")) return bytes;
  std::string binary = bytes.substr(binary_at + kChunkHeader);
  bool is_packed = false;
  try {
    for (Json& view : gltf["bufferViews"]) {
      if (!view.contains("extensions")) continue;
      UnpackView(path, &view, &binary);
      is_packed = true;
    }
    if (!is_packed) return bytes;
    binary.resize((binary.size() + 3) / 4 * 4);
    gltf["buffers"] = Json::array({{{"byteLength", binary.size()}}});
  } catch (const Json::exception&) {
    throw Broken(path, "has a compressed view without its numbers");
  }
  gltf.erase("extensionsRequired");
  std::string json = gltf.dump(-1, ' ', false, Json::error_handler_t::replace);
  json.resize((json.size() + 3) / 4 * 4, ' ');
  std::string plain = bytes.substr(0, 8);
  Put(static_cast<uint32_t>(kHeader + 2 * kChunkHeader + json.size() + binary.size()), &plain);
  Put(static_cast<uint32_t>(json.size()), &plain);
  plain += "JSON" + json;
  Put(static_cast<uint32_t>(binary.size()), &plain);
  return plain + std::string("BIN\0", 4) + binary;
}

}  // namespace roomtex
