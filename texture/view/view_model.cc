#include "texture/view/view_model.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>

#include <Eigen/Geometry>

#include "core/error.h"
#include "core/output_file.h"
#include "importers/ply.h"

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

bool ShowsFront(const ViewModel& model, int triangle, const Eigen::Vector3d& direction) {
  const Triangle& t = model.triangles[triangle];
  const Eigen::Vector3f sum = model.normals[t[0]] + model.normals[t[1]] + model.normals[t[2]];
  return sum.normalized().dot(direction.cast<float>()) < kFrontMargin;
}

ViewModel ReadViewPly(const std::string& path) {
  PlyVertexValues color{{"red", "green", "blue"}, {}};
  const Scan scan = ReadPly(path, {}, nullptr, &color);
  const Bounds bounds = FindBounds(scan);
  if (scan.triangles.empty() || !(bounds.min.x() <= bounds.max.x())) {
    throw InputError(path, "", "has no triangles", "Give what roomtex-texture wrote");
  }
  ViewModel model;
  model.path = path;
  model.up = scan.up;
  model.origin = 0.5 * (bounds.min + bounds.max);
  model.triangles = scan.triangles;
  model.page_of_triangle.assign(model.triangles.size(), -1);
  model.points.reserve(scan.points.size());
  for (const Eigen::Vector3d& p : scan.points) {
    model.points.push_back((p - model.origin).cast<float>());
  }
  model.colors.assign(scan.points.size(), {200, 200, 200});
  for (int k = 0; k < 3; ++k) {
    if (color.values[k].empty()) continue;
    for (size_t i = 0; i < model.colors.size(); ++i) {
      // Colours of other programs may be 0..1 as floats; a byte of 1 is as good as black.
      const float value = color.values[k][i];
      model.colors[i][k] = static_cast<uint8_t>(std::clamp(value, 0.0f, 255.0f) + 0.5f);
    }
  }
  return model;
}

ViewModel ReadViewModel(const std::string& path) {
  std::error_code error;
  if (!fs::exists(path, error)) {
    throw InputError(path, "", "does not exist", "Give the folder that roomtex-texture wrote");
  }
  std::string file = path;
  if (fs::is_directory(path, error)) {
    file = (fs::path(path) / "model.glb").string();
    if (!fs::exists(file, error)) file = (fs::path(path) / "model.ply").string();
    if (!fs::exists(file, error)) {
      throw InputError(path, "", "holds neither model.glb nor model.ply",
                       "Give the folder that roomtex-texture wrote");
    }
  }
  std::string extension = fs::path(file).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  RequireFile(file, "Give what roomtex-texture wrote");
  if (extension == ".glb" || extension == ".ply") {
    ViewModel model = extension == ".glb" ? ReadViewGlb(file) : ReadViewPly(file);
    model.normals = SmoothNormals(model);
    return model;
  }
  throw InputError(path, "", "is neither a folder nor a .glb or .ply file",
                   "Give the folder that roomtex-texture wrote");
}

}  // namespace roomtex
