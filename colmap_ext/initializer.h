#pragma once
// Chooses the pair that a reconstruction starts from and solves it (thesis 6.1; docs/colmap.md).
// Replaces COLMAP's search for an initial pair.

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "colmap_ext/matched_images.h"
#include "colmap_ext/sparse_model.h"
#include "colmap_ext/third_view.h"

namespace roomtex {

class OptionFields;

struct InitOptions {
  // Verified matches a pair must have, and inliers it must keep; larger = stricter.
  int min_num_inliers = 30;
  // Standard deviation of a keypoint coordinate, pixels; larger = more tolerant. SIFT on sharp
  // photos: 0.5-1.
  double keypoint_noise_px = 1.0;
  // Largest reprojection error of an inlier, pixels; larger = more tolerant. 0 = 3.03 times
  // keypoint_noise_px, which one true match in a hundred exceeds (chi-square).
  double max_error_px = 0;
  // Smallest median angle between a pair's rays, degrees; larger = stricter, better conditioned.
  double min_tri_angle_deg = 2.0;
  // Share of F inliers on one homography above which the structure is reported as degenerate
  // (thesis 6.1.3).
  double degenerate_ratio = 0.95;
  // Second best cost / best cost above which a third view counts as having decided
  // (docs/colmap.md).
  double min_confidence = 1.3;
  int max_third_views = 4;  // per pair; 0 = never look at a third view
  // Pairs that are solved in search of one that a third view confirms, before the most confident of
  // the others is taken; larger = slower where nothing is confirmed.
  int max_candidates = 10;
  int max_pairs = 3;  // pairs handed to COLMAP before giving up
  // Names of the images to start from; "" = chosen. With one of them set, its best partner is
  // chosen.
  std::string image_name1, image_name2;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// Result of one pair.
struct PairTrial {
  uint32_t image_id1 = 0, image_id2 = 0;  // left, right
  int num_matches = 0;
  TwoViewAnalysis analysis;
  ThirdViewDecision decision;
  std::string problem;  // why the pair was not used; "" if it was
};

// Where a reconstruction starts.
struct Seed {
  PairTrial trial;
  // Nothing told the pair's hypotheses apart: neither a third view nor, without one, enough points
  // off the wall.
  bool ambiguous = false;
  // The pair with its points; the left image stands in the origin, the baseline is 1 long.
  SparseModel pair_model;
  // The pair and the views that validated it: poses, no points.
  SparseModel poses;
};

class Initializer {
 public:
  // `images` must outlive this. num_threads changes the speed only.
  Initializer(MatchedImages* images, const InitOptions& options, int num_threads,
              uint64_t random_seed);
  ~Initializer();

  // The best seed not given yet; none when no pair is left. Seeds that a third view confirmed come
  // first.
  std::optional<Seed> Next();

  // Every pair solved so far and not given as a seed, with its problem; for the report.
  std::vector<PairTrial> Rejected() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace roomtex
