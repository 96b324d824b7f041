#include "capture/calibration/calibration_trust.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "capture/calibration/calibration_uncertainty.h"
#include "core/camera_formulas.h"
#include "core/frames.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr int kCellsAlong = 12;       // cells of the coverage along the longer side
constexpr double kNearCorner = 0.15;  // of the diagonal: so near a corner of the picture counts
constexpr double kWantedShare = 0.6;  // of the cells; below it is a warning
constexpr int kWantedCorners = 3;     // of the picture
constexpr double kWantedCornerSigma = 0.5;  // pixels
constexpr int kMaxPlaces = 150;             // where cameras are compared
constexpr double kWantedScatter = 2;
constexpr double kManyDropped = 1.0 / 3;

double Rms(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(std::max<size_t>(values.size(), 1)));
}

// Some corners of the boards, spread over all photos.
Eigen::Matrix2Xd SomeCorners(const std::vector<BoardView>& views) {
  int count = 0;
  for (const BoardView& view : views) count += static_cast<int>(view.x_in_img.cols());
  const int step = std::max(1, count / kMaxPlaces);
  Eigen::Matrix2Xd places(2, (count + step - 1) / step);
  int i = 0, num_places = 0;
  for (const BoardView& view : views) {
    for (int k = 0; k < view.x_in_img.cols(); ++k, ++i) {
      if (i % step == 0) places.col(num_places++) = view.x_in_img.col(k);
    }
  }
  return places;
}

Eigen::Vector3d Normal(const CalibratedPhoto& photo) {
  return photo.cam_from_board.rotation * Eigen::Vector3d::UnitZ();
}

double LargestAngleDeg(const std::vector<CalibratedPhoto>& photos) {
  double largest = 0;
  for (const CalibratedPhoto& a : photos) {
    for (const CalibratedPhoto& b : photos) {
      if (!a.used || !b.used) continue;
      const double cosine = std::min(1.0, std::abs(Normal(a).dot(Normal(b))));
      largest = std::max(largest, DegFromRad(std::acos(cosine)));
    }
  }
  return largest;
}

void WarnOfCoverage(const CalibrationOptions& options, Calibration* result) {
  const Coverage& coverage = result->coverage;
  const int reached = static_cast<int>(
      std::count(coverage.corner_reached.begin(), coverage.corner_reached.end(), true));
  if (coverage.radius < options.min_radius) {
    result->reasons.push_back(
        "the boards lie in the middle of the picture only (they reach " +
        Number(100 * coverage.radius, 0) +
        " % of the way to its corners): what the lens does outside is not known; photograph the "
        "board near all borders and corners too");
  } else if (reached < kWantedCorners || coverage.share < kWantedShare) {
    result->warnings.push_back("boards cover " + Number(100 * coverage.share, 0) +
                               " % of the picture and reach " + std::to_string(reached) +
                               " of its corners: add photos with the board near the others");
  }
}

void JudgeUncertainty(const CalibrationOptions& options, Calibration* result) {
  if (!(result->focal_sigma_percent <= options.max_focal_sigma_percent)) {
    result->reasons.push_back("the focal length is not determined: its standard deviation is " +
                              (std::isfinite(result->focal_sigma_percent)
                                   ? Number(result->focal_sigma_percent, 2) + " %"
                                   : std::string("unlimited")));
  }
  if (!(result->mean_sigma_px <= options.max_sigma_px)) {
    result->reasons.push_back("the camera is uncertain by " +
                              (std::isfinite(result->mean_sigma_px)
                                   ? Number(result->mean_sigma_px, 2) + " px"
                                   : std::string("more than can be told")) +
                              " over the picture");
  } else if (result->corner_sigma_px > kWantedCornerSigma) {
    result->warnings.push_back("at the corners of the picture the camera is uncertain by " +
                               Number(result->corner_sigma_px, 2) +
                               " px (one standard deviation): more photos there would help");
  }
  const CameraProjection projection(result->camera);
  const Eigen::Matrix2Xd corners = PictureCorners(result->camera.width, result->camera.height);
  for (int i = 0; i < corners.cols(); ++i) {
    if (projection.CamFromImg(corners.col(i))) continue;
    result->reasons.push_back(
        "the distortion found folds the picture over before its corners: no board determines it "
        "there; photograph the board near the corners, or give a simpler --camera_model");
    return;
  }
}

