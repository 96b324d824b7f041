#include "capture/calibration/calibration.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "capture/calibration/calibration_models.h"
#include "capture/calibration/calibration_output.h"
#include "capture/calibration/calibration_trust.h"
#include "capture/calibration/calibration_uncertainty.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/option_fields.h"
#include "core/statistics.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr int kMinPhotos = 3;   // fewer leave the camera open whatever they show
constexpr int kMinCorners = 8;  // of a photo
constexpr double kHuberSigmas = 3;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Standard deviation of one coordinate from the median length of the residuals: for two Gaussian
// coordinates the median of the squared length is 2 ln 2 sigma^2. unknowns: that the photo's
// corners have to determine.
double RobustSigma(const Eigen::Matrix2Xd& residuals, double unknowns) {
  std::vector<double> squares;
  for (int i = 0; i < residuals.cols(); ++i) {
    const double square = residuals.col(i).squaredNorm();
    squares.push_back(std::isfinite(square) ? square : 1e12);
  }
  const double coordinates = 2.0 * static_cast<double>(residuals.cols());
  const double left = std::max(coordinates - unknowns, 1.0);
  return std::sqrt(Median(squares) / (2 * std::log(2.0)) * coordinates / left);
}

// Highest less lowest corner, and whether that has to be taken into account: a bow that is
// certain, and moves the focal length.
BoardBow DescribeBow(const Board& board, const BentFit& bent, const Camera& without) {
  constexpr double kCertain = 5, kMoves = 2;  // standard deviations
  constexpr double kNoticeable = 0.1;         // percent of the focal length
  BoardBow bow;
  if (!bent.found) return bow;
  Eigen::Matrix2Xd corners(2, board.NumCorners());
  for (int id = 0; id < board.NumCorners(); ++id) corners.col(id) = board.CornerOnBoard(id);
  const Eigen::Matrix3Xd shapes = BendShapes(board, corners);
  const Eigen::VectorXd heights = shapes.transpose() * bent.bend;
  Eigen::Index highest = 0, lowest = 0;
  bow.height = heights.maxCoeff(&highest) - heights.minCoeff(&lowest);
  const Eigen::Vector3d difference = shapes.col(highest) - shapes.col(lowest);
  bow.sigma = std::sqrt(difference.dot(bent.bend_covariance * difference));
  const double focal = bent.fit.camera.MeanFocalLength();
  bow.focal_percent = 100 * (without.MeanFocalLength() / focal - 1);
  const double focal_sigma = 100 * std::sqrt(bent.fit.covariance(0, 0)) / focal;
  bow.used = bow.height > kCertain * bow.sigma &&
             std::abs(bow.focal_percent) > std::max(kNoticeable, kMoves * focal_sigma);
  return bow;
}

// The photos that take part, and what became of their corners.
class PhotoSelection {
 public:
  PhotoSelection(const std::vector<BoardPhoto>& photos, const Board& board,
                 const CalibrationOptions& options)
      : photos_(photos), board_(board), options_(options) {
    for (size_t i = 0; i < photos.size(); ++i) {
      if (!photos[i].reason.empty()) continue;
      if (photos[i].NumCorners() < kMinCorners) continue;
      index_.push_back(i);
      views_.push_back(MakeBoardView(photos[i], board));
    }
  }

  // Fits all, leaves out the worst photo, and so on until all fit; then those left out get another
  // chance with the camera of the rest.
  void Select() {
    const BoardPhoto& first = photos_[index_.front()];
    fit_ = RoughFit(views_, first.width, first.height);
    SelectWithBend();
    if (!TakeBend()) return;
    // Corners and photos were judged by a flat board.
    SelectWithBend();
    TakeBend();
    Fit();
  }

  const std::vector<size_t>& index() const { return index_; }
  const std::vector<BoardView>& views() const { return views_; }
  const CameraFit& fit() const { return fit_; }
  double sigma() const { return sigma_; }
  const BoardBow& bow() const { return bow_; }

  struct Dropped {
    size_t index;
    BoardView view;
    Rigid cam_from_board;
    double sigma;
  };
  const std::vector<Dropped>& dropped() const { return dropped_; }

 private:
  void SelectWithBend() {
    Fit();
    while (true) {
      const int worst = WorstPhoto();
      if (worst < 0) break;
      Drop(worst);
      Fit();
    }
    if (TakeBack()) Fit();
  }

