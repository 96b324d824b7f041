#include "texture/output/write_glb.h"

#include <algorithm>
#include <limits>

#include <opencv2/imgcodecs.hpp>
#include <tiny_gltf.h>

#include "core/decompositions.h"
#include "core/error.h"
#include "core/gltf_frame.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/photo.h"
#include "texture/output/textured_parts.h"

namespace roomtex {
namespace {

class GlbBuilder {
 public:
  GlbBuilder(const std::string& path, const GlbOptions& options) : path_(path), options_(options) {
    model_.asset.version = "2.0";
    model_.asset.generator = "roomtex-texture";
    model_.extensionsUsed = {"KHR_materials_unlit"};
    model_.buffers.emplace_back();
    model_.nodes.emplace_back();
    model_.nodes[0].name = kRootOfScanFrame;
    tinygltf::Scene scene;
    scene.nodes = {0};
    model_.scenes = {scene};
    model_.defaultScene = 0;
    tinygltf::Sampler sampler;
    sampler.minFilter = TINYGLTF_TEXTURE_FILTER_LINEAR_MIPMAP_LINEAR;
    sampler.magFilter = TINYGLTF_TEXTURE_FILTER_LINEAR;
    sampler.wrapS = sampler.wrapT = TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE;
    model_.samplers = {sampler};
  }

  void TurnUp(const Eigen::Vector3d& up) {
    const auto turn = RotationBetween(up, Eigen::Vector3d::UnitY());
    model_.nodes[0].rotation = {turn.x(), turn.y(), turn.z(), turn.w()};  // glTF: x y z w
  }

  void AddScan(const Scan& scan, const ColoredScan& colored) {
    const bool is_cloud = scan.kind() == Scan::Kind::kCloud;
    if (colored.triangles.empty() && !is_cloud) return;  // glTF knows no empty mesh
    const Bounds bounds = FindBounds(scan);
    centre_ = 0.5 * (bounds.min + bounds.max);
    tinygltf::Mesh mesh;
    const bool textured = scan.organised || !colored.atlas.empty();
    for (const TexturedPart& part : MakeTexturedParts(scan, colored, options_.max_texture_size)) {
      mesh.primitives.push_back(TexturedPrimitive(scan, colored, part));
    }
    if (is_cloud) {
      mesh.primitives.push_back(PointPrimitive(scan, colored));
    } else if (!textured) {
      mesh.primitives.push_back(VertexColorPrimitive(scan, colored));
    }
    if (mesh.primitives.empty()) return;  // triangles without an area
    tinygltf::Node node;
    node.name = "scan " + std::to_string(model_.meshes.size());
    node.mesh = static_cast<int>(model_.meshes.size());
    node.translation = {centre_.x(), centre_.y(), centre_.z()};
    model_.meshes.push_back(std::move(mesh));
    model_.nodes[0].children.push_back(static_cast<int>(model_.nodes.size()));
    model_.nodes.push_back(std::move(node));
  }

  void Write() {
    if (model_.buffers[0].data.size() > 0xffffff00u - (1u << 20)) {
      throw InputError(path_, "", "would exceed the 4 GB of a glTF file", "Use model.ply");
    }
    if (model_.nodes[0].children.empty()) model_.buffers.clear();
    OutputFile file(path_);
    tinygltf::TinyGLTF writer;
    if (!writer.WriteGltfSceneToFile(&model_, file.partial_path(), true, true, false, true)) {
      throw InputError(path_, "", "could not be written", "Check the space on the disk");
    }
    file.Commit();
  }

 private:
  tinygltf::Primitive TexturedPrimitive(const Scan& scan, const ColoredScan& colored,
                                        const TexturedPart& part);
  tinygltf::Primitive VertexColorPrimitive(const Scan& scan, const ColoredScan& colored);
  tinygltf::Primitive PointPrimitive(const Scan& scan, const ColoredScan& colored);

  // Appends bytes to the buffer, aligned to 4; gives the number of the new view.
  int AddView(const void* data, size_t size, int target) {
    std::vector<unsigned char>& bytes = model_.buffers[0].data;
    bytes.resize((bytes.size() + 3) / 4 * 4);
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = bytes.size();
    view.byteLength = size;
    view.target = target;
    const auto* begin = static_cast<const unsigned char*>(data);
    bytes.insert(bytes.end(), begin, begin + size);
    model_.bufferViews.push_back(view);
    return static_cast<int>(model_.bufferViews.size()) - 1;
  }

  int AddAccessor(int view, size_t count, int type, int component_type) {
    tinygltf::Accessor accessor;
    accessor.bufferView = view;
    accessor.count = count;
    accessor.type = type;
    accessor.componentType = component_type;
    model_.accessors.push_back(accessor);
    return static_cast<int>(model_.accessors.size()) - 1;
  }

  int AddFloats(const std::vector<float>& values, int type, int components) {
    const int view =
        AddView(values.data(), values.size() * sizeof(float), TINYGLTF_TARGET_ARRAY_BUFFER);
    return AddAccessor(view, values.size() / components, type, TINYGLTF_COMPONENT_TYPE_FLOAT);
  }

