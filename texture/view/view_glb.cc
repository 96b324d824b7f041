// An own reader, because the viewer opens files of any origin: everything that the JSON part says
// is compared with the bytes of the binary part, images stay encoded for the browser, and numbers
// are read in blocks, so that what lies in memory is the model alone.

#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <optional>

#include <Eigen/Geometry>

#include "core/error.h"
#include "core/json_text.h"
#include "core/photo.h"
#include "core/text.h"
#include "importers/file_reader.h"
#include "texture/view/gltf_elements.h"
#include "texture/view/view_model.h"

namespace roomtex {
namespace {

using json = Json;

// Of an image's side: no more than rounding puts a place beyond it.
constexpr float kBeside = 1e-3f;
const char kNotOurs[] = "Give a file of roomtex-texture, or save it without this";
constexpr int kMaxDepth = 32;           // of nodes
constexpr size_t kMaxJson = 256 << 20;  // bytes; ours have some thousand

// Triangles, where they stand.
struct Primitive {
  const json* triangles;
  Eigen::Affine3d scan_from_node;
};

class GlbReader {
 public:
  explicit GlbReader(const std::string& path) : path_(path), file_(path) {
    is_text_ = LowerCase(std::filesystem::path(path).extension().string()) == ".gltf";
    if (is_text_) {
      ParseRoot(0, file_.size());
    } else {
      ReadChunks();
    }
  }

  ViewModel Read(bool has_supplement) {
    model_.path = path_;
    CheckExtensions();
    ReadImages();
    const json scene = Object("scenes", Number(root_, "scene", 0));
    const json& roots = List(scene, "nodes");
    const std::string generator = Text(Member(root_, "asset"), "generator");
    is_joined_ = generator == "roomtex-join";
    const bool ours = generator == "roomtex-texture" || is_joined_;
    // Ours: what the root node turns is the scan frame.
    Eigen::Affine3d scan_from_gltf = Eigen::Affine3d::Identity();
    if (ours && roots.size() == 1) {
      scan_from_gltf = Transform(Object("nodes", Index(roots[0]))).inverse();
    }
    for (const json& node : roots) AddNode(Index(node), scan_from_gltf, 0);
    AddPrimitives(has_supplement && ours);
    BoundUv();
    if (model_.triangles.empty()) Fail("has no triangles", "Give what roomtex-texture wrote");
    model_.up = (scan_from_gltf.linear() * Eigen::Vector3d::UnitY()).normalized();
    Recentre();
    return std::move(model_);
  }

 private:
  [[noreturn]] void Fail(const std::string& finding, const std::string& remedy = kDamaged) const {
    throw InputError(path_, "", finding, remedy);
  }

  void ParseRoot(int64_t begin, int64_t size) {
    if (size > static_cast<int64_t>(kMaxJson)) Fail("is too long for a text of glTF", kNotOurs);
    root_ = ParseJson(file_.ReadSome(begin, size), path_, kDamaged);
    if (root_.is_object()) return;
    throw InputError(path_, BytePosition(begin), "the JSON part cannot be read", kDamaged);
  }

  void ReadChunks() {
    const auto word = [this](int64_t at) {
      uint32_t value;
      file_.Read(at, &value, 4);
      return value;
    };
    if (file_.size() < 20 || word(0) != 0x46546c67) {
      Fail("is no binary glTF (GLB)", "Give the model.glb that roomtex-texture wrote");
    }
    if (word(4) != 2)
      Fail("is glTF of version " + std::to_string(word(4)) + ", expected 2", kNotOurs);
    const uint32_t json_size = word(12);
    if (word(16) != 0x4e4f534a || json_size > file_.size() - 20 || json_size > kMaxJson) {
      throw InputError(path_, BytePosition(12), "the JSON part does not fit into the file",
                       kDamaged);
    }
    ParseRoot(20, json_size);
    const int64_t at = 20 + static_cast<int64_t>(json_size);
    if (at + 8 > file_.size()) return;  // without a binary part
    const uint32_t size = word(at);
    if (word(at + 4) != 0x004e4942 || size > file_.size() - at - 8) {
      throw InputError(
          path_, BytePosition(at),
          "the binary part of " + std::to_string(size) + " bytes does not fit into the file",
          "The file is cut off: copy it again");
    }
    binary_begin_ = at + 8;
    binary_size_ = size;
  }

