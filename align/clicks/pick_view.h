#pragma once
// The picks of one photo, and what they say about its pose.

#include <functional>
#include <string>
#include <vector>

#include "align/clicks/pick_review.h"
#include "align/clicks/picks.h"
#include "align/clicks/pose_choice.h"
#include "colmap_ext/sparse_model.h"

namespace roomtex {

struct PickView {
  std::string image_name;
  const SparseImage* image = nullptr;  // of the model
  std::vector<int> picks;              // indices of those that count (weight > 0)
  PointPairs pairs;                    // the same
  // Why they cannot fix a pose (FindLayoutProblem); such picks get no review. Else empty.
  std::string layout_problem;
  PickReview review;

  bool HasPose() const { return review.HasPose(); }
};

// How picks without a layout problem are reviewed: ReviewPicks(), or what knows fewer than six or
// remembers.
using PickReviewer = std::function<PickReview(const std::string& image_name,
                                              const CameraProjection&, const PointPairs&)>;

// The photos with at least min_picks (3 or more) picks that count, in the order of their names.
// Picks must name images of the model.
std::vector<PickView> ReviewViews(const SparseModel& model, const std::vector<Pick>& picks,
                                  int min_picks, const PickReviewOptions& options,
                                  const PickReviewer& reviewer);
// By ReviewPicks(): photos with kMinPicksPerPhoto picks and more.
std::vector<PickView> ReviewViews(const SparseModel& model, const std::vector<Pick>& picks,
                                  const PickReviewOptions& options);

// Metres per sparse unit by the features of one photo: EstimateScale() on one form of the scans or
// another.
using ScaleOfPhoto = std::function<ScaleEstimate(const SparseImage&, const Rigid& cam_from_scan,
                                                 const ScaleOptions&)>;

// Which of the poses of a view is the photo's (ChoosePose). The view must have one.
PoseChoice ChoosePoseOf(const PickView& view, const ScaleOptions& options, int min_features,
                        const ScaleOfPhoto& scale_of_photo);

}  // namespace roomtex