void JudgeScatter(const CalibrationOptions& options, Calibration* result) {
  if (!(result->photo_scatter > std::min(kWantedScatter, options.max_photo_scatter))) return;
  const std::string finding = "photos disagree " + Number(result->photo_scatter, 1) +
                              " times as much as the noise of their corners lets expect (a touched "
                              "focus or zoom, motion, a board that moved in itself?)";
  if (result->photo_scatter > options.max_photo_scatter) {
    result->reasons.push_back(finding +
                              ": no one camera describes them; tape focus and zoom, and "
                              "take the photos again");
  } else {
    result->warnings.push_back(finding + "; the standard deviations are enlarged by that");
  }
}

void WarnOfBow(Calibration* result) {
  const BoardBow& bow = result->bow;
  if (!bow.used) return;
  result->warnings.push_back(
      "the board is not flat: over its corners it is bowed by " + Number(1000 * bow.height, 2) +
      " mm (give or take " + Number(1000 * bow.sigma, 2) +
      ", if --square is right); that is taken into account, a flat board would have made the focal "
      "length " +
      Number(std::abs(bow.focal_percent), 1) + " % too " +
      (bow.focal_percent > 0 ? "long" : "short") + "; glue it to glass or a stiff plate");
}

}  // namespace

double PhotoScatter(const CameraFit& fit, const std::vector<BoardView>& views) {
  const Eigen::Matrix2Xd places = SomeCorners(views);
  const std::vector<double> sigmas = MappingSigma(fit.camera, fit.covariance, places);
  const double n = static_cast<double>(fit.without_view.size());
  std::vector<Eigen::Matrix2Xd> moves;
  Eigen::Matrix2Xd mean = Eigen::Matrix2Xd::Zero(2, places.cols());
  for (const Camera& camera : fit.without_view) {
    moves.push_back(MappingDifference(fit.camera, camera, places, places));
    mean += moves.back() / n;
  }
  double by_photos = 0, by_noise = 0;
  for (int i = 0; i < places.cols(); ++i) {
    double sum = 0;
    for (const Eigen::Matrix2Xd& move : moves) sum += (move.col(i) - mean.col(i)).squaredNorm();
    // Efron's jackknife estimate of the variance.
    const double variance = (n - 1) / n * sum;
    if (!std::isfinite(variance) || !std::isfinite(sigmas[i])) continue;
    by_photos += variance;
    by_noise += sigmas[i] * sigmas[i];
  }
  return by_noise > 0 ? std::sqrt(by_photos / by_noise) : 1;
}

void DescribeUncertainty(const CameraFit& fit, const std::vector<BoardView>& views,
                         Calibration* result) {
  double sum = 0, held_out = 0;
  int count = 0;
  for (size_t i = 0; i < views.size(); ++i) {
    const int n = static_cast<int>(std::count(views[i].used.begin(), views[i].used.end(), true));
    sum += n * fit.view_rms_px[i] * fit.view_rms_px[i];
    held_out += n * fit.held_out_rms_px[i] * fit.held_out_rms_px[i];
    count += n;
  }
  result->rms_px = std::sqrt(sum / std::max(count, 1));
  result->held_out_rms_px = std::sqrt(held_out / std::max(count, 1));

  const Eigen::Matrix2Xd corners = PictureCorners(fit.camera.width, fit.camera.height);
  const Eigen::Matrix2Xd grid = PictureGrid(fit.camera.width, fit.camera.height);
  std::vector<double> at_corners = MappingSigma(fit.camera, fit.covariance, corners);
  result->photo_scatter = PhotoScatter(fit, views);
  const double factor = result->photo_scatter > 1 ? result->photo_scatter : 1;
  result->params_sigma.clear();
  for (int i = 0; i < fit.covariance.rows(); ++i) {
    result->params_sigma.push_back(factor * std::sqrt(fit.covariance(i, i)));
  }
  result->corner_sigma_px = factor * *std::max_element(at_corners.begin(), at_corners.end());
  result->mean_sigma_px = factor * Rms(MappingSigma(fit.camera, fit.covariance, grid));
  const int num_focal = camera_formulas::HasOneFocalLength(fit.camera.model) ? 1 : 2;
  for (int i = 0; i < num_focal; ++i) {
    result->focal_sigma_percent =
        std::max(result->focal_sigma_percent, 100 * result->params_sigma[i] / fit.camera.params[i]);
  }
  result->max_angle_between_boards_deg = LargestAngleDeg(result->photos);
}

