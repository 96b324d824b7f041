// A model.glb of roomtex-texture as a mesh with texture images, in the scan frame.

#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <sstream>
#include <stdexcept>

#include <opencv2/imgproc.hpp>
#include <tiny_gltf.h>

#include "core/error.h"
#include "core/gltf_frame.h"
#include "core/output_file.h"
#include "core/photo.h"
#include "texture/render/mesh_renderer.h"
#include "texture/render/unpack_glb.h"

namespace roomtex {
namespace {

InputError NotOurs(const std::string& path) {
  return {path, "", "is laid out in a way that roomtex-texture does not write",
          "Give a model.glb of roomtex-texture; roomtex-view shows others"};
}

// One accessor, its numbers as doubles: floats, or integers as model_web.glb has them (normalised
// ones from 0 to 1).
class Elements {
 public:
  // Checks the bounds.
  Elements(const tinygltf::Model& model, int number, int min_components, const std::string& path)
      : accessor_(model.accessors.at(number)) {
    const tinygltf::BufferView& view = model.bufferViews.at(accessor_.bufferView);
    const std::vector<unsigned char>& bytes = model.buffers.at(view.buffer).data;
    const int size = SizeOf(accessor_.componentType);
    const int components = tinygltf::GetNumComponentsInType(accessor_.type);
    if (size == 0 || components < min_components) throw NotOurs(path);
    const size_t packed = static_cast<size_t>(size) * components;
    stride_ = view.byteStride > 0 ? view.byteStride : packed;
    const size_t begin = view.byteOffset + accessor_.byteOffset;
    if (stride_ < packed) throw NotOurs(path);
    if (view.byteOffset > bytes.size() || begin < view.byteOffset || begin > bytes.size() ||
        (accessor_.count > 0 &&
         (packed > bytes.size() - begin ||
          accessor_.count - 1 > (bytes.size() - begin - packed) / stride_))) {
      throw InputError(path, "", "holds less than it says", "Write it again");
    }
    begin_ = bytes.data() + begin;
  }

  size_t count() const { return accessor_.count; }
  double At(size_t element, int component) const {
    const unsigned char* at = begin_ + element * stride_;
    switch (accessor_.componentType) {
      case TINYGLTF_COMPONENT_TYPE_FLOAT:
        return Value<float>(at, component);
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
        return Value<uint32_t>(at, component);
      default:
        return Value<uint16_t>(at, component) / (accessor_.normalized ? 65535.0 : 1.0);
    }
  }

 private:
  static int SizeOf(int component_type) {
    switch (component_type) {
      case TINYGLTF_COMPONENT_TYPE_FLOAT:
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
        return 4;
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
        return 2;
      default:
        return 0;
    }
  }
  template <typename T>
  static double Value(const unsigned char* at, int component) {
    T value;
    std::memcpy(&value, at + component * sizeof value, sizeof value);
    return static_cast<double>(value);
  }