  // Whether the board is bent, and whether that matters: true if it is taken into account.
  bool TakeBend() {
    for (BoardView& view : views_) view.bend.setZero();
    const double huber_px = kHuberSigmas * sigma_;
    const CameraFit without = FitCamera(views_, fit_.lens, fit_, huber_px);
    const BentFit bent = FitBend(views_, without, huber_px);
    bow_ = DescribeBow(board_, bent, without.camera);
    const Eigen::Vector3d bend = bow_.used ? bent.bend : Eigen::Vector3d::Zero();
    for (BoardView& view : views_) view.bend = bend;
    for (Dropped& one : dropped_) one.view.bend = bend;
    if (bow_.used) fit_ = bent.fit;
    return bow_.used;
  }

  // The richest lens that so few photos can bear: what it cannot explain is not the lens.
  LensModel JudgingLens() const { return LensModels()[views_.size() < 6 ? 2 : 3]; }

  void Fit() {
    for (int round = 0; round < 6; ++round) {
      const double before = sigma_;
      if (round == 0) {
        // From simple to rich, at first with a limit that any focal length passes.
        Measure();
        for (const LensModel& lens : LensModels()) {
          if (lens.num_free > JudgingLens().num_free) break;
          if (lens.num_free < fit_.lens.num_free) continue;
          fit_ = FitCamera(views_, lens, fit_, kHuberSigmas * sigma_);
          Measure();
        }
      } else {
        fit_ = FitCamera(views_, JudgingLens(), fit_, kHuberSigmas * sigma_);
        Measure();
      }
      if (round > 1 && std::abs(sigma_ - before) < 0.01 * sigma_) break;
    }
  }

  // Noise per photo and of the median photo; weights; corners that are off.
  void Measure() {
    sigmas_.clear();
    std::vector<Eigen::Matrix2Xd> residuals;
    const double shared =
        static_cast<double>(fit_.lens.num_free) / static_cast<double>(views_.size());
    for (size_t i = 0; i < views_.size(); ++i) {
      residuals.push_back(Residuals(views_[i], fit_.camera, fit_.cam_from_board[i]));
      sigmas_.push_back(RobustSigma(residuals.back(), 6 + shared));
    }
    sigma_ = std::max(Median(sigmas_), 1e-9);
    for (size_t i = 0; i < views_.size(); ++i) {
      BoardView& view = views_[i];
      // Within half as much again photos differ by chance.
      const double ratio = sigmas_[i] / sigma_;
      view.weight = ratio > 1.5 ? 1 / (ratio * ratio) : 1;
      const double limit = options_.bad_corner_sigmas * std::max(sigma_, sigmas_[i]);
      for (int k = 0; k < residuals[i].cols(); ++k) {
        const double length = residuals[i].col(k).norm();
        view.used[k] = length <= limit;
      }
      // A photo whose corners mostly disagree is bad as a whole: judged by WorstPhoto().
      if (std::count(view.used.begin(), view.used.end(), true) < kMinCorners) {
        view.used.assign(view.used.size(), true);
      }
    }
  }

  bool IsBad(double sigma, const BoardView& view) const {
    const auto num_used = std::count(view.used.begin(), view.used.end(), true);
    if (4 * num_used < 3 * static_cast<long>(view.used.size())) return true;
    return sigma > options_.bad_photo_ratio * sigma_ && sigma > options_.bad_photo_px;
  }

  int WorstPhoto() const {
    if (static_cast<int>(views_.size()) <= kMinPhotos) return -1;
    int worst = -1;
    for (size_t i = 0; i < views_.size(); ++i) {
      if (!IsBad(sigmas_[i], views_[i])) continue;
      if (worst < 0 || sigmas_[i] > sigmas_[worst]) worst = static_cast<int>(i);
    }
    return worst;
  }

  void Drop(int i) {
    dropped_.push_back({index_[i], views_[i], fit_.cam_from_board[i], sigmas_[i]});
    index_.erase(index_.begin() + i);
    views_.erase(views_.begin() + i);
    fit_.cam_from_board.erase(fit_.cam_from_board.begin() + i);
  }

