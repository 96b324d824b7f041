#include "colmap_ext/pair_options.h"

#include "core/option_fields.h"

namespace roomtex {

void PairOptions::Declare(OptionFields* fields) {
  fields
      ->Int("Pairs.max_neighbors", &max_neighbors,
            "Pairs that a photo asks for; larger = more pairs, closer to all of them.")
      .AtLeast(2);
  fields
      ->Int("Pairs.num_candidates", &num_candidates,
            "Photos that each is compared with because they look alike; larger = slower, misses "
            "less.")
      .AtLeast(1);
  fields
      ->Int("Pairs.num_features", &num_features,
            "Features of a photo, those of the largest scale, that a comparison uses; the time "
            "grows with the square.")
      .Within(100, 8192);
  fields
      ->Int("Pairs.min_num_inliers", &min_num_inliers,
            "Matches of them that one camera motion must explain; larger = stricter.")
      .AtLeast(8);
  fields
      ->Number("Pairs.max_ratio", &check.max_ratio,
               "Angle to the nearest descriptor over that to the next; larger = more tolerant.")
      .Between(0, 1);
  fields
      ->Number("Pairs.max_error", &check.max_error_px,
               "Distance of a match from its epipolar line, pixels; larger = more tolerant.")
      .Positive()
      .Finite();
  fields
      ->Int("Pairs.num_in_sequence", &num_in_sequence,
            "Next photos by name, and by EXIF time, that each is compared with; 0 = none.")
      .NotNegative();
  fields
      ->Int("Pairs.num_by_place", &num_by_place,
            "Nearest photos by EXIF GPS that each is compared with; 0 = none.")
      .NotNegative();
  fields
      ->Int("Pairs.num_rounds", &num_rounds,
            "Rounds in which neighbours of neighbours are compared; 0 = none.")
      .NotNegative();
  fields->Bool("Pairs.join_lookalikes", &join_lookalikes,
               "Keep pairs of groups that agree on large things only, as the same furniture in two "
               "rooms does; 0 = leave them out and say so.");
  fields->Bool(
      "Pairs.only_new", &only_new,
      "Leave out pairs that the database has matched already; 0 = list those with verified "
      "matches, too (COLMAP passes over them).");
}

std::vector<std::string> PairOptions::Problems() const { return ProblemsOf(*this); }

}  // namespace roomtex
