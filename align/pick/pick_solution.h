#pragma once
// What the picks say, for the page: poses, residuals, doubts. By the functions that roomtex-align
// runs, so that both say the same of the same picks.

#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "align/alignment.h"
#include "align/pick/found_places.h"
#include "align/pick/pick_scene.h"
#include "align/pick/session_pick.h"

namespace roomtex {

inline constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

// NaN where there is no number.
struct PickState {
  enum class Status { kUsed, kOff, kBad, kHalf, kWaiting };
  Status status = Status::kHalf;
  Eigen::Vector2d error_px = Eigen::Vector2d::Constant(kNoNumber);  // projection - click
  double residual_px = kNoNumber;
  // Metres between the picked point and the click's ray where that is as deep as the point.
  double residual = kNoNumber;
  double leave_one_out_px = kNoNumber;
  double without_px2 = kNoNumber;  // as PickReview
  // Of the used picks of its photo the one whose left-out distance says most: without it the others
  // fit best. (The residual, where that is not known.) With few picks a wrong one bends the
  // solution to itself, and good ones with it.
  bool worst = false;
  // Where the missing partner of a half pick should be.
  std::optional<Eigen::Vector2d> predicted_img;
  std::optional<ScanSpot> predicted_spot;
  Eigen::Vector3d predicted_point = Eigen::Vector3d::Zero();
};

struct PhotoState {
  enum class By { kNothing, kPicks, kSparseModel, kSearch };
  int num_complete = 0, num_used = 0;
  By by = By::kNothing;
  Rigid cam_from_scan;        // only if solved()
  double rms_px = kNoNumber;  // weighted, of the used picks
  double rms = kNoNumber;     // metres, the same
  double position_sigma = kNoNumber;
  // Of a lens that the search adjusted, or that the picks found, without a sparse model; then with
  // one standard deviation of the focal length in pixels.
  std::shared_ptr<const CameraProjection> found_projection;
  double focal_sigma = kNoNumber;
  bool ambiguous = false;
  std::vector<std::string> warnings;

  bool solved() const { return by != By::kNothing; }
  bool solved_by_picks() const { return solved() && by != By::kSearch; }
  const CameraProjection& projection(const PickPhoto& photo) const {
    return found_projection ? *found_projection : *photo.projection;
  }
};

// One of the sparse models: the picks in its photos place it, and no other.
struct ModelState {
  std::optional<Similarity> scan_from_sparse;
  ScaleEstimate scale;
  double rms_px = kNoNumber;  // of its used picks, as roomtex-align's picks.rms_px
  // What is wrong with picks that count together over several photos.
  std::vector<std::string> warnings;
  int num_clicked_photos = 0;
};

struct PickSolution {
  std::vector<PickState> picks;              // one per pick
  std::map<std::string, PhotoState> photos;  // all of the scene
  std::vector<ModelState> models;            // the same
  // Of the check points (weight 0) in photos that are solved; metres.
  int num_check_points = 0;
  double check_rms_px = kNoNumber, check_rms = kNoNumber;
  // Where the search has put the photos, null if it has not: counts for those that no picks place.
  std::shared_ptr<const FoundPlaces> found;
  bool with_rays = false;  // the ray caster stood
  std::string next;        // what to do now
};

class PickSolver {
 public:
  explicit PickSolver(const PickScene& scene) : scene_(scene) {}

  // From here on; may be null.
  void TakeFound(std::shared_ptr<const FoundPlaces> found) { found_ = std::move(found); }
  // One call at a time.
  PickSolution Solve(const std::vector<SessionPick>& picks);

 private:
  // The picks of one model that have both sides, and where each stands in the list.
  struct Complete {
    int model = 0;
    std::vector<Pick> picks;
    std::vector<int> index;
  };
  // A photo with three picks or more, and which of its poses is its own (if it could be told).
  struct Views {
    std::vector<PickView> views;
    std::vector<std::optional<PoseChoice>> choices;
  };

  PickReview Review(const std::string& name, const CameraProjection& projection,
                    const PointPairs& pairs);
  // Of each model.
  std::vector<Complete> CompletePicks(const std::vector<SessionPick>& picks,
                                      PickSolution* solution) const;
  Views SolveViews(const Complete& complete, const ScaleOfPhoto& scale_of_photo,
                   PickSolution* solution);
  std::optional<PoseChoice> SolveView(const ScaleOfPhoto& scale_of_photo, PickView* view,
                                      PhotoState* photo) const;
  ScaleOfPhoto ScaleByRays(int model, const ScanRays* rays) const;  // empty without them
  Views SolveModel(const Complete& complete, const ScanRays* rays, PickSolution* solution);
  void Warn(const Views& views, PickSolution* solution) const;
  void FitModel(const Complete& complete, const Views& views, const ScaleOfPhoto& scale_of_photo,
                PickSolution* solution) const;
  void TakeSpread(const Complete& complete, const PickStart& found, PickSolution* solution) const;
  void PlaceFound(PickSolution* solution) const;
  void Measure(const std::vector<SessionPick>& picks, PickSolution* solution) const;
  void Predict(const std::vector<SessionPick>& picks, const ScanRays* rays,
               PickSolution* solution) const;

  const PickScene& scene_;
  const AlignmentOptions options_;
  std::shared_ptr<const FoundPlaces> found_;
  // The review of a photo whose picks have not changed is not made again.
  struct Reviewed {
    PointPairs pairs;
    PickReview review;
  };
  std::map<std::string, Reviewed> reviewed_;
};

}  // namespace roomtex
