#include "dense/stereo_views.h"

#include <algorithm>
#include <cmath>

#include "core/frames.h"

namespace roomtex {
namespace {

constexpr int kProbeColumns = 32, kProbeRows = 24;
constexpr double kSameSight = 0.1;  // share
constexpr double kTooNear_deg = kSamePlace_deg, kGood_deg = 8, kStillGood_deg = 25,
                 kTooFar_deg = 50;

double WeightOfAngle(double angle) {
  const double deg = DegFromRad(angle);
  if (deg < kTooNear_deg || deg > kTooFar_deg) return 0;
  if (deg < kGood_deg) return (deg - kTooNear_deg) / (kGood_deg - kTooNear_deg);
  return deg < kStillGood_deg ? 1 : (kTooFar_deg - deg) / (kTooFar_deg - kStillGood_deg);
}

// Whether the two were taken from one place, as most of these places see it.
bool IsSamePlace(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                 const std::vector<Eigen::Vector3d>& places) {
  const double same = RadFromDeg(kSamePlace_deg);
  const auto num_same = std::count_if(
      places.begin(), places.end(),
      [&](const Eigen::Vector3d& place) { return AngleBetween(a - place, b - place) < same; });
  return 2 * static_cast<size_t>(num_same) > places.size();
}

}  // namespace

void FindNeighbours(const ScanSpace& space, int max_neighbours, std::vector<StereoView>* views) {
  // Depths on a coarse raster, and the places there.
  std::vector<cv::Mat1f> depths;
  std::vector<std::vector<Eigen::Vector3d>> places(views->size());
  for (size_t i = 0; i < views->size(); ++i) {
    const StereoView& view = (*views)[i];
    Camera coarse = view.camera;
    coarse.Resize(kProbeColumns, kProbeRows);
    depths.push_back(DepthOfSurface(space.surface(), coarse, view.cam_from_scan, 1));
    const CameraProjection projection(coarse);
    const Rigid scan_from_cam = view.cam_from_scan.Inverse();
    for (int y = 0; y < kProbeRows; ++y) {
      for (int x = 0; x < kProbeColumns; ++x) {
        const float depth = depths[i](y, x);
        if (!(depth > 0)) continue;
        places[i].push_back(scan_from_cam * (*projection.RayFromImg({x + 0.5, y + 0.5}) * depth));
      }
    }
  }
  for (size_t i = 0; i < views->size(); ++i) {
    std::vector<std::pair<double, int>> scores;
    for (size_t j = 0; j < views->size(); ++j) {
      if (i == j) continue;
      const StereoView& other = (*views)[j];
      const CameraProjection projection(other.camera);
      double score = 0;
      for (const Eigen::Vector3d& place : places[i]) {
        const Eigen::Vector3d in_cam = other.cam_from_scan * place;
        const auto at = projection.ImgFromCam(in_cam);
        if (!at || !projection.InImage(*at)) continue;
        const int column = std::min(static_cast<int>(at->x() * kProbeColumns / other.camera.width),
                                    kProbeColumns - 1);
        const int row =
            std::min(static_cast<int>(at->y() * kProbeRows / other.camera.height), kProbeRows - 1);
        const double depth = depths[j](row, column);
        if (!(std::abs(depth - in_cam.z()) < kSameSight * in_cam.z())) continue;
        score += WeightOfAngle(AngleBetween((*views)[i].Centre() - place, other.Centre() - place));
      }
      if (score > 0) scores.emplace_back(-score, static_cast<int>(j));
    }
    std::sort(scores.begin(), scores.end());
    std::vector<int>& neighbours = (*views)[i].neighbours;
    for (const auto& [score, j] : scores) {
      if (static_cast<int>(neighbours.size()) == max_neighbours) break;
      const Eigen::Vector3d centre = (*views)[j].Centre();
      const bool is_copy = std::any_of(neighbours.begin(), neighbours.end(), [&](int better) {
        return IsSamePlace((*views)[better].Centre(), centre, places[i]);
      });
      if (!is_copy) neighbours.push_back(j);
    }
  }
}

}  // namespace roomtex