  // A photo may look bad because another one bent the camera.
  bool TakeBack() {
    std::vector<Dropped> remaining;
    bool any = false;
    for (Dropped& one : dropped_) {
      one.view.weight = 1;
      one.view.used.assign(one.view.used.size(), true);
      one.cam_from_board =
          FitPose(one.view, fit_.camera, one.cam_from_board, kHuberSigmas * sigma_);
      const Eigen::Matrix2Xd residuals = Residuals(one.view, fit_.camera, one.cam_from_board);
      one.sigma = RobustSigma(residuals, 6);
      const double limit = options_.bad_corner_sigmas * std::max(sigma_, one.sigma);
      for (int k = 0; k < residuals.cols(); ++k) {
        one.view.used[k] = residuals.col(k).norm() <= limit;
      }
      if (IsBad(one.sigma, one.view)) {
        remaining.push_back(one);
        continue;
      }
      any = true;
      const auto at = std::lower_bound(index_.begin(), index_.end(), one.index) - index_.begin();
      index_.insert(index_.begin() + at, one.index);
      views_.insert(views_.begin() + at, one.view);
      fit_.cam_from_board.insert(fit_.cam_from_board.begin() + at, one.cam_from_board);
    }
    dropped_ = std::move(remaining);
    return any;
  }

  const std::vector<BoardPhoto>& photos_;
  const Board& board_;
  const CalibrationOptions& options_;
  std::vector<size_t> index_;  // into photos_, per view
  std::vector<BoardView> views_;
  std::vector<Dropped> dropped_;
  CameraFit fit_;
  std::vector<double> sigmas_;
  double sigma_ = 0;
  BoardBow bow_;
};

// Why a photo was left out.
std::string ReasonOf(const PhotoSelection::Dropped& dropped, double sigma, double edge_width,
                     double median_edge_width) {
  const auto num_bad = std::count(dropped.view.used.begin(), dropped.view.used.end(), false);
  const auto num_corners = static_cast<long>(dropped.view.used.size());
  const std::string reason =
      4 * num_bad > num_corners
          ? std::to_string(num_bad) + " of its " + std::to_string(num_corners) +
                " corners contradict the other photos"
          : "its corners miss by " + Number(dropped.sigma, 2) +
                " px, those of the median photo by " + Number(sigma, 2) + " px";
  if (edge_width > 1.5 * median_edge_width && median_edge_width > 0) {
    return reason + ": blurred (edges " + Number(edge_width, 1) + " px wide, in the median photo " +
           Number(median_edge_width, 1) + " px)";
  }
  return reason + ": another board, a bent one, or corners found wrongly";
}

void DescribePose(const Rigid& cam_from_board, const Eigen::Vector2d& middle,
                  CalibratedPhoto* photo) {
  photo->cam_from_board = cam_from_board;
  const Eigen::Vector3d centre = cam_from_board * Eigen::Vector3d(middle.x(), middle.y(), 0);
  const Eigen::Vector3d normal = cam_from_board.rotation * Eigen::Vector3d::UnitZ();
  photo->distance = centre.norm();
  photo->tilt_deg =
      DegFromRad(std::acos(std::clamp(std::abs(normal.dot(centre.normalized())), 0.0, 1.0)));
}

// What the report says of photos that take part or were left out by their residuals.
void DescribePhotos(const std::vector<BoardPhoto>& photos, const Board& board,
                    const PhotoSelection& selection, const CameraFit& fit, Calibration* result) {
  const Eigen::Vector2d middle = board.CornerOnBoard(board.NumCorners() - 1) / 2;
  std::vector<double> edge_widths;
  for (const BoardPhoto& photo : photos) {
    if (photo.edge_width_px > 0) edge_widths.push_back(photo.edge_width_px);
    CalibratedPhoto one;
    one.name = photo.name;
    one.reason = photo.reason;
    one.num_corners = photo.NumCorners();
    one.rms_px = one.held_out_rms_px = one.tilt_deg = one.distance = kNaN;
    one.x_in_img = photo.x_in_img;
    if (one.reason.empty() && one.num_corners < kMinCorners) {
      one.reason = "only " + std::to_string(one.num_corners) + " corners were found, " +
                   std::to_string(kMinCorners) + " are needed";
    }
    result->photos.push_back(one);
  }
  for (size_t i = 0; i < selection.index().size(); ++i) {
    CalibratedPhoto& one = result->photos[selection.index()[i]];
    const BoardView& view = selection.views()[i];
    one.used = true;
    one.num_bad_corners = static_cast<int>(std::count(view.used.begin(), view.used.end(), false));
    one.rms_px = fit.view_rms_px[i];
    one.held_out_rms_px = fit.held_out_rms_px[i];
    one.residuals = fit.residuals[i];
    one.corner_used = view.used;
    DescribePose(fit.cam_from_board[i], middle, &one);
  }
  const double median_edge_width = Median(edge_widths);
  for (const PhotoSelection::Dropped& dropped : selection.dropped()) {
    CalibratedPhoto& one = result->photos[dropped.index];
    BoardView view = dropped.view;
    const Rigid pose =
        FitPose(view, fit.camera, dropped.cam_from_board, kHuberSigmas * selection.sigma());
    one.residuals = Residuals(view, fit.camera, pose);
    view.used.assign(view.used.size(), true);
    one.corner_used = dropped.view.used;
    one.rms_px = RmsLength(view, one.residuals);
    one.reason = ReasonOf(dropped, selection.sigma(), photos[dropped.index].edge_width_px,
                          median_edge_width);
    DescribePose(pose, middle, &one);
  }
}

}  // namespace

