#pragma once
// Whether a finished model is right, by what it was not made from. First, every verified match: a
// photo whose matches mostly disobey the model's poses stands in the wrong place. Second, the
// third-view test (third_view.h) once more: pairs that the model was not started from are solved
// anew, and other photos of the model decide whether its motion or another one is right. A model
// that took a wall's second solution, or bent on the way, fails.

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "colmap_ext/match_support.h"
#include "colmap_ext/matched_images.h"
#include "colmap_ext/sparse_model.h"
#include "colmap_ext/two_view_hypotheses.h"

namespace roomtex {

struct ModelCheckOptions {
  HypothesisOptions pair;
  // Cost of the model's motion / least cost from which on the model is contradicted; larger = more
  // tolerant.
  double min_confidence = 1.3;
  int max_pairs = 12;       // of the third-view test, spread over the photos; larger = slower
  int max_third_views = 2;  // per pair
  // Smallest median angle between the rays of a pair, degrees: below, its motion is too uncertain.
  double min_tri_angle_deg = 2;
  // Share of the tested pairs that must contradict; one pair alone does where fewer are tested.
  double max_contradicting = 0.25;
  double min_support = kMinSupport;  // of a photo; larger = stricter
};

struct ModelCheck {
  int num_pairs = 0;  // of the third-view test
  std::vector<std::pair<uint32_t, uint32_t>> contradicting;
  // Share of each photo's verified matches that obey the model; photos without matches are missing.
  std::map<uint32_t, double> support;
  // Photos that lack support; those first of which the most matches disobey: a photo that stands
  // wrong has them with all others, one that matches it with that one alone.
  std::vector<uint32_t> doubtful;
  bool trusted = true;  // neither doubtful photos nor too many contradicting pairs
};

// without: the pair that the model was started from. The cameras of `images` are the model's.
ModelCheck CheckModel(MatchedImages* images, const SparseModel& model,
                      const std::pair<uint32_t, uint32_t>& without,
                      const ModelCheckOptions& options, int num_threads);

}  // namespace roomtex