  // Members of the JSON; a damaged one is an InputError.
  static const json& Member(const json& object, const char* name) {
    static const json kNone;
    const auto found = object.is_object() ? object.find(name) : object.end();
    return object.is_object() && found != object.end() ? *found : kNone;
  }
  const json& List(const json& object, const char* name) const {
    static const json kEmpty = json::array();
    const json& list = Member(object, name);
    if (list.is_null()) return kEmpty;
    if (!list.is_array()) Fail(std::string("\"") + name + "\" is no list");
    return list;
  }
  int64_t Index(const json& value) const {
    if (!value.is_number_unsigned() || value.get<uint64_t>() > (uint64_t{1} << 40)) {
      Fail("has " + value.dump().substr(0, 40) + " where a number from 0 on belongs");
    }
    return value.get<int64_t>();
  }
  int64_t Number(const json& object, const char* name, std::optional<int64_t> otherwise) const {
    const json& value = Member(object, name);
    if (value.is_null() && otherwise) return *otherwise;
    if (value.is_null()) Fail(std::string("lacks \"") + name + "\"");
    return Index(value);
  }
  static std::string Text(const json& object, const char* name) {
    const json& value = Member(object, name);
    return value.is_string() ? value.get<std::string>() : "";
  }
  const json& Object(const char* list, int64_t index) const {
    const json& objects = List(root_, list);
    if (index >= static_cast<int64_t>(objects.size()) || !objects[index].is_object()) {
      Fail(std::string("names number ") + std::to_string(index) + " of \"" + list +
           "\", there are " + std::to_string(objects.size()));
    }
    return objects[index];
  }

  void CheckExtensions() const {
    for (const json& name : List(root_, "extensionsRequired")) {
      const std::string text = name.is_string() ? name.get<std::string>() : "?";
      if (text == "KHR_materials_unlit") continue;
      Fail("needs the glTF extension " + text + ", which is not read", kNotOurs);
    }
  }

  struct Bytes {
    const FileReader* file;
    int64_t begin;
    size_t size;
  };
  // The binary part of a GLB; of a .gltf a file beside it, which roomtex-join leaves as it is.
  Bytes Buffer(int64_t number) const {
    const json& buffer = Object("buffers", number);
    const json& link = Member(buffer, "uri");
    if (!is_text_) {
      if (number != 0 || !link.is_null()) Fail("keeps data in another file", kNotOurs);
      return {&file_, binary_begin_, binary_size_};
    }
    if (!link.is_string() || link.get<std::string>().find(':') != std::string::npos) {
      Fail("keeps data elsewhere than in files beside it", kNotOurs);
    }
    std::unique_ptr<const FileReader>& file = others_[number];
    if (!file) {
      const auto folder = std::filesystem::path(path_).parent_path();
      file = std::make_unique<FileReader>((folder / PathOfLink(link)).string());
    }
    const int64_t said = Number(buffer, "byteLength", std::nullopt);
    if (file->size() < said || (is_joined_ && file->size() != said)) {
      Fail("was made with another " + file->path() + ", of " + std::to_string(said) + " bytes",
           "Run roomtex-join again");
    }
    return {file.get(), 0, static_cast<size_t>(said)};
  }

  Bytes View(int64_t number) const {
    const json& view = Object("bufferViews", number);
    const auto offset = static_cast<size_t>(Number(view, "byteOffset", 0));
    const auto size = static_cast<size_t>(Number(view, "byteLength", std::nullopt));
    const Bytes all = Buffer(Number(view, "buffer", std::nullopt));
    if (offset > all.size || size > all.size - offset) {
      Fail("says it holds " + std::to_string(offset + size) + " bytes of data, but has " +
           std::to_string(all.size));
    }
    return {all.file, all.begin + static_cast<int64_t>(offset), size};
  }

