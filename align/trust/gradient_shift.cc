#include "align/trust/gradient_shift.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include "core/frames.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// Median of a photo's gradients over their 95th percentile above which its brightness changes
// nearly everywhere. Ordinary photos of simulated and real rooms have 0.09 to 0.13, under a
// projected pattern 0.17 to 0.43, the finer the more.
constexpr double kBusy = 0.2;
// Above this a photo tells nothing of which room it is. Beside depth cameras' scans of large rooms
// photos are looked at small, and have 0.14 to 0.29 (random captures 120, 220).
constexpr double kPatterned = 0.25;
// Grey levels per cell; with a 95th percentile below this a photo is blank. Ordinary: 11 to 22.
constexpr double kBlank = 1;
// In a bare room photos have 0.7 to 2.8. What a scan shows there are edges and its own noise, which
// say little of which room it is.
constexpr double kBare = 5;

// Smallest eigenvalue of a corner's gradients, (grey levels per cell)^2: one grey level over a
// patch is no structure, even when the scan has no noise at all.
constexpr double kLeastCorner = 1e-3;

// For a contradiction, and for support, which says itself how clear it is (kClearly).
constexpr long kMinPatches = 100, kMinSupporting = 40;
constexpr double kClearly = 4;  // standard deviations; neighbouring patches are not independent
constexpr double kChanceLike = 2;
// Of the patches of a right alignment, at least this share fits: 0.77 to 0.92 in simulated rooms,
// 0.25 with photos blurred by 8 pixels, 0.09 in a real kitchen with poses that drift by
// centimetres.
constexpr double kLeastShareWhenRight = 0.06;
// Patches of a photo that are shifted alike, at least, and how many times as many as by chance: in
// a real kitchen 6 to 46 of 100 (three of four photos 12 and more), by chance 4 to 7.
constexpr size_t kLeastAlike = 8;
constexpr double kAlikeOverChance = 2;

struct Patch {
  Eigen::Vector2i cell;      // its middle, in the view
  Eigen::Vector3d x_in_cam;  // what is seen there, metres
};

cv::Mat1f GradientMagnitude(const cv::Mat1f& grey) {
  cv::Mat1f smooth, across, down, magnitude;
  cv::GaussianBlur(grey, smooth, cv::Size(), 1.0);
  cv::Scharr(smooth, across, CV_32F, 1, 0, 1.0 / 32);
  cv::Scharr(smooth, down, CV_32F, 0, 1, 1.0 / 32);
  cv::magnitude(across, down, magnitude);
  return magnitude;
}

struct Contrast {
  double high = 0;                                            // 95th percentile
  double busyness = std::numeric_limits<double>::infinity();  // median over that

  // Where the photo shows something.
  Contrast(const cv::Mat1f& gradient, const cv::Mat1b& unseen) {
    std::vector<float> values;
    for (int y = 0; y < gradient.rows; ++y) {
      for (int x = 0; x < gradient.cols; ++x) {
        if (unseen.empty() || !unseen(y, x)) values.push_back(gradient(y, x));
      }
    }
    if (values.empty()) return;
    high = Quantile(&values, 0.95);
    if (high > 0) busyness = Quantile(&values, 0.5) / high;
  }
};

// How far the peak lies beside the middle one of three equally spaced values, -0.5 to 0.5
// (parabola).
double PeakOffset(double before, double at, double behind) {
  const double curvature = before - 2 * at + behind;
  return curvature < 0 ? std::clamp(0.5 * (before - behind) / curvature, -0.5, 0.5) : 0;
}

struct Shift {
  Eigen::Vector2d cells;
  FittingCorner corner;  // where the photo shows the patch
};

// Those within the tolerance of the one that has most of them around it: the mode.
std::vector<FittingCorner> ShiftedAlike(const std::vector<Shift>& shifts, double tolerance) {
  std::vector<FittingCorner> most;
  for (const Shift& middle : shifts) {
    std::vector<FittingCorner> alike;
    for (const Shift& one : shifts) {
      if ((one.cells - middle.cells).norm() <= tolerance) alike.push_back(one.corner);
    }
    if (alike.size() > most.size()) most = std::move(alike);
  }
  return most;
}