int Calibration::NumUsed() const {
  return static_cast<int>(std::count_if(photos.begin(), photos.end(),
                                        [](const CalibratedPhoto& photo) { return photo.used; }));
}

std::vector<std::string> CalibrationOptions::CameraModels() {
  return {"auto", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV"};
}

void CalibrationOptions::Declare(OptionFields* fields) {
  fields->Choice("camera_model", &camera_model, CameraModels(),
                 "COLMAP's model of the lens; auto = the simplest that foretells photos left "
                 "out as well as richer ones do.");
  fields
      ->Number("Model.min_gain", &min_gain,
               "auto takes a richer model when the log-likelihood of photos held out grows by "
               "more than this; larger = simpler models.")
      .NotNegative();
  fields
      ->Number("Photos.bad_ratio", &bad_photo_ratio,
               "A photo is left out when its corners scatter more than this many times the "
               "median photo's; larger = more tolerant.")
      .Above(1)
      .Says("must be more than 1");
  fields
      ->Number("Photos.bad_px", &bad_photo_px,
               "Pixels; never left out when they scatter less than this.")
      .NotNegative();
  fields
      ->Number("Photos.bad_corner_sigmas", &bad_corner_sigmas,
               "Corners are left out beyond this many standard deviations; larger = more "
               "tolerant.")
      .AtLeast(3);
  fields->Int("Trust.min_photos", &min_photos, "Photos that must take part.").AtLeast(kMinPhotos);
  fields
      ->Number("Trust.min_tilt_deg", &min_tilt_deg,
               "Degrees; largest angle between two boards must be at least this.")
      .AtLeast(0)
      .Below(90)
      .Says("must be from 0 to 90");
  fields
      ->Number("Trust.min_radius", &min_radius,
               "Boards must reach this share of the way from the middle of the picture to "
               "its corners.")
      .AtLeast(0)
      .AtMost(1)
      .Says("must be from 0 to 1");
  fields
      ->Number("Trust.max_focal_sigma_percent", &max_focal_sigma_percent,
               "Percent; largest standard deviation of the focal length.")
      .Positive();
  fields
      ->Number("Trust.max_sigma_px", &max_sigma_px,
               "Pixels; largest standard deviation of the whole picture (root mean square).")
      .Positive();
  fields
      ->Number("Trust.max_photo_scatter", &max_photo_scatter,
               "Photos may disagree at most this many times as much as the noise of their corners "
               "lets expect; larger = more tolerant.")
      .AtLeast(1);
}

std::vector<std::string> CalibrationOptions::Problems() const { return ProblemsOf(*this); }

Calibration Calibrate(const std::vector<BoardPhoto>& photos, const Board& board,
                      const CalibrationOptions& options, const std::string& path) {
  PhotoSelection selection(photos, board, options);
  const int num_found = static_cast<int>(selection.index().size());
  if (num_found < kMinPhotos) {
    std::string finding = "the " + board.Name() + " was found in only " +
                          std::to_string(num_found) + " of " + std::to_string(photos.size()) +
                          " photos";
    for (const BoardPhoto& photo : photos) {
      if (photo.reason.empty()) continue;
      finding += "; " + photo.name + ": " + photo.reason;
      break;
    }
    throw InputError(path, "", finding,
                     "At least three are needed, ten to twenty at different tilts are good");
  }
  selection.Select();

  Calibration result;
  const CameraFit fit =
      ChooseModel(selection.views(), selection.fit(), options, &result.models, &result.why_model);
  result.camera = RoundedCamera(fit.camera);
  result.lens = fit.lens;
  result.sigma_px = fit.sigma_px;
  result.bow = selection.bow();
  if (!fit.converged) {
    result.reasons.emplace_back(
        "the adjustment came to no rest: what the photos show leaves the camera open, or fits no "
        "lens; give --camera_model a simpler one, or more photos at other tilts");
  }
  DescribePhotos(photos, board, selection, fit, &result);
  DescribeUncertainty(fit, selection.views(), &result);
  DescribeCoverage(&result);
  JudgeCalibration(options, &result);
  return result;
}

}  // namespace roomtex
