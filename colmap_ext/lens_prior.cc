#include "colmap_ext/lens_prior.h"

#include <algorithm>

#include "core/camera_formulas.h"

namespace roomtex {
namespace {

constexpr double kFocalShare = 0.2, kAspect = 0.002, kPrincipalPointShare = 0.01;
constexpr double kRadial = 0.1, kTangential = 0.003;
constexpr double kHeldShare = 1e-3;  // of these deviations

bool IsTangential(CameraModel model, int param) {
  switch (model) {
    case CameraModel::kOpenCv:
    case CameraModel::kFullOpenCv:
      return param == 6 || param == 7;
    case CameraModel::kThinPrismFisheye:  // and the thin prism's
      return param == 6 || param == 7 || param >= 10;
    case CameraModel::kRadTanThinPrismFisheye:  // and the thin prism's
      return param >= 10;
    default:
      return false;
  }
}

}  // namespace

Eigen::MatrixXd LensPrior(const Camera& told, bool hold_centre) {
  const int n = static_cast<int>(told.params.size());
  const bool one_focal = camera_formulas::HasOneFocalLength(told.model);
  const int num_focal = one_focal ? 1 : 2;
  Eigen::MatrixXd prior = Eigen::MatrixXd::Zero(one_focal ? n : n + 1, n);
  for (int i = 0; i < n; ++i) {
    const double held = hold_centre ? kHeldShare : 1;
    double sigma = IsTangential(told.model, i) ? held * kTangential : kRadial;
    if (i < num_focal) {
      sigma = kFocalShare * told.params[i];
    } else if (i < num_focal + 2) {
      sigma = held * kPrincipalPointShare * std::max(told.width, told.height);
    }
    prior(i, i) = 1 / sigma;
  }
  if (!one_focal) {
    prior(n, 0) = 1 / (kAspect * told.params[0]);
    prior(n, 1) = -1 / (kAspect * told.params[1]);
  }
  return prior;
}

}  // namespace roomtex
