#include "colmap_ext/calibration_check.h"

#include <algorithm>
#include <map>
#include <vector>

namespace roomtex {
namespace {

constexpr int kPointsPerImage = 60;
// Observations of a thinned point. What a point takes in an adjustment grows with their square, and
// in one room every photo sees the same: without an end to it, twice the photos took four times as
// long (tests/benchmark/scale/lens_cost.cc).
constexpr size_t kMaxTrack = 12;

// fx, fy, cx, cy, k1, k2, p1, p2; empty for models that are rich already.
std::vector<double> OpenCvParams(const Camera& camera) {
  const std::vector<double>& p = camera.params;
  switch (camera.model) {
    case CameraModel::kSimplePinhole:
      return {p[0], p[0], p[1], p[2], 0, 0, 0, 0};
    case CameraModel::kPinhole:
      return {p[0], p[1], p[2], p[3], 0, 0, 0, 0};
    case CameraModel::kSimpleRadial:
      return {p[0], p[0], p[1], p[2], p[3], 0, 0, 0};
    case CameraModel::kRadial:
      return {p[0], p[0], p[1], p[2], p[3], p[4], 0, 0};
    default:
      return {};
  }
}

}  // namespace

Camera RicherCamera(const Camera& camera) {
  Camera rich = camera;
  std::vector<double> params = OpenCvParams(camera);
  if (params.empty()) return rich;
  rich.model = CameraModel::kOpenCv;
  rich.params = std::move(params);
  return rich;
}

SparseModel WithRicherCameras(const SparseModel& model) {
  SparseModel result = model;
  for (auto& [camera_id, camera] : result.cameras) camera = RicherCamera(camera);
  return result;
}

SparseModel ThinnedModel(const SparseModel& model, int per_image) {
  std::vector<uint64_t> order;
  for (const auto& [point_id, point] : model.points) order.push_back(point_id);
  std::stable_sort(order.begin(), order.end(), [&](uint64_t a, uint64_t b) {
    return model.points.at(a).track.size() > model.points.at(b).track.size();
  });
  SparseModel result;
  result.cameras = model.cameras;
  result.images = model.images;
  for (auto& [image_id, image] : result.images) {
    std::fill(image.point3d_ids.begin(), image.point3d_ids.end(), kInvalidPoint3dId);
  }
  std::map<uint32_t, int> count;
  const auto has_fewer = [&](const TrackElement& a, const TrackElement& b) {
    return count[a.image_id] < count[b.image_id];
  };
  for (const uint64_t point_id : order) {
    SparsePoint point = model.points.at(point_id);
    const bool wanted = std::any_of(
        point.track.begin(), point.track.end(),
        [&](const TrackElement& element) { return count[element.image_id] < per_image; });
    if (!wanted) continue;
    if (point.track.size() > kMaxTrack) {
      std::stable_sort(point.track.begin(), point.track.end(), has_fewer);
      point.track.resize(kMaxTrack);
    }
    for (const TrackElement& element : point.track) {
      ++count[element.image_id];
      result.images.at(element.image_id).point3d_ids[element.point2d_index] = point_id;
    }
    result.points[point_id] = std::move(point);
  }
  return result;
}

CalibrationCheck CheckCalibration(const SparseModel& model, const AdjustModel& adjust) {
  const SparseModel start = ThinnedModel(WithRicherCameras(model), kPointsPerImage);
  SparseModel fixed = adjust(start, false), free = adjust(start, true);
  CalibrationCheck check;
  const ReprojectionErrors errors = UpdateReprojectionErrors(&fixed);
  check.rms_fixed_px = errors.rms_px;
  check.redundancy = 2.0 * static_cast<double>(errors.num_observations) -
                     3.0 * static_cast<double>(fixed.points.size()) -
                     6.0 * static_cast<double>(fixed.images.size()) + 7;
  check.rms_free_px = UpdateReprojectionErrors(&free).rms_px;
  return check;
}

}  // namespace roomtex
