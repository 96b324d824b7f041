#include "align/search/search_hint.h"

#include <algorithm>
#include <cmath>

#include "core/camera_model.h"
#include "core/frames.h"

namespace roomtex {
namespace {

const double kPickAngle = RadFromDeg(1.5);
const double kAnyWhere = RadFromDeg(80.0);  // a photo that shows all around

// The largest angle from the optical axis at which the photo shows anything: at its border.
double HalfView(const Camera& camera) {
  if (camera.IsPanorama()) return kPi;
  const CameraProjection projection(camera);
  constexpr int kSteps = 8;  // along each side
  double most = 0;
  for (int i = 0; i <= kSteps; ++i) {
    const double x = camera.width * static_cast<double>(i) / kSteps,
                 y = camera.height * static_cast<double>(i) / kSteps;
    const double right = camera.width, bottom = camera.height;
    for (const Eigen::Vector2d& at : {Eigen::Vector2d(x, 0), Eigen::Vector2d(x, bottom),
                                      Eigen::Vector2d(0, y), Eigen::Vector2d(right, y)}) {
      const auto ray = projection.RayFromImg(at);
      if (!ray) return projection.max_angle();  // shows all that the lens does
      most = std::max(most, AngleBetween(*ray, Eigen::Vector3d::UnitZ()));
    }
  }
  return most;
}

}  // namespace

std::vector<HintRay> FindHintRays(const SparseModel& model, const std::vector<Pick>& picks,
                                  const std::vector<NearHint>& near) {
  std::vector<HintRay> rays;
  const auto add = [&rays](const SparseImage& image, const Eigen::Vector3d& ray_in_cam,
                           const Eigen::Vector3d& x_in_scan, double max_angle) {
    const Rigid sparse_from_cam = image.cam_from_model.Inverse();
    rays.push_back({sparse_from_cam.translation, sparse_from_cam.rotation * ray_in_cam.normalized(),
                    x_in_scan, max_angle});
  };
  for (const Pick& pick : picks) {
    if (!(pick.weight > 0)) continue;
    const SparseImage& image = *model.FindImage(pick.image_name);
    const auto ray = CameraProjection(model.cameras.at(image.camera_id)).RayFromImg(pick.x_in_img);
    if (ray) add(image, *ray, pick.x_in_scan, kPickAngle);
  }
  for (const NearHint& hint : near) {
    const SparseImage& image = *model.FindImage(hint.image_name);
    add(image, Eigen::Vector3d::UnitZ(), hint.x_in_scan,
        HalfView(model.cameras.at(image.camera_id)));
  }
  return rays;
}

bool Agrees(const HintRay& ray, const Eigen::Vector3d& centre_in_scan,
            const Eigen::Vector3d& direction_in_scan, double slack) {
  if (ray.max_angle > kAnyWhere) return true;
  const Eigen::Vector3d offset = ray.x_in_scan - centre_in_scan;
  const double along = offset.dot(direction_in_scan);
  const double limit = std::max(along, 0.0) * std::tan(ray.max_angle) + slack;
  return along > -slack && offset.squaredNorm() - along * along <= limit * limit;
}

bool Agrees(const std::vector<HintRay>& rays, const Similarity& scan_from_sparse, double slack) {
  return std::all_of(rays.begin(), rays.end(), [&](const HintRay& ray) {
    return Agrees(ray, scan_from_sparse * ray.centre, scan_from_sparse.rotation * ray.direction,
                  slack);
  });
}

}  // namespace roomtex