// The photo in cells of the view.
cv::Mat1f PhotoInCells(const cv::Mat& photo, const ScanView& view) {
  const int cell_px = view.cell_px;
  cv::Mat grey, cells;
  cv::cvtColor(photo(cv::Rect(0, 0, view.grey.cols * cell_px, view.grey.rows * cell_px)), grey,
               cv::COLOR_BGR2GRAY);
  if (cell_px > 1) cv::resize(grey, grey, view.grey.size(), 0, 0, cv::INTER_AREA);
  grey.convertTo(cells, CV_32F);
  return cells;
}

class PhotoMatcher {
 public:
  PhotoMatcher(const ScanView& view, const cv::Mat& photo, const CameraProjection& projection,
               double sample_angle, const GradientShiftOptions& options)
      : view_(view),
        projection_(projection),
        options_(options),
        photo_gradient_(GradientMagnitude(PhotoInCells(photo, view))) {
    angle_per_cell_ = view.cell_px / projection.camera().MeanFocalLength();
    tolerance_ =
        std::max(RadFromDeg(options.min_tolerance_deg), options.tolerance_samples * sample_angle) /
        angle_per_cell_;
    reach_ = static_cast<int>(std::ceil(options.search_reach * tolerance_));
    // The scan's holes must not make gradients: only what lies well inside counts.
    cv::Mat1f filled = view.grey.clone();
    filled.setTo(cv::mean(view.grey, view.valid)[0], view.valid == 0);
    scan_gradient_ = GradientMagnitude(filled);
    cv::erode(view.valid, inside_, cv::Mat::ones(7, 7, CV_8U), cv::Point(-1, -1), 1,
              cv::BORDER_CONSTANT, 0);
    FindPatches(filled);
  }

  GradientShifts Measure() const {
    GradientShifts result;
    result.tolerance_deg = DegFromRad(tolerance_ * angle_per_cell_);
    result.turned.resize(options_.turns_deg.size());
    result.moved.resize(options_.moves.size());
    const Contrast contrast(photo_gradient_, view_.unseen);
    const bool clear = contrast.high >= kBlank && contrast.busyness <= kBusy;
    std::vector<Shift> shifts, by_chance;
    for (size_t i = 0; i < patches_.size(); ++i) {
      const cv::Mat1f pattern = PatternOf(patches_[i]);
      const Eigen::Vector2d at = patches_[i].cell.cast<double>();
      const auto found = BestPlace(pattern, at);
      if (!found) continue;
      const double shift = (*found - at).norm();
      result.shifts_px.push_back(shift * view_.cell_px);
      result.shifts_deg.push_back(DegFromRad(shift * angle_per_cell_));
      result.at_pose.Add(shift <= tolerance_);
      result.ring.Add(shift > tolerance_ && shift <= 2 * tolerance_);
      const Eigen::Vector2d x_in_img = view_.cell_px * (*found + Eigen::Vector2d(0.5, 0.5));
      shifts.push_back({*found - at, {0, x_in_img, patches_[i].x_in_cam}});
      if (clear) {
        result.clear.Add(shift <= tolerance_);
        if (shift <= tolerance_) {
          result.corners.push_back(shifts.back().corner);
        } else {
          result.corners_amiss.push_back(view_.cell_px * (at + Eigen::Vector2d(0.5, 0.5)));
        }
      }
      CompareAtOtherPoses(i, pattern, &result);
      const auto other = OtherPlace(i);
      const auto chance = other ? BestPlace(pattern, *other) : std::nullopt;
      if (!chance) continue;
      result.elsewhere.Add((*chance - *other).norm() <= tolerance_);
      by_chance.push_back({*chance - *other, {}});
    }
    const std::vector<FittingCorner> alike = ShiftedAlike(shifts, tolerance_);
    const double num_by_chance =
        static_cast<double>(ShiftedAlike(by_chance, tolerance_).size() * shifts.size()) /
        std::max<size_t>(1, by_chance.size());
    if (contrast.high >= kBare && contrast.busyness <= kPatterned) {
      result.alike_of_plain.patches = {static_cast<long>(shifts.size()),
                                       static_cast<long>(alike.size())};
      result.alike_of_plain.num_by_chance = num_by_chance;
    }
    if (clear) result.alike_of_clear = result.alike_of_plain;
    if (alike.size() >= std::max<double>(kLeastAlike, kAlikeOverChance * num_by_chance)) {
      result.shifted_alike = alike;
    }
    result.num_photos = result.at_pose.num > 0;
    result.num_unclear_photos = result.at_pose.num > 0 && !clear;
    return result;
  }