void DescribeCoverage(Calibration* result) {
  Coverage& coverage = result->coverage;
  const double width = result->camera.width, height = result->camera.height;
  const double cell = std::max(width, height) / kCellsAlong;
  coverage.columns = std::max(1, static_cast<int>(std::lround(width / cell)));
  coverage.rows = std::max(1, static_cast<int>(std::lround(height / cell)));
  coverage.num_corners.assign(coverage.columns * coverage.rows, 0);
  const Eigen::Matrix2Xd corners = PictureCorners(result->camera.width, result->camera.height);
  const double diagonal = std::hypot(width, height);
  for (const CalibratedPhoto& photo : result->photos) {
    if (!photo.used) continue;
    for (int i = 0; i < photo.x_in_img.cols(); ++i) {
      if (!photo.corner_used[i]) continue;
      const Eigen::Vector2d x = photo.x_in_img.col(i);
      const int column =
          std::clamp(static_cast<int>(x.x() / width * coverage.columns), 0, coverage.columns - 1);
      const int row =
          std::clamp(static_cast<int>(x.y() / height * coverage.rows), 0, coverage.rows - 1);
      ++coverage.num_corners[row * coverage.columns + column];
      coverage.radius = std::max(coverage.radius,
                                 (x - Eigen::Vector2d(width, height) / 2).norm() / (diagonal / 2));
      for (int k = 0; k < 4; ++k) {
        if ((x - corners.col(k)).norm() < kNearCorner * diagonal) coverage.corner_reached[k] = true;
      }
    }
  }
  const auto empty = std::count(coverage.num_corners.begin(), coverage.num_corners.end(), 0);
  coverage.share =
      1 - static_cast<double>(empty) / static_cast<double>(coverage.num_corners.size());
}

void JudgeCalibration(const CalibrationOptions& options, Calibration* result) {
  int num_fitted = 0;  // those with too few corners contradict nobody
  for (const CalibratedPhoto& photo : result->photos) {
    if (std::isfinite(photo.rms_px)) ++num_fitted;
    if (!photo.used) result->warnings.push_back(photo.name + " is left out: " + photo.reason);
  }
  const int num_used = result->NumUsed();
  if (num_used < options.min_photos) {
    result->reasons.push_back(
        "only " + std::to_string(num_used) + " photos of the board took part, at least " +
        std::to_string(options.min_photos) + " are wanted (ten to twenty are good)");
  }
  if (num_fitted - num_used > kManyDropped * num_fitted) {
    result->reasons.push_back(
        std::to_string(num_fitted - num_used) + " of " + std::to_string(num_fitted) +
        " photos with boards contradict the others: check that focus and zoom "
        "were not touched and the board is flat");
  }
  const double angle = result->max_angle_between_boards_deg;
  if (angle < options.min_tilt_deg) {
    result->reasons.push_back(
        "all boards are held alike (within " + Number(angle, 0) +
        " degrees): focal length and distance cannot be told apart; tilt the board by 20 to 45 "
        "degrees, in different directions");
  }
  WarnOfCoverage(options, result);
  JudgeUncertainty(options, result);
  JudgeScatter(options, result);
  WarnOfBow(result);
}

}  // namespace roomtex