  const tinygltf::Accessor& accessor_;
  size_t stride_ = 0;
  const unsigned char* begin_ = nullptr;
};

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
                  const tinygltf::Node& node, const std::string& path, ColoredMesh* mesh) {
  const auto first = static_cast<int>(mesh->points.size());
  const auto part = [](const std::vector<double>& values, double other) -> Eigen::Vector3d {
    if (values.size() != 3) return Eigen::Vector3d::Constant(other);
    return Eigen::Vector3d(values[0], values[1], values[2]);
  };
  const Eigen::Vector3d translation = part(node.translation, 0), scale = part(node.scale, 1);
  const Elements positions(model, primitive.attributes.at("POSITION"), 3, path);
  const size_t count = positions.count();
  for (size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d p(positions.At(i, 0), positions.At(i, 1), positions.At(i, 2));
    mesh->points.push_back(translation + scale.cwiseProduct(p));
  }
  mesh->colors.resize(mesh->points.size(), Eigen::Matrix<uint8_t, 3, 1>::Constant(128));
  mesh->uv.resize(mesh->points.size(), Eigen::Vector2f::Zero());
  const auto require_count = [&](const Elements& elements) {
    if (elements.count() != count) throw NotOurs(path);
  };
  int texture = -1;
  if (primitive.attributes.count("TEXCOORD_0") > 0 && primitive.material >= 0) {
    texture = model.materials.at(primitive.material).pbrMetallicRoughness.baseColorTexture.index;
    const Elements uv(model, primitive.attributes.at("TEXCOORD_0"), 2, path);
    require_count(uv);
    for (size_t i = 0; i < count; ++i) {
      Eigen::Vector2f& place = mesh->uv[first + i];
      place = Eigen::Vector2d(uv.At(i, 0), uv.At(i, 1)).cast<float>();
      if (!place.allFinite()) {
        throw InputError(path, "", "has a place in the texture that is no number",
                         "Write it again");
      }
    }
  } else if (primitive.attributes.count("COLOR_0") > 0) {
    const Elements light(model, primitive.attributes.at("COLOR_0"), 3, path);
    require_count(light);
    for (size_t i = 0; i < 3 * count; ++i) {
      mesh->colors[first + i / 3][i % 3] =
          SrgbByteFromLinear(static_cast<float>(light.At(i / 3, static_cast<int>(i % 3))));
    }
  } else if (primitive.material >= 0) {
    const std::vector<double>& light =
        model.materials.at(primitive.material).pbrMetallicRoughness.baseColorFactor;
    for (size_t i = 0; i < 3 * count; ++i) {
      mesh->colors[first + i / 3][i % 3] = SrgbByteFromLinear(static_cast<float>(light.at(i % 3)));
    }
  }
  if (primitive.mode == TINYGLTF_MODE_POINTS) return;
  const int image = texture < 0 ? -1 : model.textures.at(texture).source;
  if (image >= static_cast<int>(mesh->textures.size())) throw NotOurs(path);
  const Elements corners(model, primitive.indices, 1, path);
  for (size_t i = 0; i + 2 < corners.count(); i += 3) {
    Triangle triangle;
    for (int k = 0; k < 3; ++k) {
      const double corner = corners.At(i + k, 0);
      if (!(corner >= 0 && corner < static_cast<double>(count))) {
        throw InputError(path, "", "has a face that names no vertex", "Write it again");
      }
      triangle[k] = first + static_cast<int>(corner);
    }
    mesh->triangles.push_back(triangle);
    mesh->texture_of_triangle.push_back(image);
  }
}

// What the node above all others turns to glTF's +Y.
Eigen::Vector3d UpOf(const tinygltf::Model& model) {
  for (const tinygltf::Node& node : model.nodes) {
    const std::vector<double>& q = node.rotation;  // x y z w
    if (node.name != kRootOfScanFrame || q.size() != 4) continue;
    const Eigen::Quaterniond turn(q[3], q[0], q[1], q[2]);
    if (std::abs(turn.norm() - 1) > 0.01) break;
    return turn.normalized().conjugate() * Eigen::Vector3d::UnitY();
  }
  return Eigen::Vector3d::Zero();
}

}  // namespace

ColoredMesh ReadTexturedMesh(const std::string& path) {
  RequireFile(path, "Give a model.glb of roomtex-texture");
  std::ifstream stream(path, std::ios::binary);
  std::stringstream file;
  file << stream.rdbuf();
  const std::string bytes = UnpackGlb(path, file.str());
  tinygltf::TinyGLTF loader;
  loader.SetFsCallbacks({});  // no other files
  tinygltf::Model model;
  std::string error, warning;
  if (bytes.size() > std::numeric_limits<unsigned int>::max() ||
      !loader.LoadBinaryFromMemory(&model, &error, &warning,
                                   reinterpret_cast<const unsigned char*>(bytes.data()),
                                   static_cast<unsigned int>(bytes.size()))) {
    throw InputError(path, "", "is no glTF file that can be read", "Write it again");
  }
  ColoredMesh mesh;
  for (const tinygltf::Image& image : model.images) mesh.textures.push_back(ImageOf(image, path));
  try {
    for (const tinygltf::Node& node : model.nodes) {
      if (node.mesh < 0) continue;
      for (const tinygltf::Primitive& primitive : model.meshes.at(node.mesh).primitives) {
        AddPrimitive(model, primitive, node, path, &mesh);
      }
    }
  } catch (const std::out_of_range&) {  // a number that names nothing
    throw NotOurs(path);
  }
  if (mesh.triangles.empty()) throw InputError(path, "", "has no faces", "");
  mesh.up = UpOf(model);
  return mesh;
}

}  // namespace roomtex