 private:
  // A small turn or move displaces a patch and leaves its looks nearly as they are: what would be
  // rendered there is the same pattern. Each patch takes one direction; they take turns.
  void CompareAtOtherPoses(size_t i, const cv::Mat1f& pattern, GradientShifts* result) const {
    const Patch& patch = patches_[i];
    const auto compare = [&](const Eigen::Vector3d& x_in_cam, Tally* tally) {
      const auto x_in_img = projection_.ImgFromCam(x_in_cam);
      if (!x_in_img) return;
      const Eigen::Vector2d cell = *x_in_img / view_.cell_px - Eigen::Vector2d(0.5, 0.5);
      const auto shift = BestShift(pattern, cell);
      if (!shift) return;
      tally->Add(*shift <= tolerance_);
      const bool is_far = (cell - patch.cell.cast<double>()).norm() > 2 * tolerance_;
      if (is_far) result->far.Add(*shift <= tolerance_);
    };
    const double side = i % 2 == 0 ? 1 : -1;
    for (size_t k = 0; k < options_.turns_deg.size(); ++k) {
      const Eigen::Vector3d axis = Eigen::Vector3d::Unit(i / 2 % 2);
      const double angle = side * RadFromDeg(options_.turns_deg[k]);
      compare(Eigen::AngleAxisd(angle, axis) * patch.x_in_cam, &result->turned[k]);
    }
    for (size_t k = 0; k < options_.moves.size(); ++k) {
      const Eigen::Vector3d axis = Eigen::Vector3d::Unit(i / 2 % 3);
      compare(patch.x_in_cam + side * options_.moves[k] * axis, &result->moved[k]);
    }
  }

  void FindPatches(const cv::Mat1f& scan_grey) {
    const int radius = options_.patch_radius;
    cv::Mat1f smooth, corner;
    cv::GaussianBlur(scan_grey, smooth, cv::Size(), 1.0);
    cv::cornerMinEigenVal(smooth, corner, radius, 3);
    cv::Mat1f covered;
    cv::boxFilter(inside_ / 255, covered, CV_32F, cv::Size(2 * radius + 1, 2 * radius + 1));
    std::vector<float> values;
    std::vector<cv::Point> places;
    const int margin = radius + 1;
    for (int y = margin; y < corner.rows - margin; ++y) {
      for (int x = margin; x < corner.cols - margin; ++x) {
        if (!inside_(y, x) || covered(y, x) < 0.85f) continue;
        values.push_back(corner(y, x));
        const bool peak = corner(y, x) >= corner(y - 1, x) && corner(y, x) > corner(y + 1, x) &&
                          corner(y, x) >= corner(y, x - 1) && corner(y, x) > corner(y, x + 1);
        if (peak) places.emplace_back(x, y);
      }
    }
    if (places.empty()) return;
    const double limit = std::max(kLeastCorner, options_.min_corner_ratio * Quantile(&values, 0.2));
    std::sort(places.begin(), places.end(), [&](const cv::Point& a, const cv::Point& b) {
      if (corner(a) != corner(b)) return corner(a) > corner(b);
      return a.y != b.y ? a.y < b.y : a.x < b.x;
    });
    cv::Mat1b taken(corner.size(), static_cast<uchar>(0));
    for (const cv::Point& place : places) {
      if (static_cast<int>(patches_.size()) >= options_.max_patches) break;
      if (!(corner(place) > limit)) break;
      if (taken(place)) continue;
      cv::circle(taken, place, radius, 255, cv::FILLED);
      const Eigen::Vector2d x_in_img =
          view_.cell_px * Eigen::Vector2d(place.x + 0.5, place.y + 0.5);
      const auto ray = projection_.CamFromImg(x_in_img);
      if (!ray) continue;
      patches_.push_back({{place.x, place.y}, view_.depth(place) * ray->homogeneous()});
    }
  }

