#include "texture/view/view_model.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include <Eigen/Geometry>

#include "core/error.h"
#include "core/json_text.h"
#include "core/output_file.h"
#include "core/report.h"
#include "core/text.h"
#include "importers/file_reader.h"
#include "importers/ply_header.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;

std::array<int, 2> JpegSize(const std::string& bytes) {
  const auto byte = [&bytes](size_t at) { return static_cast<uint8_t>(bytes[at]); };
  size_t at = 2;
  while (at + 9 < bytes.size()) {
    if (byte(at) != 0xff) return {0, 0};
    const int marker = byte(at + 1);
    if (marker == 0xff) {  // fill byte
      ++at;
      continue;
    }
    const bool is_frame =
        marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if (is_frame) return {byte(at + 7) << 8 | byte(at + 8), byte(at + 5) << 8 | byte(at + 6)};
    at += 2 + (static_cast<size_t>(byte(at + 2)) << 8 | byte(at + 3));
  }
  return {0, 0};
}

}  // namespace

std::array<int, 2> EncodedImageSize(const std::string& bytes) {
  const auto big_endian = [&bytes](size_t at) {
    uint32_t value = 0;
    for (size_t i = at; i < at + 4; ++i) value = value << 8 | static_cast<uint8_t>(bytes[i]);
    return value < (1u << 24) ? static_cast<int>(value) : 0;
  };
  if (bytes.size() >= 24 && bytes.compare(0, 8, "\x89PNG\r\n\x1a\n") == 0) {
    return {big_endian(16), big_endian(20)};
  }
  if (bytes.size() > 4 && bytes.compare(0, 2, "\xff\xd8") == 0) return JpegSize(bytes);
  return {0, 0};
}

std::vector<Eigen::Vector3f> SmoothNormals(const ViewModel& model, int passes) {
  std::vector<Eigen::Vector3f> normals(model.points.size(), Eigen::Vector3f::Zero());
  for (const Triangle& t : model.triangles) {
    const Eigen::Vector3f& a = model.points[t[0]];
    const Eigen::Vector3f twice_area = (model.points[t[1]] - a).cross(model.points[t[2]] - a);
    for (const int corner : t) normals[corner] += twice_area;
  }
  const auto normalize = [](std::vector<Eigen::Vector3f>* vectors) {
    for (Eigen::Vector3f& v : *vectors) {
      const float length = v.norm();
      v = length > 0 && std::isfinite(length) ? Eigen::Vector3f(v / length)
                                              : Eigen::Vector3f::Zero();
    }
  };
  std::vector<Eigen::Vector3f> sums;
  for (int pass = 0; pass < passes; ++pass) {
    normalize(&normals);
    sums = normals;
    for (const Triangle& t : model.triangles) {
      const Eigen::Vector3f sum = normals[t[0]] + normals[t[1]] + normals[t[2]];
      for (const int corner : t) sums[corner] += sum;
    }
    normals.swap(sums);
  }
  normalize(&normals);
  return normals;
}

namespace {

// Vertex of model.ply with which the supplement begins, by the report beside the model.
std::optional<size_t> FirstSupplementVertex(const std::string& file) {
  const Json report = ReadJsonIfAny((fs::path(file).parent_path() / "report.json").string());
  if (!report.is_object() || !report.contains("supplement")) return std::nullopt;
  const Json& found = report["supplement"];
  const auto number = [&found](const char* key) {
    const bool is_one = found.is_object() && found.contains(key) && found[key].is_number_unsigned();
    return is_one ? found[key].get<size_t>() : 0;
  };
  if (number("num_vertices") == 0) return std::nullopt;
  return number("first_vertex");
}

// The faces of the supplement stand behind the others.
void MarkSupplement(size_t first_vertex, ViewModel* model) {
  size_t first = model->triangles.size();
  while (first > 0 && static_cast<size_t>(model->triangles[first - 1][0]) >= first_vertex) --first;
  model->first_supplement_triangle = first;
}

bool IsCloud(const std::string& ply_path) {
  const PlyHeader header = ReadPlyHeader(FileReader(ply_path));
  return std::none_of(header.elements.begin(), header.elements.end(),
                      [](const PlyElement& e) { return e.name == "face" && e.count > 0; });
}

}  // namespace

ViewModel ReadViewModel(const std::string& path) {
  std::error_code error;
  if (!fs::exists(path, error)) {
    throw InputError(path, "", "does not exist", "Give the folder that roomtex-texture wrote");
  }
  std::string file = path;
  if (fs::is_directory(path, error)) {
    file = (fs::path(path) / "model.glb").string();
    const std::string ply = (fs::path(path) / "model.ply").string();
    const std::string site = (fs::path(path) / "site.gltf").string();
    if (!fs::exists(file, error) || (fs::exists(ply, error) && IsCloud(ply))) file = ply;
    if (!fs::exists(file, error)) file = site;
    if (!fs::exists(file, error)) {
      throw InputError(path, "", "holds neither model.glb nor model.ply, nor site.gltf",
                       "Give the folder that roomtex-texture or roomtex-join wrote");
    }
  }
  const std::string extension = LowerCase(fs::path(file).extension().string());
  RequireFile(file, "Give what roomtex-texture wrote");
  if (extension == ".glb" || extension == ".gltf" || extension == ".ply") {
    const std::optional<size_t> supplement = FirstSupplementVertex(file);
    ViewModel model =
        extension == ".ply" ? ReadViewPly(file) : ReadViewGlb(file, supplement.has_value());
    if (extension == ".ply" && supplement && !model.is_cloud) MarkSupplement(*supplement, &model);
    if (!model.is_cloud) model.normals = SmoothNormals(model);
    return model;
  }
  throw InputError(path, "", "is neither a folder nor a .glb, .gltf or .ply file",
                   "Give the folder that roomtex-texture wrote");
}

}  // namespace roomtex
