#pragma once
// What a user may say of the choice of pairs (pair_selection.h).

#include <string>
#include <vector>

#include "colmap_ext/pair_check.h"

namespace roomtex {

class OptionFields;

// Defaults: docs/pairs.md, "Measured".
struct PairOptions {
  int num_features = 768;   // of the largest scale, that a check compares
  int num_candidates = 24;  // by signature, per photo
  int num_in_sequence = 2;  // next photos by name, and by EXIF time
  int num_by_place = 6;     // nearest by EXIF GPS
  int max_neighbors = 20;   // pairs that a photo asks for
  int num_rounds = 3;       // neighbours of neighbours; 0 = none
  int min_num_inliers = 12;
  PairCheckOptions check;
  bool only_new = false;
  bool join_lookalikes = false;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

}  // namespace roomtex
