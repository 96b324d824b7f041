#include "texture/sampling/photo_view.h"

#include <algorithm>
#include <cmath>

#include "core/camera_formulas.h"
#include "core/frames.h"

namespace roomtex {
namespace {

struct FloatPose {
  Eigen::Matrix3f rotation;
  Eigen::Vector3f translation;
};

// One loop per camera model: with the model known when compiling, the formula's switch disappears.
template <CameraModel kModel>
void ProjectAll(const FloatPose& pose, const float* params, float max_radius2,
                const PointBlock& block, ProjectedBlock* projected) {
  const Eigen::Matrix3f& r = pose.rotation;
  const Eigen::Vector3f& t = pose.translation;
  const int n = block.size();
  for (int i = 0; i < n; ++i) {
    const float px = block.x[i], py = block.y[i], pz = block.z[i];
    const float z = r(2, 0) * px + r(2, 1) * py + r(2, 2) * pz + t[2];
    const float inverse = z > 1e-6f ? 1.0f / z : 0.0f;
    const float x = (r(0, 0) * px + r(0, 1) * py + r(0, 2) * pz + t[0]) * inverse;
    const float y = (r(1, 0) * px + r(1, 1) * py + r(1, 2) * pz + t[1]) * inverse;
    float img_x, img_y;
    camera_formulas::Project(kModel, params, x, y, &img_x, &img_y);
    projected->x[i] = img_x;
    projected->y[i] = img_y;
    projected->depth[i] = inverse > 0 && x * x + y * y <= max_radius2 ? z : 0.0f;
  }
}

// The same for cameras that see rays of any direction.
template <CameraModel kModel>
void ProjectAllAround(const FloatPose& pose, const float* params, float min_cosine,
                      const PointBlock& block, ProjectedBlock* projected) {
  const Eigen::Matrix3f& r = pose.rotation;
  const Eigen::Vector3f& t = pose.translation;
  const int n = block.size();
  for (int i = 0; i < n; ++i) {
    const float px = block.x[i], py = block.y[i], pz = block.z[i];
    const float x = r(0, 0) * px + r(0, 1) * py + r(0, 2) * pz + t[0];
    const float y = r(1, 0) * px + r(1, 1) * py + r(1, 2) * pz + t[1];
    const float z = r(2, 0) * px + r(2, 1) * py + r(2, 2) * pz + t[2];
    const float distance = std::sqrt(x * x + y * y + z * z);
    float img_x, img_y;
    camera_formulas::Project(kModel, params, x, y, z, &img_x, &img_y);
    projected->x[i] = img_x;
    projected->y[i] = img_y;
    projected->depth[i] = distance > 1e-6f && z >= min_cosine * distance ? distance : 0.0f;
  }
}

}  // namespace

void PointBlock::Add(const Eigen::Vector3d& point) {
  const Eigen::Vector3f local = (point - origin).cast<float>();
  x.push_back(local.x());
  y.push_back(local.y());
  z.push_back(local.z());
  radius = std::max(radius, local.norm() * 1.00001f);
}

void ProjectedBlock::Resize(int n) {
  x.resize(n);
  y.resize(n);
  depth.resize(n);
}

PhotoProjector::PhotoProjector(const PhotoView& view)
    : camera_(view.camera),
      cam_from_scan_(view.cam_from_scan),
      rotation_(view.cam_from_scan.rotation.toRotationMatrix().cast<float>()),
      centre_(view.Centre()),
      params_(view.camera.params.begin(), view.camera.params.end()) {
  FindFrustum();
}

void PhotoProjector::Project(const PointBlock& block, ProjectedBlock* projected) const {
  projected->Resize(block.size());
  const FloatPose pose{rotation_, (cam_from_scan_ * block.origin).cast<float>()};
  const double radius = std::min(camera_.max_radius(), 1e15);
  const float max_radius2 = static_cast<float>(radius * radius);
  const double angle = camera_.max_angle();
  const float min_cosine = angle < kPi ? static_cast<float>(std::cos(angle)) : -2.0f;
  const float* p = params_.data();
  switch (camera_.camera().model) {
#define ROOMTEX_CASE(model) \
  case CameraModel::model:  \
    return ProjectAll<CameraModel::model>(pose, p, max_radius2, block, projected)
    ROOMTEX_CASE(kSimplePinhole);
    ROOMTEX_CASE(kPinhole);
    ROOMTEX_CASE(kSimpleRadial);
    ROOMTEX_CASE(kRadial);
    ROOMTEX_CASE(kOpenCv);
    ROOMTEX_CASE(kFullOpenCv);
    ROOMTEX_CASE(kFov);
#undef ROOMTEX_CASE
#define ROOMTEX_CASE(model) \
  case CameraModel::model:  \
    return ProjectAllAround<CameraModel::model>(pose, p, min_cosine, block, projected)
    ROOMTEX_CASE(kOpenCvFisheye);
    ROOMTEX_CASE(kSimpleRadialFisheye);
    ROOMTEX_CASE(kRadialFisheye);
    ROOMTEX_CASE(kThinPrismFisheye);
    ROOMTEX_CASE(kRadTanThinPrismFisheye);
    ROOMTEX_CASE(kSimpleDivision);
    ROOMTEX_CASE(kDivision);
    ROOMTEX_CASE(kSimpleFisheye);
    ROOMTEX_CASE(kFisheye);
    ROOMTEX_CASE(kEucm);
    ROOMTEX_CASE(kEquirectangular);
#undef ROOMTEX_CASE
  }
}

// A box in (x/z, y/z) around the rays of the image's border. Where the lens reaches a position by
// no ray, the limit of its distortion takes the border's place; where that lies behind the camera,
// there is no frustum.
void PhotoProjector::FindFrustum() {
  const double width = camera_.camera().width, height = camera_.camera().height;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d high = -low;
  constexpr int kSteps = 32;
  bool whole = true;
  for (int i = 0; i <= kSteps; ++i) {
    const double s = static_cast<double>(i) / kSteps;
    for (const Eigen::Vector2d& position :
         {Eigen::Vector2d(s * width, 0), Eigen::Vector2d(s * width, height),
          Eigen::Vector2d(0, s * height), Eigen::Vector2d(width, s * height)}) {
      const auto ray = camera_.CamFromImg(position);
      if (!ray) {
        whole = false;
        continue;
      }
      low = low.cwiseMin(*ray);
      high = high.cwiseMax(*ray);
    }
  }
  constexpr double kWidestBox = 30;  // x/z; beyond, a box bounds nothing
  const bool narrow = whole && std::max(-low.minCoeff(), high.maxCoeff()) < kWidestBox;
  if (!camera_.camera().IsPerspective() && !narrow) return;
  if (!whole) {
    const double limit = std::min(camera_.max_radius(), 1e6);
    low.setConstant(-limit);
    high.setConstant(limit);
  }
  const Eigen::Vector2d margin = 0.01 * (high - low);
  low -= margin;
  high += margin;
  frustum_ = {Eigen::Vector3d(1, 0, -low.x()).normalized(),
              Eigen::Vector3d(-1, 0, high.x()).normalized(),
              Eigen::Vector3d(0, 1, -low.y()).normalized(),
              Eigen::Vector3d(0, -1, high.y()).normalized(), Eigen::Vector3d::UnitZ()};
}

bool PhotoProjector::MaySeeInCam(const Eigen::Vector3d& centre_in_cam, double radius) const {
  return std::all_of(frustum_.begin(), frustum_.end(), [&](const Eigen::Vector3d& inward) {
    return inward.dot(centre_in_cam) >= -radius;
  });
}

}  // namespace roomtex
