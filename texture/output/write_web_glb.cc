#include "texture/output/write_web_glb.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <meshoptimizer.h>
#include <opencv2/imgcodecs.hpp>

#include "core/decompositions.h"
#include "core/error.h"
#include "core/gltf_frame.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/photo.h"
#include "core/report.h"

namespace roomtex {
namespace {

constexpr double kSteps = 65535;
constexpr double kLongestStep = 1e-3;  // metres
constexpr int kWebJpegQuality = 88;
constexpr int kPointsPerTriangle = 5;

// glTF's numbers (glTF 2.0 specification).
constexpr int kUnsignedShort = 5123, kUnsignedInt = 5125, kFloat = 5126;
constexpr int kArrayBuffer = 34962, kElementArrayBuffer = 34963;
constexpr int kPointsMode = 0, kLinear = 9729, kLinearMipmapLinear = 9987, kClampToEdge = 33071;

uint16_t Unsigned16(double value_0_1) {
  return static_cast<uint16_t>(std::lround(std::clamp(value_0_1, 0.0, 1.0) * kSteps));
}

// Places of one scan, as its node takes them back: translation + scale * number.
struct Lattice {
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  double step = 0;  // 0 = floats about the translation

  explicit Lattice(const Scan& scan) {
    const Bounds bounds = FindBounds(scan);
    const double extent = (bounds.max - bounds.min).maxCoeff();
    const bool fits = extent > 0 && extent <= kLongestStep * kSteps;
    translation = fits ? bounds.min : Eigen::Vector3d(0.5 * (bounds.min + bounds.max));
    step = fits ? extent / kSteps : 0;
  }
};

class WebGlbBuilder {
 public:
  WebGlbBuilder(const std::string& path, const WebOptions& options, const Eigen::Vector3d& up)
      : path_(path), compressed_(options.compression == "meshopt") {
    meshopt_encodeVertexVersion(0);  // what EXT_meshopt_compression knows
    meshopt_encodeIndexVersion(1);
    const auto turn = RotationBetween(up, Eigen::Vector3d::UnitY());
    root_ = {{"name", kRootOfScanFrame},
             {"rotation", {turn.x(), turn.y(), turn.z(), turn.w()}},  // glTF: x y z w
             {"children", Json::array()}};
  }

  void AddScan(const Scan& scan, const ColoredScan& colored, const std::vector<TexturedPart>& parts,
               int every_point) {
    const Lattice lattice(scan);
    Json primitives = Json::array();
    for (const TexturedPart& part : parts) {
      primitives.push_back(Mesh(scan, colored, part, lattice));
    }
    if (scan.kind() == Scan::Kind::kCloud) {
      primitives.push_back(Points(scan, colored, every_point, lattice));
    }
    if (primitives.empty()) return;  // glTF knows no empty mesh
    const Eigen::Vector3d& t = lattice.translation;
    Json node = {{"name", "scan " + std::to_string(meshes_.size())},
                 {"mesh", meshes_.size()},
                 {"translation", {t.x(), t.y(), t.z()}}};
    if (lattice.step > 0) node["scale"] = {lattice.step, lattice.step, lattice.step};
    meshes_.push_back({{"primitives", primitives}});
    root_["children"].push_back(1 + nodes_.size());
    nodes_.push_back(node);
  }

  void Write();

 private:
  // Appends bytes to the file's buffer, aligned to 4; gives their place.
  size_t Append(const void* data, size_t size) {
    bytes_.resize((bytes_.size() + 3) / 4 * 4);
    const size_t offset = bytes_.size();
    const auto* begin = static_cast<const unsigned char*>(data);
    bytes_.insert(bytes_.end(), begin, begin + size);
    return offset;
  }