  // Gradients of the scan around the patch; what is not inside counts as average, so that it
  // adds nothing to the correlation.
  cv::Mat1f PatternOf(const Patch& patch) const {
    const int radius = options_.patch_radius;
    const cv::Rect area(patch.cell.x() - radius, patch.cell.y() - radius, 2 * radius + 1,
                        2 * radius + 1);
    cv::Mat1f pattern = scan_gradient_(area).clone();
    const cv::Mat1b inside = inside_(area);
    pattern.setTo(cv::mean(pattern, inside)[0], inside == 0);
    return pattern;
  }

  // Distance, in cells, between where the pattern fits the photo best and where it should.
  std::optional<double> BestShift(const cv::Mat1f& pattern, const Eigen::Vector2d& cell) const {
    const auto found = BestPlace(pattern, cell);
    return found ? std::make_optional((*found - cell).norm()) : std::nullopt;
  }

  // Where the pattern fits the photo best, around a cell; none if the search leaves the photo.
  std::optional<Eigen::Vector2d> BestPlace(const cv::Mat1f& pattern,
                                           const Eigen::Vector2d& cell) const {
    const int radius = options_.patch_radius;
    const int column = static_cast<int>(std::lround(cell.x()));
    const int row = static_cast<int>(std::lround(cell.y()));
    const int side = reach_ + radius;
    if (column - side < 0 || row - side < 0 || column + side >= photo_gradient_.cols ||
        row + side >= photo_gradient_.rows) {
      return std::nullopt;
    }
    const cv::Rect area(column - side, row - side, 2 * side + 1, 2 * side + 1);
    cv::Mat1f score;
    cv::matchTemplate(photo_gradient_(area), pattern, score, cv::TM_CCOEFF_NORMED);
    cv::Point peak;
    cv::minMaxLoc(score, nullptr, nullptr, nullptr, &peak);
    Eigen::Vector2d found(column + peak.x - reach_, row + peak.y - reach_);
    const auto at = [&](int dx, int dy) { return score(peak.y + dy, peak.x + dx); };
    if (peak.x > 0 && peak.x + 1 < score.cols)
      found.x() += PeakOffset(at(-1, 0), at(0, 0), at(1, 0));
    if (peak.y > 0 && peak.y + 1 < score.rows)
      found.y() += PeakOffset(at(0, -1), at(0, 0), at(0, 1));
    return found;
  }

  // The middle of another patch, clear of this one's search.
  std::optional<Eigen::Vector2d> OtherPlace(size_t patch) const {
    for (size_t k = 0; k < patches_.size(); ++k) {
      const Patch& other = patches_[(patch + patches_.size() / 2 + k) % patches_.size()];
      const Eigen::Vector2i offset = other.cell - patches_[patch].cell;
      if (offset.cwiseAbs().maxCoeff() > reach_ + 2 * options_.patch_radius) {
        return other.cell.cast<double>();
      }
    }
    return std::nullopt;
  }

  const ScanView& view_;
  const CameraProjection& projection_;
  const GradientShiftOptions& options_;
  cv::Mat1f photo_gradient_, scan_gradient_;
  cv::Mat1b inside_;
  double angle_per_cell_ = 0, tolerance_ = 0;  // radians; cells
  int reach_ = 0;                              // cells
  std::vector<Patch> patches_;
};

// By how many standard deviations the share of `a` is higher than that of `b`. Either counts with
// one more hit and one more miss, so that no hits among few trials are not taken for certain.
double SigmasAbove(const Tally& a, const Tally& b) {
  const double na = static_cast<double>(a.num) + 2, nb = static_cast<double>(b.num) + 2;
  const double pa = static_cast<double>(a.hits + 1) / na, pb = static_cast<double>(b.hits + 1) / nb;
  return (pa - pb) / std::sqrt(pa * (1 - pa) / na + pb * (1 - pb) / nb);
}

}  // namespace

// By hand: Boost.Math bounds a binomial share by Clopper and Pearson or Jeffreys, not by Wilson.
double Tally::Low(double sigmas) const {
  if (num == 0) return 0;
  const double n = static_cast<double>(num), p = Share(), z2 = sigmas * sigmas;
  return (p + z2 / (2 * n) - sigmas * std::sqrt(p * (1 - p) / n + z2 / (4 * n * n))) / (1 + z2 / n);
}

