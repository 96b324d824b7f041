#include "texture/render/mesh_renderer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/error.h"
#include "core/parallel.h"
#include "core/statistics.h"
#include "importers/ply.h"

namespace roomtex {
namespace {

// Linear between the four texels around.
cv::Vec3f TexelAt(const cv::Mat& texture, const Eigen::Vector2d& uv) {
  const double x = std::clamp(uv.x() * texture.cols - 0.5, 0.0, texture.cols - 1.0);
  const double y = std::clamp(uv.y() * texture.rows - 0.5, 0.0, texture.rows - 1.0);
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  const int right = std::min(column + 1, texture.cols - 1),
            below = std::min(row + 1, texture.rows - 1);
  const auto s = static_cast<float>(x - column), t = static_cast<float>(y - row);
  const auto texel = [&](int r, int c) { return cv::Vec3f(texture.at<cv::Vec3b>(r, c)); };
  return (1 - t) * ((1 - s) * texel(row, column) + s * texel(row, right)) +
         t * ((1 - s) * texel(below, column) + s * texel(below, right));
}

cv::Vec3f ColorAt(const ColoredMesh& mesh, const RayHit& hit) {
  const Triangle& t = mesh.triangles[hit.triangle];
  const Eigen::Vector3d &a = mesh.points[t[0]], &b = mesh.points[t[1]], &c = mesh.points[t[2]];
  const Eigen::Vector3d normal = (b - a).cross(c - a);
  const double area = normal.squaredNorm();
  double share[3] = {1, 0, 0};
  if (area > 0) {
    share[0] = normal.dot((c - b).cross(hit.point - b)) / area;
    share[1] = normal.dot((a - c).cross(hit.point - c)) / area;
    share[2] = 1 - share[0] - share[1];
  }
  const int texture =
      mesh.texture_of_triangle.empty() ? -1 : mesh.texture_of_triangle[hit.triangle];
  if (texture >= 0) {
    Eigen::Vector2d uv = Eigen::Vector2d::Zero();
    for (int i = 0; i < 3; ++i) uv += share[i] * mesh.uv[t[i]].cast<double>();
    return TexelAt(mesh.textures[texture], uv);
  }
  cv::Vec3f bgr;
  for (int k = 0; k < 3; ++k) {
    double value = 0;
    for (int i = 0; i < 3; ++i) value += share[i] * mesh.colors[t[i]][2 - k];
    bgr[k] = static_cast<float>(std::clamp(value, 0.0, 255.0));
  }
  return bgr;
}

}  // namespace

ColoredMesh ReadColoredMesh(const std::string& path) {
  PlyOptions options;
  options.colors = true;
  Scan scan = ReadPly(path, options);
  if (scan.colors.empty()) {
    throw InputError(path, "", "has no colours", "Give a model.ply of roomtex-texture");
  }
  ColoredMesh mesh;
  mesh.points = std::move(scan.points);
  mesh.triangles = std::move(scan.triangles);
  if (!scan.up_is_assumed) mesh.up = scan.up;
  for (const auto& [red, green, blue] : scan.colors) mesh.colors.emplace_back(red, green, blue);
  return mesh;
}

RoomBox FindRoomBox(const ColoredMesh& mesh) {
  RoomBox box;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Eigen::Vector3d& point : mesh.points) {
      if (point.allFinite()) values.push_back(point[axis]);
    }
    if (values.empty()) values.push_back(0);
    box.low[axis] = Quantile(&values, 0.01);
    box.high[axis] = Quantile(&values, 0.99);
  }
  return box;
}

ColoredMesh CutBeyond(const ColoredMesh& mesh, const Eigen::Vector3d& axis, double limit) {
  ColoredMesh cut;
  cut.points = mesh.points;
  cut.colors = mesh.colors;
  cut.uv = mesh.uv;
  cut.textures = mesh.textures;
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    const bool beyond = std::any_of(
        t.begin(), t.end(), [&](int corner) { return axis.dot(mesh.points[corner]) > limit; });
    if (beyond) continue;
    cut.triangles.push_back(t);
    if (!mesh.texture_of_triangle.empty()) {
      cut.texture_of_triangle.push_back(mesh.texture_of_triangle[i]);
    }
  }
  return cut;
}

