#pragma once
// What the viewer shows: a coloured mesh in the scan frame, read from what roomtex-texture wrote.

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"

namespace roomtex {

// A texture image as it stands in the file.
struct ViewImage {
  std::shared_ptr<const std::string> bytes;  // PNG or JPEG
  std::string type;                          // "image/png" or "image/jpeg"
  int width = 0, height = 0;                 // texels, by the image's header
  // glTF's numbers, which are those of OpenGL, of what is seen beyond its sides, along u and v.
  static constexpr int kClamp = 33071, kRepeat = 10497, kMirror = 33648;
  std::array<int, 2> wrap = {kClamp, kClamp};
};

struct ViewModel {
  std::string path;
  // `scan` frame. Points are floats relative to the origin, so that georeferenced scans keep their
  // millimetres.
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Vector3d up = Eigen::Vector3d::UnitY();  // unit
  std::vector<Eigen::Vector3f> points;
  // One per point: a place in the image (glTF: 0, 0 = upper-left corner), and the colour where
  // there is no image, sRGB. Empty where no triangle needs them.
  std::vector<Eigen::Vector2f> uv;
  // All uv lie between: 0 to 1 of files of ours, whole numbers of images that are repeated.
  Eigen::Vector2f uv_low = Eigen::Vector2f::Zero(), uv_high = Eigen::Vector2f::Ones();
  std::vector<std::array<uint8_t, 3>> colors;
  // One per point: unit, of the surface around it (SmoothNormals); zero where there is none.
  std::vector<Eigen::Vector3f> normals;
  std::vector<Triangle> triangles;
  std::vector<int16_t> page_of_triangle;  // index into images; -1 = colours of the points
  std::vector<ViewImage> images;
  // Triangles from here on are of the supplement (roomtex-dense), as report.json says.
  size_t first_supplement_triangle = std::numeric_limits<size_t>::max();
  // Of a cloud: every triangle is a disc by itself, around one of the cloud's points.
  bool is_cloud = false;

  bool IsSupplement(size_t triangle) const { return triangle >= first_supplement_triangle; }
  Eigen::Vector3d InScan(size_t point) const { return origin + points[point].cast<double>(); }
};

// Front = the side that the scanner saw. A single triangle does not say it: where the scanner
// looked along a wall, range noise turns triangles over. So these are normals weighted by area,
// averaged over the neighbours `passes` times.
std::vector<Eigen::Vector3f> SmoothNormals(const ViewModel& model, int passes = 5);
// A folder that roomtex-texture wrote (model.glb; model.ply if there is no GLB, or the model is a
// cloud) or roomtex-join (site.gltf), a .glb, .gltf or .ply; the report.json beside it says whether
// it has a supplement. Throws InputError: nothing there, damaged, no triangles, things of glTF that
// we do not read.
ViewModel ReadViewModel(const std::string& path);

// glTF 2.0, binary or a .gltf with buffers in files beside it: triangles with one texture image or
// vertex colours each; nodes with their transforms. The scan frame is that below the root node of
// roomtex-texture's files, the site's below that of roomtex-join's, and glTF's own for any other
// file. Numbers are checked against the bytes that are there.
// has_supplement: what is below the root's last node is the supplement.
ViewModel ReadViewGlb(const std::string& path, bool has_supplement = false);
// A triangle mesh or a cloud of points; colours by red, green, blue if it has them, otherwise the
// intensity or light grey. Of a cloud of more than kMostDiscs points every second, third ... is
// shown, larger.
inline constexpr size_t kMostDiscs = 8000000;
ViewModel ReadViewPly(const std::string& path);

// Width and height of a PNG or JPEG by its header; {0, 0} for anything else.
std::array<int, 2> EncodedImageSize(const std::string& bytes);

}  // namespace roomtex