  // Positions relative to the scan's centre, with the bounds that glTF demands.
  int AddPositions(const Scan& scan, const std::vector<int>& vertices) {
    std::vector<float> positions;
    positions.reserve(3 * vertices.size());
    Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::max());
    Eigen::Vector3f high = -low;
    for (int v : vertices) {
      const Eigen::Vector3f p = (scan.points[v] - centre_).cast<float>();
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
      positions.insert(positions.end(), {p.x(), p.y(), p.z()});
    }
    const int accessor = AddFloats(positions, TINYGLTF_TYPE_VEC3, 3);
    model_.accessors[accessor].minValues = {low.x(), low.y(), low.z()};
    model_.accessors[accessor].maxValues = {high.x(), high.y(), high.z()};
    return accessor;
  }

  int AddColors(const ColoredScan& colored, const std::vector<int>& vertices) {
    std::vector<float> colors;
    colors.reserve(3 * vertices.size());
    for (int v : vertices) {
      for (uint8_t value : colored.samples.rgb[v]) colors.push_back(LinearFromSrgbByte()[value]);
    }
    return AddFloats(colors, TINYGLTF_TYPE_VEC3, 3);
  }

  int AddIndices(const std::vector<uint32_t>& corners) {
    const int view = AddView(corners.data(), corners.size() * sizeof(uint32_t),
                             TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
    return AddAccessor(view, corners.size(), TINYGLTF_TYPE_SCALAR,
                       TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT);
  }

  int AddMaterial(int texture) {
    tinygltf::Material material;
    material.name = texture >= 0 ? "photos" : "vertex colours";
    material.doubleSided = true;
    material.pbrMetallicRoughness.metallicFactor = 0;
    material.pbrMetallicRoughness.roughnessFactor = 1;
    material.pbrMetallicRoughness.baseColorTexture.index = texture;
    material.extensions["KHR_materials_unlit"] = tinygltf::Value(tinygltf::Value::Object());
    model_.materials.push_back(material);
    return static_cast<int>(model_.materials.size()) - 1;
  }

  std::string path_;
  GlbOptions options_;
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  tinygltf::Model model_;
};

tinygltf::Primitive GlbBuilder::TexturedPrimitive(const Scan& scan, const ColoredScan& colored,
                                                  const TexturedPart& part) {
  std::vector<unsigned char> bytes;
  tinygltf::Image image;
  if (options_.jpeg) {
    cv::imencode(".jpg", PartImage(scan, colored, part), bytes, {cv::IMWRITE_JPEG_QUALITY, 95});
    image.mimeType = "image/jpeg";
  } else {
    cv::imencode(".png", PartImage(scan, colored, part), bytes, {cv::IMWRITE_PNG_COMPRESSION, 2});
    image.mimeType = "image/png";
  }
  image.bufferView = AddView(bytes.data(), bytes.size(), 0);
  model_.images.push_back(image);
  tinygltf::Texture texture;
  texture.sampler = 0;
  texture.source = static_cast<int>(model_.images.size()) - 1;
  model_.textures.push_back(texture);

  std::vector<float> uv;
  uv.reserve(2 * part.uv.size());
  for (const Eigen::Vector2f& at : part.uv) uv.insert(uv.end(), {at.x(), at.y()});
  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_TRIANGLES;
  primitive.attributes["POSITION"] = AddPositions(scan, part.vertices);
  primitive.attributes["TEXCOORD_0"] = AddFloats(uv, TINYGLTF_TYPE_VEC2, 2);
  primitive.indices = AddIndices(part.corners);
  primitive.material = AddMaterial(static_cast<int>(model_.textures.size()) - 1);
  return primitive;
}

tinygltf::Primitive GlbBuilder::VertexColorPrimitive(const Scan& scan, const ColoredScan& colored) {
  std::vector<int> vertices, number(scan.points.size(), -1);
  std::vector<uint32_t> corners;
  for (const Triangle& t : colored.triangles) {
    for (int corner : t) {
      if (number[corner] < 0) {
        number[corner] = static_cast<int>(vertices.size());
        vertices.push_back(corner);
      }
      corners.push_back(static_cast<uint32_t>(number[corner]));
    }
  }
  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_TRIANGLES;
  primitive.attributes["POSITION"] = AddPositions(scan, vertices);
  primitive.attributes["COLOR_0"] = AddColors(colored, vertices);
  primitive.indices = AddIndices(corners);
  primitive.material = AddMaterial(-1);
  return primitive;
}

tinygltf::Primitive GlbBuilder::PointPrimitive(const Scan& scan, const ColoredScan& colored) {
  std::vector<int> vertices;
  for (int i = 0; i < static_cast<int>(scan.points.size()); ++i) {
    if (!scan.IsMissing(i)) vertices.push_back(i);
  }
  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_POINTS;
  primitive.attributes["POSITION"] = AddPositions(scan, vertices);
  primitive.attributes["COLOR_0"] = AddColors(colored, vertices);
  primitive.material = AddMaterial(-1);
  return primitive;
}

}  // namespace

void GlbOptions::Declare(OptionFields* fields) {
  fields
      ->Int(
          "Texture.max_size", &max_texture_size,
          "Longest side of one texture image of model.glb and model.obj, 256 to 16384; a "
          "larger texture is tiled. Larger = fewer images; not every viewer loads more than 4096.")
      .Within(256, 16384, "texels");
}

std::vector<std::string> GlbOptions::Problems() const { return ProblemsOf(*this); }

void WriteColoredGlb(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                     const std::string& path, const GlbOptions& options) {
  GlbBuilder builder(path, options);
  builder.TurnUp(scans.at(0).up);
  for (size_t s = 0; s < scans.size(); ++s) builder.AddScan(scans[s], colored[s]);
  builder.Write();
}

}  // namespace roomtex