  // A view of count elements of `stride` bytes, compressed if wanted.
  size_t AddView(const void* data, size_t count, size_t stride, bool is_index) {
    std::vector<unsigned char> packed;
    if (compressed_) {
      if (is_index) {
        packed.resize(meshopt_encodeIndexBufferBound(count, count));
        packed.resize(meshopt_encodeIndexBuffer(packed.data(), packed.size(),
                                                static_cast<const uint32_t*>(data), count));
      } else {
        packed.resize(meshopt_encodeVertexBufferBound(count, stride));
        packed.resize(
            meshopt_encodeVertexBuffer(packed.data(), packed.size(), data, count, stride));
      }
    }
    const size_t size = count * stride;
    Json view = {{"buffer", compressed_ ? 1 : 0}, {"byteLength", size}};
    if (compressed_) {
      view["byteOffset"] = unpacked_bytes_;
      unpacked_bytes_ += (size + 3) / 4 * 4;
      view["extensions"]["EXT_meshopt_compression"] = {
          {"buffer", 0},
          {"byteOffset", Append(packed.data(), packed.size())},
          {"byteLength", packed.size()},
          {"byteStride", stride},
          {"count", count},
          {"mode", is_index ? "TRIANGLES" : "ATTRIBUTES"}};
    } else {
      view["byteOffset"] = Append(data, size);
    }
    view["target"] = is_index ? kElementArrayBuffer : kArrayBuffer;
    if (!is_index) view["byteStride"] = stride;
    views_.push_back(view);
    return views_.size() - 1;
  }

  size_t AddAccessor(size_t view, size_t count, const char* type, int component_type) {
    accessors_.push_back({{"bufferView", view},
                          {"componentType", component_type},
                          {"count", count},
                          {"type", type}});
    return accessors_.size() - 1;
  }

  size_t AddPositions(const Scan& scan, const std::vector<int>& vertices, const Lattice& lattice);
  size_t AddCoordinates(const std::vector<Eigen::Vector2f>& uv);
  size_t AddColors(const ColoredScan& colored, const std::vector<int>& vertices);
  Json Mesh(const Scan& scan, const ColoredScan& colored, TexturedPart part,
            const Lattice& lattice);
  Json Points(const Scan& scan, const ColoredScan& colored, int every_point,
              const Lattice& lattice);
  size_t AddMaterial(const cv::Mat& image);