  GltfElements ElementsOf(int64_t number) const {
    const json& accessor = Object("accessors", number);
    if (!Member(accessor, "sparse").is_null()) Fail("has sparse accessors", kNotOurs);
    const Bytes of_view = View(Number(accessor, "bufferView", std::nullopt));
    GltfElements elements;
    elements.count = static_cast<size_t>(Number(accessor, "count", std::nullopt));
    elements.type = static_cast<int>(Number(accessor, "componentType", std::nullopt));
    elements.normalized = Member(accessor, "normalized") == true;
    const std::string type = Text(accessor, "type");
    elements.components = type == "SCALAR" ? 1 : type == "VEC2" ? 2 : type == "VEC3" ? 3 : 4;
    const size_t size = elements.type == 5121                            ? 1
                        : elements.type == 5123                          ? 2
                        : elements.type == 5125 || elements.type == 5126 ? 4
                                                                         : 0;
    if (size == 0) Fail("has numbers of a type that is not read", kNotOurs);
    const size_t element = size * static_cast<size_t>(elements.components);
    const json& view = Object("bufferViews", Number(accessor, "bufferView", std::nullopt));
    elements.stride = static_cast<size_t>(Number(view, "byteStride", 0));
    if (elements.stride == 0) elements.stride = element;
    const auto offset = static_cast<size_t>(Number(accessor, "byteOffset", 0));
    const bool fits = elements.stride >= element && elements.stride < (1u << 20) &&
                      offset <= of_view.size &&
                      (elements.count == 0 ||
                       (element <= of_view.size - offset &&
                        elements.count - 1 <= (of_view.size - offset - element) / elements.stride));
    if (!fits) {
      Fail("says that a list has " + std::to_string(elements.count) +
           " items, more than its bytes can hold");
    }
    elements.file = of_view.file;
    elements.begin = of_view.begin + static_cast<int64_t>(offset);
    elements.size = element;
    return elements;
  }

  void ReadImages() {
    for (const json& image : List(root_, "images")) {
      if (!Member(image, "uri").is_null()) Fail("keeps its images in other files", kNotOurs);
      const Bytes encoded = View(Number(image, "bufferView", std::nullopt));
      ViewImage result;
      result.bytes = std::make_shared<const std::string>(
          encoded.file->ReadSome(encoded.begin, static_cast<int64_t>(encoded.size)));
      const auto [width, height] = EncodedImageSize(*result.bytes);
      if (model_.images.size() >= static_cast<size_t>(std::numeric_limits<int16_t>::max())) {
        Fail("has more images than can be read", kNotOurs);
      }
      if (width <= 0 || height <= 0) Fail("has an image that is neither PNG nor JPEG", kNotOurs);
      result.width = width;
      result.height = height;
      result.type = (*result.bytes)[0] == '\xff' ? "image/jpeg" : "image/png";
      model_.images.push_back(std::move(result));
    }
  }

  Eigen::Affine3d Transform(const json& node) const {
    const auto numbers = [&](const char* name, std::vector<double> values) {
      const json& list = List(node, name);
      if (!list.empty() && list.size() != values.size()) Fail("has a node of a wrong transform");
      for (size_t i = 0; i < list.size(); ++i) {
        if (!list[i].is_number()) Fail("has a node of a wrong transform");
        values[i] = list[i].get<double>();
      }
      return values;
    };
    Eigen::Affine3d transform = Eigen::Affine3d::Identity();
    if (!List(node, "matrix").empty()) {
      const std::vector<double> m = numbers("matrix", std::vector<double>(16));
      transform.matrix() = Eigen::Map<const Eigen::Matrix4d>(m.data());
      transform.makeAffine();
    } else {
      const auto t = numbers("translation", {0, 0, 0}), s = numbers("scale", {1, 1, 1});
      const auto q = numbers("rotation", {0, 0, 0, 1});  // x y z w
      transform.translate(Eigen::Vector3d(t[0], t[1], t[2]));
      transform.rotate(Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized());
      transform.scale(Eigen::Vector3d(s[0], s[1], s[2]));
    }
    const double determinant = transform.linear().determinant();
    if (!transform.matrix().allFinite() || !(std::abs(determinant) > 1e-12)) {
      Fail("has a node whose transform cannot be inverted");
    }
    return transform;
  }

  void AddNode(int64_t number, const Eigen::Affine3d& scan_from_parent, int depth) {
    if (depth > kMaxDepth) Fail("has nodes that contain themselves or lie too deep");
    if (++num_nodes_ > 100000) Fail("has too many nodes", kNotOurs);
    const json& node = Object("nodes", number);
    const Eigen::Affine3d scan_from_node = scan_from_parent * Transform(node);
    if (!Member(node, "mesh").is_null()) {
      const json& mesh = Object("meshes", Number(node, "mesh", std::nullopt));
      for (const json& primitive : List(mesh, "primitives")) {
        if (Number(primitive, "mode", 4) != 4) continue;  // points and lines
        found_.push_back({&primitive, scan_from_node});
      }
    }
    for (const json& child : List(node, "children")) {
      if (depth == 0) last_node_ = found_.size();
      AddNode(Index(child), scan_from_node, depth + 1);
    }
  }

  // Of the primitive's material; null for one without.
  const json& TextureOf(const json& primitive) const {
    static const json kNone;
    if (Member(primitive, "material").is_null()) return kNone;
    const json& material = Object("materials", Number(primitive, "material", std::nullopt));
    const json& reference = Member(Member(material, "pbrMetallicRoughness"), "baseColorTexture");
    if (reference.is_null()) return kNone;
    return Object("textures", Number(reference, "index", std::nullopt));
  }

