// A model.glb of roomtex-texture as a mesh with texture images, in the scan frame.

#include <cstring>
#include <stdexcept>

#include <opencv2/imgproc.hpp>
#include <tiny_gltf.h>

#include "core/error.h"
#include "core/output_file.h"
#include "core/photo.h"
#include "texture/render/mesh_renderer.h"

namespace roomtex {
namespace {

InputError NotOurs(const std::string& path) {
  return {path, "", "is laid out in a way that roomtex-texture does not write",
          "Give a model.glb of roomtex-texture; roomtex-view shows others"};
}

template <typename T>
constexpr int kComponentType = TINYGLTF_COMPONENT_TYPE_FLOAT;
template <>
constexpr int kComponentType<uint32_t> = TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;

// The elements of an accessor, tightly packed as the writer packs them; checks the bounds.
template <typename T>
const T* Elements(const tinygltf::Model& model, int number, int components, size_t* count,
                  const std::string& path) {
  const tinygltf::Accessor& accessor = model.accessors.at(number);
  if (accessor.componentType != kComponentType<T> ||
      tinygltf::GetNumComponentsInType(accessor.type) != components) {
    throw NotOurs(path);
  }
  const tinygltf::BufferView& view = model.bufferViews.at(accessor.bufferView);
  if (view.byteStride != 0 && view.byteStride != components * sizeof(T)) throw NotOurs(path);
  const std::vector<unsigned char>& bytes = model.buffers.at(view.buffer).data;
  *count = accessor.count;
  const size_t begin = view.byteOffset + accessor.byteOffset;
  if (begin > bytes.size() || accessor.count > (bytes.size() - begin) / (components * sizeof(T))) {
    throw InputError(path, "", "holds less than it says", "Write it again");
  }
  return reinterpret_cast<const T*>(bytes.data() + begin);
}

cv::Mat ImageOf(const tinygltf::Image& image, const std::string& path) {
  if (image.width <= 0 || image.component < 3 || image.bits != 8) {
    throw InputError(path, "", "holds an image that cannot be decoded", "Write it again");
  }
  const cv::Mat rgb(image.height, image.width, CV_8UC(image.component),
                    const_cast<unsigned char*>(image.image.data()));
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, image.component == 4 ? cv::COLOR_RGBA2BGR : cv::COLOR_RGB2BGR);
  return bgr;
}

void AddPrimitive(const tinygltf::Model& model, const tinygltf::Primitive& primitive,
                  const Eigen::Vector3d& translation, const std::string& path, ColoredMesh* mesh) {
  size_t count = 0, num_corners = 0;
  const auto first = static_cast<int>(mesh->points.size());
  const float* positions =
      Elements<float>(model, primitive.attributes.at("POSITION"), 3, &count, path);
  for (size_t i = 0; i < count; ++i) {
    mesh->points.push_back(translation +
                           Eigen::Map<const Eigen::Vector3f>(positions + 3 * i).cast<double>());
  }
  mesh->colors.resize(mesh->points.size(), Eigen::Matrix<uint8_t, 3, 1>::Constant(128));
  mesh->uv.resize(mesh->points.size(), Eigen::Vector2f::Zero());
  int texture = -1;
  if (primitive.attributes.count("TEXCOORD_0") > 0 && primitive.material >= 0) {
    texture = model.materials.at(primitive.material).pbrMetallicRoughness.baseColorTexture.index;
    const float* uv =
        Elements<float>(model, primitive.attributes.at("TEXCOORD_0"), 2, &count, path);
    std::memcpy(mesh->uv[first].data(), uv, 8 * count);
  } else if (primitive.attributes.count("COLOR_0") > 0) {
    const float* light =
        Elements<float>(model, primitive.attributes.at("COLOR_0"), 3, &count, path);
    for (size_t i = 0; i < 3 * count; ++i) {
      mesh->colors[first + i / 3][i % 3] = SrgbByteFromLinear(light[i]);
    }
  } else if (primitive.material >= 0) {
    const std::vector<double>& light =
        model.materials.at(primitive.material).pbrMetallicRoughness.baseColorFactor;
    for (size_t i = 0; i < 3 * count; ++i) {
      mesh->colors[first + i / 3][i % 3] = SrgbByteFromLinear(static_cast<float>(light.at(i % 3)));
    }
  }
  const uint32_t* corners = Elements<uint32_t>(model, primitive.indices, 1, &num_corners, path);
  for (size_t i = 0; i + 2 < num_corners; i += 3) {
    Triangle triangle;
    for (int k = 0; k < 3; ++k) {
      triangle[k] = first + static_cast<int>(corners[i + k]);
      if (triangle[k] >= static_cast<int>(mesh->points.size())) {
        throw InputError(path, "", "has a face that names no vertex", "Write it again");
      }
    }
    mesh->triangles.push_back(triangle);
    mesh->texture_of_triangle.push_back(texture < 0 ? -1 : model.textures.at(texture).source);
  }
}

}  // namespace

ColoredMesh ReadTexturedMesh(const std::string& path) {
  RequireFile(path, "Give a model.glb of roomtex-texture");
  tinygltf::TinyGLTF loader;
  tinygltf::Model model;
  std::string error, warning;
  if (!loader.LoadBinaryFromFile(&model, &error, &warning, path)) {
    throw InputError(path, "", "is no glTF file that can be read", "Write it again");
  }
  ColoredMesh mesh;
  for (const tinygltf::Image& image : model.images) mesh.textures.push_back(ImageOf(image, path));
  try {
    for (const tinygltf::Node& node : model.nodes) {
      if (node.mesh < 0) continue;
      Eigen::Vector3d translation = Eigen::Vector3d::Zero();
      if (node.translation.size() == 3)
        translation = Eigen::Map<const Eigen::Vector3d>(node.translation.data());
      for (const tinygltf::Primitive& primitive : model.meshes.at(node.mesh).primitives) {
        AddPrimitive(model, primitive, translation, path, &mesh);
      }
    }
  } catch (const std::out_of_range&) {  // a number that names nothing
    throw NotOurs(path);
  }
  if (mesh.triangles.empty()) throw InputError(path, "", "has no faces", "");
  return mesh;
}

}  // namespace roomtex