MeshRenderer::MeshRenderer(const ColoredMesh& mesh)
    : mesh_(mesh), caster_(mesh.points, mesh.triangles) {}

cv::Vec3f MeshRenderer::ColorAlong(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                   const RenderSettings& settings) const {
  constexpr int kMostSurfaces = 12;
  constexpr double kStep = 1e-4;
  double from = 0.01;
  for (int i = 0; i < kMostSurfaces; ++i) {
    const auto hit = caster_.Cast(origin, direction, from);
    if (!hit) break;
    const Triangle& t = mesh_.triangles[hit->triangle];
    const Eigen::Vector3d normal =
        (mesh_.points[t[1]] - mesh_.points[t[0]]).cross(mesh_.points[t[2]] - mesh_.points[t[0]]);
    if (!settings.front_only || normal.dot(direction) < 0) return ColorAt(mesh_, *hit);
    from = hit->distance + kStep;
  }
  return settings.empty;
}

cv::Mat MeshRenderer::Render(const Camera& camera, const Rigid& cam_from_scan,
                             const RenderSettings& settings) const {
  const CameraProjection projection(camera);
  const int width = settings.width > 0 ? settings.width : camera.width;
  const double scale = static_cast<double>(width) / camera.width;
  cv::Mat3b picture(static_cast<int>(std::lround(camera.height * scale)), width);
  const Rigid scan_from_cam = cam_from_scan.Inverse();
  const int side = settings.rays_per_side;
  ParallelFor(settings.num_threads, 0, picture.rows, [&](int y) {
    for (int x = 0; x < picture.cols; ++x) {
      cv::Vec3f sum(0, 0, 0);
      for (int k = 0; k < side * side; ++k) {
        const double dx = (k % side + 0.5) / side, dy = (k / side + 0.5) / side;
        const auto ray = projection.RayFromImg({(x + dx) / scale, (y + dy) / scale});
        if (!ray) {
          sum += settings.empty;
          continue;
        }
        const Eigen::Vector3d direction = (scan_from_cam.rotation * *ray).normalized();
        sum += ColorAlong(scan_from_cam.translation, direction, settings);
      }
      picture(y, x) = cv::Vec3b(sum / static_cast<float>(side * side));
    }
  });
  return picture;
}

double MeshRenderer::ShareInSight(const Camera& camera, const Rigid& cam_from_scan) const {
  constexpr int kColumns = 24, kRows = 16;
  constexpr double kNearest = 0.5;
  const CameraProjection projection(camera);
  const Rigid scan_from_cam = cam_from_scan.Inverse();
  int count = 0;
  for (int k = 0; k < kColumns * kRows; ++k) {
    const auto ray = projection.RayFromImg({(k % kColumns + 0.5) / kColumns * camera.width,
                                            (k / kColumns + 0.5) / kRows * camera.height});
    if (!ray) continue;
    const Eigen::Vector3d direction = (scan_from_cam.rotation * *ray).normalized();
    const auto hit = caster_.Cast(scan_from_cam.translation, direction, 0.01);
    if (!hit || hit->distance < kNearest) continue;
    const Triangle& t = mesh_.triangles[hit->triangle];
    const Eigen::Vector3d normal =
        (mesh_.points[t[1]] - mesh_.points[t[0]]).cross(mesh_.points[t[2]] - mesh_.points[t[0]]);
    count += normal.dot(direction) < 0;
  }
  return static_cast<double>(count) / (kColumns * kRows);
}

Rigid LookAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target, const Eigen::Vector3d& up) {
  const Eigen::Vector3d forward = (target - eye).normalized();
  const Eigen::Vector3d right = forward.cross(up).normalized();
  Eigen::Matrix3d rotation;
  rotation.row(0) = right;
  rotation.row(1) = forward.cross(right);  // down
  rotation.row(2) = forward;
  Rigid cam_from_scan;
  cam_from_scan.rotation = Eigen::Quaterniond(rotation);
  cam_from_scan.translation = -(cam_from_scan.rotation * eye);
  return cam_from_scan;
}

}  // namespace roomtex