double Tally::High(double sigmas) const {
  if (num == 0) return 1;
  const double n = static_cast<double>(num), p = Share(), z2 = sigmas * sigmas;
  return (p + z2 / (2 * n) + sigmas * std::sqrt(p * (1 - p) / n + z2 / (4 * n * n))) / (1 + z2 / n);
}

std::optional<double> GradientShifts::ShownShare() const {
  for (const Alike* alike : {&alike_of_clear, &alike_of_plain}) {
    const double num = static_cast<double>(alike->patches.num);
    if (alike->patches.num < kMinPatches || alike->num_by_chance >= num) continue;
    const double beyond = static_cast<double>(alike->patches.hits) - alike->num_by_chance;
    return std::max(0.0, beyond) / (num - alike->num_by_chance);
  }
  return std::nullopt;
}

void GradientShifts::Add(const GradientShifts& other) {
  num_photos += other.num_photos;
  num_unclear_photos += other.num_unclear_photos;
  shifts_px.insert(shifts_px.end(), other.shifts_px.begin(), other.shifts_px.end());
  shifts_deg.insert(shifts_deg.end(), other.shifts_deg.begin(), other.shifts_deg.end());
  at_pose.Add(other.at_pose);
  ring.Add(other.ring);
  clear.Add(other.clear);
  turned.resize(std::max(turned.size(), other.turned.size()));
  moved.resize(std::max(moved.size(), other.moved.size()));
  for (size_t k = 0; k < other.turned.size(); ++k) turned[k].Add(other.turned[k]);
  for (size_t k = 0; k < other.moved.size(); ++k) moved[k].Add(other.moved[k]);
  far.Add(other.far);
  elsewhere.Add(other.elsewhere);
  tolerance_deg = std::max(tolerance_deg, other.tolerance_deg);
  alike_of_clear.Add(other.alike_of_clear);
  alike_of_plain.Add(other.alike_of_plain);
  corners.insert(corners.end(), other.corners.begin(), other.corners.end());
  corners_amiss.insert(corners_amiss.end(), other.corners_amiss.begin(), other.corners_amiss.end());
  shifted_alike.insert(shifted_alike.end(), other.shifted_alike.begin(), other.shifted_alike.end());
}

GradientShifts MeasureGradientShifts(const ScanView& view, const cv::Mat& photo,
                                     const CameraProjection& projection, double sample_angle,
                                     const GradientShiftOptions& options) {
  return PhotoMatcher(view, photo, projection, sample_angle, options).Measure();
}

GradientAgreement JudgeGradientShifts(const GradientShifts& shifts) {
  GradientAgreement result;
  result.shifts = shifts;
  result.median_shift_px = Median(shifts.shifts_px);
  result.median_shift_deg = Median(shifts.shifts_deg);
  // The ring has three times the area of the disc that it surrounds.
  result.supports = shifts.at_pose.num >= kMinSupporting &&
                    SigmasAbove(shifts.at_pose, shifts.elsewhere) >= kClearly &&
                    SigmasAbove(shifts.at_pose, shifts.far) >= kClearly &&
                    shifts.at_pose.Share() >= 2 * shifts.elsewhere.Share() &&
                    shifts.at_pose.Share() > shifts.ring.Share() / 3;
  // At a wrong pose, the poses far from it are as good as other places, and there are more of them.
  Tally by_chance = shifts.elsewhere;
  by_chance.Add(shifts.far);
  result.contradicts = shifts.clear.num >= kMinPatches &&
                       SigmasAbove(shifts.clear, by_chance) < kChanceLike &&
                       shifts.clear.High(3) < kLeastShareWhenRight;
  if (result.contradicts) {
    result.reason = fmt::format(
        "Photos and scan do not show the same at the same place: of {} corners of the scan's "
        "intensity, {:.1f} % lie within {:.1f} degrees of where the photos have them, and {:.1f} % "
        "do so by chance. Check that scan and photos are of the same room, and the picks.",
        shifts.clear.num, 100 * shifts.clear.Share(), shifts.tolerance_deg,
        100 * by_chance.Share());
  }
  return result;
}

}  // namespace roomtex
