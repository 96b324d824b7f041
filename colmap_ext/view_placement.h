#pragma once
// Places a view that COLMAP's mapper left out (thesis 6.2): neighbours overlap well, but too few
// points are seen three times for PnP. The relative pose of the view and a registered neighbour
// comes from their own matches; a few common points give its scale.

#include <memory>
#include <string>
#include <vector>

#include "colmap_ext/matched_images.h"
#include "colmap_ext/sparse_model.h"
#include "colmap_ext/two_view_hypotheses.h"

namespace roomtex {

class OptionFields;

struct ChainOptions {
  bool enabled = true;
  // Matches that must obey the motion to the neighbour, and points the view must hold in the end;
  // larger = stricter. Below COLMAP's 30 for PnP: a pair's matches are verified already.
  int min_num_inliers = 20;
  // Points of the model that both views see, for the scale; larger = stricter. docs/colmap.md: 5.
  int min_common_points = 5;
  // Robust spread (1.48 times the median deviation) of the scale's logarithm over the common
  // points, i.e. 0.15 = 15 %; larger = more tolerant. Three times what the true pairs of
  // tests/colmap_ext/view_chaining_test.cc stay below.
  double max_scale_spread = 0.15;
  // As InitOptions::min_confidence, for two poses that both fit; larger = stricter.
  double min_confidence = 1.3;
  // Of the points that the view and the photos before it have in common, or ought to
  // (expected_sightings.h), the share that it must have, if they are few; larger = stricter, 0 =
  // not asked. Measured: docs/colmap.md, "Photos of furniture of one make".
  double min_sight_share = 0.35;
  int max_neighbors = 4;  // per view, those with most matches; larger = slower

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// Robust average of ratios, all positive (thesis 6.2.1, "a consistent average"): the median of the
// logarithms picks the ratios within three spreads, their mean is the answer.
struct RatioAverage {
  double scale = 1;
  double spread = 0;  // 1.4826 * median absolute deviation of the logarithm
};
RatioAverage AverageRatios(const std::vector<double>& ratios);

// Thesis 6.2.2, left view registered: [R'R | R'T + sT']. (With the roles swapped before the pair is
// solved, the registered view is always the left one.)
Rigid ChainPose(const Rigid& left_from_model, const Rigid& right_from_left, double scale);

// What became of one left-out view.
struct ChainedView {
  uint32_t image_id = 0, neighbor_id = 0;
  Rigid cam_from_model;
  int num_inliers = 0;        // matches with the neighbour that obey the pose
  int num_common_points = 0;  // points of the model that the view sees
  double scale_spread = 0;
  double confidence = 0;  // second best cost / best cost; infinite without a rival
  std::string problem;    // why it could not be registered; "" if it was
};

class ViewPlacer {
 public:
  // `images` must outlive this; its cameras are those of the model. pair: noise and thresholds of
  // the hypotheses. num_threads changes the speed only.
  ViewPlacer(MatchedImages* images, const ChainOptions& options, const HypothesisOptions& pair,
             int num_threads);
  ~ViewPlacer();

  // Where the model says that these images, which it lacks, were taken.
  std::vector<ChainedView> Place(const std::vector<uint32_t>& image_ids, const SparseModel& model);

  // What speaks against a placed view in `after`, which is `before` with it and others added,
  // triangulated and adjusted; "" if nothing does. The view must still obey its pair and hold
  // points, and the views it was chained to must fit among each other as before.
  std::string ProblemOf(const ChainedView& view, const SparseModel& before,
                        const SparseModel& after);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace roomtex
