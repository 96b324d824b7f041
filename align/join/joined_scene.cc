#include "align/join/joined_scene.h"

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>

#include <Eigen/Geometry>

#include "core/error.h"
#include "core/json_text.h"
#include "core/text.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;

constexpr char kTextureAnew[] = "Run roomtex-texture anew";

// A binary glTF file (glTF 2.0, 4.4): its JSON, and where its buffer begins.
struct Glb {
  Json json;
  uint64_t num_bytes = 0, buffer_begin = 0;
};

Glb ReadGlbHead(const std::string& path) {
  const auto fail = [&](const std::string& finding) {
    return InputError(path, "", finding, kTextureAnew);
  };
  std::ifstream stream(path, std::ios::binary);
  std::error_code error;
  Glb glb;
  glb.num_bytes = fs::file_size(path, error);
  uint32_t head[5] = {};
  if (error || !stream.read(reinterpret_cast<char*>(head), sizeof(head)) ||
      std::memcmp(head, "glTF", 4) != 0 || head[1] != 2 || std::memcmp(&head[4], "JSON", 4) != 0) {
    throw fail("is no binary glTF file");
  }
  const uint64_t json_bytes = head[3];
  if (head[2] != glb.num_bytes || sizeof(head) + json_bytes > glb.num_bytes) {
    throw fail("is not as long as it says");
  }
  std::string text(json_bytes, ' ');
  stream.read(text.data(), static_cast<std::streamsize>(json_bytes));
  if (!stream) throw fail("cannot be read to its end");
  glb.json = ParseJson(text, path, kTextureAnew);
  glb.buffer_begin = sizeof(head) + json_bytes + 8;  // behind the head of the next chunk
  return glb;
}

Json ToGltf(const Eigen::Quaterniond& q) { return {q.x(), q.y(), q.z(), q.w()}; }

// Numbers of other objects in the same file: so many of each are there before.
class SceneJoiner {
 public:
  explicit SceneJoiner(const std::string& folder) : folder_(folder) {
    scene_["asset"] = {{"version", "2.0"}, {"generator", "roomtex-join"}};
    scene_["scene"] = 0;
    scene_["scenes"] = Json::array({{{"nodes", {0}}}});
    scene_["nodes"] = Json::array({{{"name", "site frame, turned to +Y up"}}});
  }

  void Add(const SceneRoom& room) {
    const Glb glb = ReadGlbHead(room.glb_path);
    try {
      AddParts(room, glb);
    } catch (const Json::exception&) {
      throw InputError(room.glb_path, "", "is not as roomtex-texture writes it", kTextureAnew);
    }
  }

  Json Take() {
    if (!extensions_.empty()) scene_["extensionsUsed"] = extensions_;
    return std::move(scene_);
  }

 private:
  size_t Count(const char* key) const { return scene_.contains(key) ? scene_[key].size() : 0; }

  // A number of an object of `key`, as it is in the joined scene.
  void Shift(Json* object, const char* name, const char* key) const {
    if (object->contains(name)) (*object)[name] = object->at(name).get<size_t>() + Count(key);
  }

  void AddParts(const SceneRoom& room, const Glb& glb) {
    const Json& json = glb.json;
    const auto parts = [&](const char* key) { return json.value(key, Json::array()); };
    const Json& root = json.at("nodes").at(json.at("scenes").at(0).at("nodes").at(0).get<size_t>());
    if (scene_["nodes"].size() == 1 && root.contains("rotation")) {
      const auto& xyzw = root.at("rotation");
      const Eigen::Quaterniond up_from_scan(xyzw.at(3), xyzw.at(0), xyzw.at(1), xyzw.at(2));
      scene_["nodes"][0]["rotation"] =
          ToGltf(up_from_scan * room.site_from_scan.rotation.conjugate());
    }
    // All shifts are by what is there before this room: what is added waits.
    Json added = Json::object();
    if (!parts("buffers").empty()) {
      const fs::path glb_path = fs::absolute(room.glb_path).lexically_normal();
      const fs::path folder = fs::absolute(folder_).lexically_normal();
      added["buffers"] =
          Json::array({{{"uri", UrlPath(glb_path.lexically_relative(folder).generic_string())},
                        {"byteLength", glb.num_bytes}}});
    }
    for (Json view : parts("bufferViews")) {
      Shift(&view, "buffer", "buffers");
      view["byteOffset"] = view.value("byteOffset", uint64_t{0}) + glb.buffer_begin;
      added["bufferViews"].push_back(view);
    }
    AddShifted(parts("accessors"), "accessors", {{"bufferView", "bufferViews"}}, &added);
    AddShifted(parts("images"), "images", {{"bufferView", "bufferViews"}}, &added);
    AddShifted(parts("samplers"), "samplers", {}, &added);
    AddShifted(parts("textures"), "textures", {{"sampler", "samplers"}, {"source", "images"}},
               &added);
    for (Json material : parts("materials")) {
      if (material.contains("pbrMetallicRoughness")) {
        Json& color = material["pbrMetallicRoughness"];
        if (color.contains("baseColorTexture"))
          Shift(&color["baseColorTexture"], "index", "textures");
      }
      added["materials"].push_back(material);
    }
    for (Json mesh : parts("meshes")) {
      for (Json& primitive : mesh.at("primitives")) {
        Shift(&primitive, "indices", "accessors");
        Shift(&primitive, "material", "materials");
        for (auto& [name, accessor] : primitive.at("attributes").items()) {
          accessor = accessor.get<size_t>() + Count("accessors");
        }
      }
      added["meshes"].push_back(mesh);
    }
    AddNodes(room, json, root.value("children", Json::array()), &added);
    for (const Json& extension : parts("extensionsUsed")) extensions_.insert(extension);
    for (const auto& [key, list] : added.items()) {
      for (const Json& one : list) scene_[key].push_back(one);
    }
  }

  void AddShifted(const Json& list, const char* key,
                  std::initializer_list<std::pair<const char*, const char*>> shifts,
                  Json* added) const {
    for (Json one : list) {
      for (const auto& [name, of] : shifts) Shift(&one, name, of);
      (*added)[key].push_back(one);
    }
  }

  // The room's nodes, and one above those of its scans, which places the room.
  void AddNodes(const SceneRoom& room, const Json& json, const Json& of_root, Json* added) {
    const size_t before = Count("nodes");
    Json place = {{"name", room.name}};
    place["rotation"] = ToGltf(room.site_from_scan.rotation);
    place["translation"] = ToJson(room.site_from_scan.translation);
    for (const Json& child : of_root) place["children"].push_back(child.get<size_t>() + before);
    for (Json node : json.at("nodes")) {
      Shift(&node, "mesh", "meshes");
      if (node.contains("children")) {
        for (Json& child : node["children"]) child = child.get<size_t>() + before;
      }
      (*added)["nodes"].push_back(node);
    }
    // In the place of the room's root, which turned its up to +Y.
    const auto root = json.at("scenes").at(0).at("nodes").at(0).get<size_t>();
    (*added)["nodes"][root] = place;
    scene_["nodes"][0]["children"].push_back(before + root);
  }

  std::string folder_;
  Json scene_ = Json::object();
  std::set<std::string> extensions_;
};

}  // namespace

Json MakeJoinedScene(const std::vector<SceneRoom>& rooms, const std::string& folder) {
  SceneJoiner joiner(folder);
  for (const SceneRoom& room : rooms) joiner.Add(room);
  return joiner.Take();
}

}  // namespace roomtex
