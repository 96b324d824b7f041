#include "texture/write_glb.h"

#include <algorithm>
#include <cstring>
#include <map>

#include <opencv2/imgcodecs.hpp>
#include <tiny_gltf.h>

#include "core/error.h"
#include "core/frames.h"
#include "core/output_file.h"
#include "core/photo.h"
#include "texture/write_texture.h"

namespace roomtex {
namespace {

// A part of a scan that shares one texture image.
struct Part {
  int first_column = 0, first_row = 0;    // samples
  int num_columns = 0, num_rows = 0;      // samples, the last ones shared with the next part
  std::vector<int> vertices;              // grid index
  std::vector<std::array<int, 2>> cells;  // column and row of each vertex within the part
  std::vector<uint32_t> corners;          // three per triangle, into vertices
};

class GlbBuilder {
 public:
  GlbBuilder(const std::string& path, const GlbOptions& options) : path_(path), options_(options) {
    model_.asset.version = "2.0";
    model_.asset.generator = "roomtex-texture";
    model_.extensionsUsed = {"KHR_materials_unlit"};
    model_.buffers.emplace_back();
    model_.nodes.emplace_back();
    model_.nodes[0].name = "scan frame, turned to +Y up";
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
    const auto turn = Eigen::Quaterniond::FromTwoVectors(up, Eigen::Vector3d::UnitY());
    model_.nodes[0].rotation = {turn.x(), turn.y(), turn.z(), turn.w()};  // glTF: x y z w
  }