  // Index into images, -1 for a material without.
  int PageOf(const json& primitive) const {
    const json& texture = TextureOf(primitive);
    if (texture.is_null()) return -1;
    const int64_t page = Number(texture, "source", std::nullopt);
    if (page >= static_cast<int64_t>(model_.images.size()))
      Fail("names an image that is not there");
    return static_cast<int>(page);
  }

  // What is seen beyond the sides of the primitive's texture: repeated, if nothing is said.
  std::array<int, 2> WrapOf(const json& primitive) const {
    std::array<int, 2> wrap = {ViewImage::kRepeat, ViewImage::kRepeat};
    const json& texture = TextureOf(primitive);
    if (Member(texture, "sampler").is_null()) return wrap;
    const json& sampler = Object("samplers", Number(texture, "sampler", std::nullopt));
    const char* const names[] = {"wrapS", "wrapT"};
    for (size_t k = 0; k < 2; ++k) {
      const int64_t number = Number(sampler, names[k], ViewImage::kRepeat);
      if (number == ViewImage::kClamp || number == ViewImage::kMirror) {
        wrap[k] = static_cast<int>(number);
      }
    }
    return wrap;
  }

  void BoundUv() {
    constexpr float kMostTimes = 1000;  // a repeated image
    for (Eigen::Vector2f& uv : model_.uv) {
      uv = uv.allFinite() ? uv.cwiseMax(-kMostTimes).cwiseMin(kMostTimes).eval()
                          : Eigen::Vector2f::Zero().eval();
      const Eigen::Array2f low = uv.array() + kBeside, high = uv.array() - kBeside;
      model_.uv_low = model_.uv_low.cwiseMin(low.floor().matrix());
      model_.uv_high = model_.uv_high.cwiseMax(high.ceil().matrix());
    }
  }

  // Where the primitive shows more than the image once: else nothing of the other side is to shine
  // through at its sides.
  void TakeWrap(const json& primitive, int page, size_t first) {
    const std::array<int, 2> wrap = WrapOf(primitive);
    for (int k = 0; k < 2; ++k) {
      const bool is_beyond = std::any_of(
          model_.uv.begin() + static_cast<std::ptrdiff_t>(first), model_.uv.end(),
          [k](const Eigen::Vector2f& uv) { return uv[k] < -kBeside || uv[k] > 1 + kBeside; });
      if (is_beyond) model_.images[page].wrap[k] = wrap[k];
    }
  }

  GltfElements Positions(const json& primitive) const {
    const json& attributes = Member(primitive, "attributes");
    GltfElements positions = ElementsOf(Number(attributes, "POSITION", std::nullopt));
    if (positions.components != 3 || positions.type != 5126)
      Fail("has positions that are no floats");
    return positions;
  }

  // last_is_supplement: what is below the root's last node.
  void AddPrimitives(bool last_is_supplement) {
    // Room for all at once: vectors that grow take twice their size.
    size_t num_points = 0, num_corners = 0;
    bool textured = false, plain = false;
    for (const Primitive& found : found_) {
      const size_t count = Positions(*found.triangles).count;
      const bool indexed = !Member(*found.triangles, "indices").is_null();
      num_points += count;
      num_corners +=
          indexed ? ElementsOf(Number(*found.triangles, "indices", std::nullopt)).count : count;
      constexpr auto kMost = static_cast<size_t>(std::numeric_limits<int>::max());
      if (num_points > kMost || num_corners / 3 > kMost) {
        Fail("has more than 2^31 vertices or triangles", "Divide the mesh");
      }
      (PageOf(*found.triangles) >= 0 ? textured : plain) = true;
    }
    model_.points.reserve(num_points);
    model_.triangles.reserve(num_corners / 3);
    model_.page_of_triangle.reserve(num_corners / 3);
    if (textured) model_.uv.reserve(num_points);
    if (plain) model_.colors.reserve(num_points);
    for (size_t i = 0; i < found_.size(); ++i) {
      if (last_is_supplement && i == last_node_) {
        model_.first_supplement_triangle = model_.triangles.size();
      }
      AddPrimitive(found_[i], textured, plain);
    }
    if (last_is_supplement && last_node_ == found_.size()) {
      model_.first_supplement_triangle = model_.triangles.size();
    }
  }