  std::string path_;
  bool compressed_ = false;
  bool quantized_ = false;
  std::vector<unsigned char> bytes_;
  size_t unpacked_bytes_ = 0;
  Json root_;
  Json nodes_ = Json::array(), meshes_ = Json::array(), views_ = Json::array(),
       accessors_ = Json::array(), materials_ = Json::array(), images_ = Json::array(),
       textures_ = Json::array();
};

size_t WebGlbBuilder::AddPositions(const Scan& scan, const std::vector<int>& vertices,
                                   const Lattice& lattice) {
  const bool quantize = lattice.step > 0;
  quantized_ = quantized_ || quantize;
  std::vector<uint16_t> numbers;  // x y z 0
  std::vector<float> places;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::max());
  Eigen::Vector3d high = -low;
  for (const int v : vertices) {
    Eigen::Vector3d p = scan.points[v] - lattice.translation;
    for (int k = 0; k < 3; ++k) {
      if (quantize) {
        numbers.push_back(Unsigned16(p[k] / (lattice.step * kSteps)));
        p[k] = numbers.back();
      } else {
        places.push_back(static_cast<float>(p[k]));
        p[k] = places.back();
      }
    }
    if (quantize) numbers.push_back(0);
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const size_t view = quantize
                          ? AddView(numbers.data(), vertices.size(), 4 * sizeof(uint16_t), false)
                          : AddView(places.data(), vertices.size(), 3 * sizeof(float), false);
  const size_t accessor =
      AddAccessor(view, vertices.size(), "VEC3", quantize ? kUnsignedShort : kFloat);
  accessors_[accessor]["min"] = {low.x(), low.y(), low.z()};
  accessors_[accessor]["max"] = {high.x(), high.y(), high.z()};
  return accessor;
}

size_t WebGlbBuilder::AddCoordinates(const std::vector<Eigen::Vector2f>& uv) {
  std::vector<uint16_t> numbers;
  for (const Eigen::Vector2f& at : uv) {
    numbers.push_back(Unsigned16(at.x()));
    numbers.push_back(Unsigned16(at.y()));
  }
  const size_t view = AddView(numbers.data(), uv.size(), 2 * sizeof(uint16_t), false);
  const size_t accessor = AddAccessor(view, uv.size(), "VEC2", kUnsignedShort);
  accessors_[accessor]["normalized"] = true;
  return accessor;
}

size_t WebGlbBuilder::AddColors(const ColoredScan& colored, const std::vector<int>& vertices) {
  std::vector<uint16_t> numbers;
  for (const int v : vertices) {
    for (const uint8_t value : colored.samples.rgb[v]) {
      numbers.push_back(Unsigned16(LinearFromSrgbByte()[value]));
    }
    numbers.push_back(65535);
  }
  const size_t view = AddView(numbers.data(), vertices.size(), 4 * sizeof(uint16_t), false);
  const size_t accessor = AddAccessor(view, vertices.size(), "VEC4", kUnsignedShort);
  accessors_[accessor]["normalized"] = true;
  return accessor;
}

// An empty image: colours at the vertices.
size_t WebGlbBuilder::AddMaterial(const cv::Mat& image) {
  Json shade = {{"metallicFactor", 0}, {"roughnessFactor", 1}};
  if (!image.empty()) {
    std::vector<unsigned char> file;
    cv::imencode(".jpg", image, file, {cv::IMWRITE_JPEG_QUALITY, kWebJpegQuality});
    const size_t offset = Append(file.data(), file.size());
    views_.push_back({{"buffer", 0}, {"byteOffset", offset}, {"byteLength", file.size()}});
    images_.push_back({{"bufferView", views_.size() - 1}, {"mimeType", "image/jpeg"}});
    textures_.push_back({{"sampler", 0}, {"source", images_.size() - 1}});
    shade["baseColorTexture"] = {{"index", textures_.size() - 1}};
  }
  materials_.push_back({{"name", image.empty() ? "vertex colours" : "photos"},
                        {"doubleSided", true},
                        {"pbrMetallicRoughness", shade},
                        {"extensions", {{"KHR_materials_unlit", Json::object()}}}});
  return materials_.size() - 1;
}

Json WebGlbBuilder::Mesh(const Scan& scan, const ColoredScan& colored, TexturedPart part,
                         const Lattice& lattice) {
  // The order that compresses well.
  const size_t num_vertices = part.vertices.size();
  meshopt_optimizeVertexCache(part.corners.data(), part.corners.data(), part.corners.size(),
                              num_vertices);
  std::vector<uint32_t> order(num_vertices);
  meshopt_optimizeVertexFetchRemap(order.data(), part.corners.data(), part.corners.size(),
                                   num_vertices);
  meshopt_remapIndexBuffer(part.corners.data(), part.corners.data(), part.corners.size(),
                           order.data());
  meshopt_remapVertexBuffer(part.vertices.data(), part.vertices.data(), num_vertices, sizeof(int),
                            order.data());
  if (!part.uv.empty()) {
    meshopt_remapVertexBuffer(part.uv.data(), part.uv.data(), num_vertices, sizeof(Eigen::Vector2f),
                              order.data());
  }
  Json attributes = {{"POSITION", AddPositions(scan, part.vertices, lattice)}};
  const bool textured = part.width > 0;
  if (textured) {
    attributes["TEXCOORD_0"] = AddCoordinates(part.uv);
  } else {
    attributes["COLOR_0"] = AddColors(colored, part.vertices);
  }
  const size_t view = AddView(part.corners.data(), part.corners.size(), sizeof(uint32_t), true);
  const size_t indices = AddAccessor(view, part.corners.size(), "SCALAR", kUnsignedInt);
  return {{"attributes", attributes},
          {"indices", indices},
          {"material", AddMaterial(textured ? PartImage(scan, colored, part) : cv::Mat())}};
}

Json WebGlbBuilder::Points(const Scan& scan, const ColoredScan& colored, int every_point,
                           const Lattice& lattice) {
  std::vector<int> vertices;
  for (size_t i = 0; i < scan.points.size(); i += every_point) {
    if (!scan.IsMissing(static_cast<int>(i))) vertices.push_back(static_cast<int>(i));
  }
  const Json attributes = {{"POSITION", AddPositions(scan, vertices, lattice)},
                           {"COLOR_0", AddColors(colored, vertices)}};
  return {{"attributes", attributes}, {"mode", kPointsMode}, {"material", AddMaterial({})}};
}

void WebGlbBuilder::Write() {
  bytes_.resize((bytes_.size() + 3) / 4 * 4);
  if (bytes_.size() > 0xffffff00u - (1u << 20) || unpacked_bytes_ > 0xffffff00u) {
    throw InputError(path_, "", "would exceed the 4 GB of a glTF file",
                     "Give a smaller --Mesh.max_triangles");
  }
  Json nodes = Json::array({root_});
  if (root_["children"].empty()) nodes[0].erase("children");
  nodes.insert(nodes.end(), nodes_.begin(), nodes_.end());
  Json gltf = {{"asset", {{"version", "2.0"}, {"generator", "roomtex-texture"}}},
               {"scene", 0},
               {"scenes", Json::array({{{"nodes", {0}}}})},
               {"nodes", nodes}};
  std::vector<std::string> required;
  if (quantized_) required.emplace_back("KHR_mesh_quantization");
  if (compressed_ && !meshes_.empty()) required.emplace_back("EXT_meshopt_compression");
  std::vector<std::string> used = required;
  if (!materials_.empty()) used.emplace_back("KHR_materials_unlit");
  if (!used.empty()) gltf["extensionsUsed"] = used;
  if (!required.empty()) gltf["extensionsRequired"] = required;
  for (const auto& [name, list] : {std::pair<const char*, const Json&>{"meshes", meshes_},
                                   {"materials", materials_},
                                   {"textures", textures_},
                                   {"images", images_},
                                   {"accessors", accessors_},
                                   {"bufferViews", views_}}) {
    if (!list.empty()) gltf[name] = list;
  }
  if (!textures_.empty()) {
    gltf["samplers"] = Json::array({{{"magFilter", kLinear},
                                     {"minFilter", kLinearMipmapLinear},
                                     {"wrapS", kClampToEdge},
                                     {"wrapT", kClampToEdge}}});
  }
  if (!bytes_.empty()) {
    gltf["buffers"] = Json::array({{{"byteLength", bytes_.size()}}});
    if (compressed_) {  // what the compressed views unpack to; it has no bytes of its own
      gltf["buffers"].push_back(
          {{"byteLength", unpacked_bytes_},
           {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}});
    }
  }
  std::string json = gltf.dump();
  json.resize((json.size() + 3) / 4 * 4, ' ');
  OutputFile file(path_);
  const auto put = [&file](uint32_t value) {
    file.stream().write(reinterpret_cast<const char*>(&value), sizeof value);
  };
  const size_t chunk = bytes_.empty() ? 0 : 8 + bytes_.size();
  put(0x46546c67);  // "glTF"
  put(2);
  put(static_cast<uint32_t>(12 + 8 + json.size() + chunk));
  put(static_cast<uint32_t>(json.size()));
  put(0x4e4f534a);  // "JSON"
  file.stream() << json;
  if (chunk > 0) {
    put(static_cast<uint32_t>(bytes_.size()));
    put(0x004e4942);  // "BIN"
    file.stream().write(reinterpret_cast<const char*>(bytes_.data()),
                        static_cast<std::streamsize>(bytes_.size()));
  }
  file.Commit();
}

}  // namespace

void WebOptions::Declare(OptionFields* fields) {
  fields
      ->Int("Mesh.max_triangles", &max_triangles,
            "Triangles of model_web.glb and model.obj, whose texture images stay as they are; of a "
            "cloud five points for each. Larger = finer edges and larger files; 0 = all.")
      .Within(0, std::numeric_limits<int>::max() / kPointsPerTriangle);
  fields->Choice("Mesh.compression", &compression, {"meshopt", "none"},
                 "Mesh of model_web.glb: meshopt (EXT_meshopt_compression), which viewers of the "
                 "web read; none: larger, for programs that do not (Blender).");
}

std::vector<std::string> WebOptions::Problems() const { return ProblemsOf(*this); }

void WriteWebGlb(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                 const std::vector<std::vector<TexturedPart>>& parts, const std::string& path,
                 const WebOptions& options) {
  size_t num_points = 0;
  for (const Scan& scan : scans) {
    if (scan.kind() == Scan::Kind::kCloud) num_points += scan.points.size();
  }
  const size_t max_points = options.max_triangles > 0
                                ? static_cast<size_t>(kPointsPerTriangle) * options.max_triangles
                                : std::max<size_t>(num_points, 1);
  const auto every_point = std::max<size_t>(1, (num_points + max_points - 1) / max_points);
  WebGlbBuilder builder(path, options, scans.at(0).up);
  for (size_t s = 0; s < scans.size(); ++s) {
    builder.AddScan(scans[s], colored[s], parts[s], static_cast<int>(every_point));
  }
  builder.Write();
}

}  // namespace roomtex