  void AddScan(const Scan& scan, const ColoredScan& colored) {
    if (colored.triangles.empty()) return;  // glTF knows no empty mesh
    const Bounds bounds = FindBounds(scan);
    centre_ = 0.5 * (bounds.min + bounds.max);
    tinygltf::Mesh mesh;
    if (scan.organised) {
      for (const Part& part : SplitGrid(scan, colored)) {
        mesh.primitives.push_back(TexturedPrimitive(scan, colored, part));
      }
    } else {
      mesh.primitives.push_back(VertexColorPrimitive(scan, colored));
    }
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
  std::vector<Part> SplitGrid(const Scan& scan, const ColoredScan& colored) const;
  cv::Mat PartImage(const Scan& scan, const ColoredScan& colored, const Part& part) const;
  tinygltf::Primitive TexturedPrimitive(const Scan& scan, const ColoredScan& colored,
                                        const Part& part);
  tinygltf::Primitive VertexColorPrimitive(const Scan& scan, const ColoredScan& colored);

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

// Corner columns of a triangle, unrolled: where a full turn closes, column 0 becomes num_columns.
std::array<int, 3> UnrolledColumns(const Triangle& t, int num_columns) {
  std::array<int, 3> columns{t[0] % num_columns, t[1] % num_columns, t[2] % num_columns};
  const int low = std::min({columns[0], columns[1], columns[2]});
  const int high = std::max({columns[0], columns[1], columns[2]});
  if (high - low > 1 && num_columns > 2) {
    for (int& column : columns) column += column == 0 ? num_columns : 0;
  }
  return columns;
}

std::vector<Part> GlbBuilder::SplitGrid(const Scan& scan, const ColoredScan& colored) const {
  const int scale =
      colored.texture.num_columns > 0 ? colored.texture.num_columns / scan.num_columns : 1;
  const int samples = std::max(2, options_.max_texture_size / scale);
  const int quads = samples - 1;
  std::map<std::pair<int, int>, Part> parts;  // by row and column of the part
  std::map<std::pair<int, int>, std::vector<int>> local_of;
  for (const Triangle& t : colored.triangles) {
    const std::array<int, 3> columns = UnrolledColumns(t, scan.num_columns);
    const std::array<int, 3> rows{t[0] / scan.num_columns, t[1] / scan.num_columns,
                                  t[2] / scan.num_columns};
    const std::pair<int, int> key{*std::min_element(rows.begin(), rows.end()) / quads,
                                  *std::min_element(columns.begin(), columns.end()) / quads};
    Part& part = parts[key];
    std::vector<int>& local = local_of[key];
    if (part.num_columns == 0) {
      part.first_row = key.first * quads;
      part.first_column = key.second * quads;
      part.num_rows = std::min(samples, scan.num_rows - part.first_row);
      part.num_columns = std::min(samples, scan.num_columns + 1 - part.first_column);
      local.assign(static_cast<size_t>(part.num_rows) * part.num_columns, -1);
    }
    for (int k = 0; k < 3; ++k) {
      const int column = columns[k] - part.first_column, row = rows[k] - part.first_row;
      int& number = local[row * part.num_columns + column];
      if (number < 0) {
        number = static_cast<int>(part.vertices.size());
        part.vertices.push_back(t[k]);
        part.cells.push_back({column, row});
      }
      part.corners.push_back(static_cast<uint32_t>(number));
    }
  }
  std::vector<Part> list;
  for (auto& [key, part] : parts) list.push_back(std::move(part));
  return list;
}

cv::Mat GlbBuilder::PartImage(const Scan& scan, const ColoredScan& colored,
                              const Part& part) const {
  const bool fine = colored.texture.num_columns > 0;
  const ColorGrid& grid = fine ? colored.texture : colored.samples;
  const int scale = fine ? colored.texture.num_columns / scan.num_columns : 1;
  cv::Mat3b image(part.num_rows * scale, part.num_columns * scale, cv::Vec3b(0, 0, 0));
  cv::Mat1b known(image.size(), uint8_t{0});
  for (int row = 0; row < image.rows; ++row) {
    for (int column = 0; column < image.cols; ++column) {
      const int grid_column = (part.first_column * scale + column) % grid.num_columns;
      const int grid_row = part.first_row * scale + row;
      const int sample = scan.Index(grid_column / scale, grid_row / scale);
      if (scan.IsMissing(sample)) continue;
      const auto& [r, g, b] =
          grid.rgb[static_cast<size_t>(grid_row) * grid.num_columns + grid_column];
      image(row, column) = {b, g, r};
      known(row, column) = 1;
    }
  }
  cv::Mat painted = image;
  PaintGutters(known, 16 * scale, &painted);
  return painted;
}

tinygltf::Primitive GlbBuilder::TexturedPrimitive(const Scan& scan, const ColoredScan& colored,
                                                  const Part& part) {
  std::vector<unsigned char> png;
  cv::imencode(".png", PartImage(scan, colored, part), png, {cv::IMWRITE_PNG_COMPRESSION, 2});
  tinygltf::Image image;
  image.mimeType = "image/png";
  image.bufferView = AddView(png.data(), png.size(), 0);
  model_.images.push_back(image);
  tinygltf::Texture texture;
  texture.sampler = 0;
  texture.source = static_cast<int>(model_.images.size()) - 1;
  model_.textures.push_back(texture);

  std::vector<float> uv;
  uv.reserve(2 * part.cells.size());
  for (const auto& [column, row] : part.cells) {
    const Eigen::Vector2d at =
        GltfUvFromImg({column + 0.5, row + 0.5}, part.num_columns, part.num_rows);
    uv.insert(uv.end(), {static_cast<float>(at.x()), static_cast<float>(at.y())});
  }
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
  std::vector<float> colors;
  for (int v : vertices) {
    for (uint8_t value : colored.samples.rgb[v]) colors.push_back(LinearFromSrgbByte()[value]);
  }
  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_TRIANGLES;
  primitive.attributes["POSITION"] = AddPositions(scan, vertices);
  primitive.attributes["COLOR_0"] = AddFloats(colors, TINYGLTF_TYPE_VEC3, 3);
  primitive.indices = AddIndices(corners);
  primitive.material = AddMaterial(-1);
  return primitive;
}

}  // namespace

void WriteColoredGlb(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                     const std::string& path, const GlbOptions& options) {
  GlbBuilder builder(path, options);
  builder.TurnUp(scans.at(0).up);
  for (size_t s = 0; s < scans.size(); ++s) builder.AddScan(scans[s], colored[s]);
  builder.Write();
}

}  // namespace roomtex