  void AddPrimitive(const Primitive& found, bool textured, bool plain) {
    const json& primitive = *found.triangles;
    const GltfElements positions = Positions(primitive);
    const size_t first = model_.points.size();
    for (size_t i = 0; i < positions.count; ++i) {
      const Eigen::Vector3d p(positions.As<float>(i, 0), positions.As<float>(i, 1),
                              positions.As<float>(i, 2));
      const Eigen::Vector3d in_scan = found.scan_from_node * p;
      // Floats are relative to the first point, until all are known.
      if (!has_origin_ && in_scan.allFinite()) {
        model_.origin = in_scan;
        has_origin_ = true;
      }
      model_.points.push_back((in_scan - model_.origin).cast<float>());
    }
    const int page = PageOf(primitive);
    const json& attributes = Member(primitive, "attributes");
    if (textured) model_.uv.resize(model_.points.size(), Eigen::Vector2f::Zero());
    if (plain) model_.colors.resize(model_.points.size(), {200, 200, 200});
    AddColors(attributes, page, positions.count);
    if (page >= 0) TakeWrap(primitive, page, first);
    AddTriangles(primitive, first, page, found.scan_from_node.linear().determinant() < 0);
  }

  void AddColors(const json& attributes, int page, size_t count) {
    const size_t first = model_.points.size() - count;
    const char* name = page >= 0 ? "TEXCOORD_0" : "COLOR_0";
    if (Member(attributes, name).is_null()) {
      if (page >= 0) Fail("has a texture without texture coordinates");
      return;
    }
    const GltfElements values = ElementsOf(Number(attributes, name, std::nullopt));
    if (values.count != count || values.components < (page >= 0 ? 2 : 3)) {
      Fail(std::string("has another number of ") + name + " than of positions");
    }
    for (size_t i = 0; i < count; ++i) {
      if (page >= 0) {
        model_.uv[first + i] = {values.Float(i, 0), values.Float(i, 1)};
        continue;
      }
      for (int k = 0; k < 3; ++k) {
        model_.colors[first + i][k] = SrgbByteFromLinear(values.Float(i, k));
      }
    }
  }

  void AddTriangles(const json& primitive, size_t first, int page, bool mirrored) {
    const size_t num_points = model_.points.size() - first;
    GltfElements indices;
    const bool indexed = !Member(primitive, "indices").is_null();
    if (indexed) {
      indices = ElementsOf(Number(primitive, "indices", std::nullopt));
      if (indices.type == 5126) Fail("has indices that are no whole numbers");
    }
    const size_t num_corners = indexed ? indices.count : num_points;
    for (size_t i = 0; i + 2 < num_corners; i += 3) {
      Triangle triangle;
      for (int k = 0; k < 3; ++k) {
        const size_t corner = indexed ? indices.Index(i + k) : i + k;
        if (corner >= num_points) {
          Fail("has a face that names vertex " + std::to_string(corner) + " of " +
               std::to_string(num_points));
        }
        triangle[k] = static_cast<int>(first + corner);
      }
      if (mirrored) std::swap(triangle[1], triangle[2]);
      const bool finite = model_.points[triangle[0]].allFinite() &&
                          model_.points[triangle[1]].allFinite() &&
                          model_.points[triangle[2]].allFinite();
      if (!finite) continue;
      model_.triangles.push_back(triangle);
      model_.page_of_triangle.push_back(static_cast<int16_t>(page));
    }
  }

  // The origin goes into the middle of the room.
  void Recentre() {
    Eigen::AlignedBox3f box;
    for (const Triangle& triangle : model_.triangles) {
      for (const int corner : triangle) box.extend(model_.points[corner]);
    }
    const Eigen::Vector3f middle = box.center();
    model_.origin += middle.cast<double>();
    for (Eigen::Vector3f& p : model_.points) p -= middle;
  }

  std::string path_;
  FileReader file_;
  bool is_text_ = false;                                                 // .gltf
  bool is_joined_ = false;                                               // of roomtex-join
  mutable std::map<int64_t, std::unique_ptr<const FileReader>> others_;  // by buffer
  int64_t binary_begin_ = 0;
  size_t binary_size_ = 0;
  json root_;
  ViewModel model_;
  std::vector<Primitive> found_;
  int num_nodes_ = 0;
  bool has_origin_ = false;
  size_t last_node_ = 0;  // first of found_ that is below the root's last node
};

}  // namespace

ViewModel ReadViewGlb(const std::string& path, bool has_supplement) {
  return GlbReader(path).Read(has_supplement);
}

}  // namespace roomtex
