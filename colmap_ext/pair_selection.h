#pragma once
// Which photos of a database can show the same? Candidates by signature (photo_signature.h), by the
// order of the photos and by what EXIF says; each looked at with few features (pair_check.h); then
// neighbours of neighbours. A spanning forest of the best pairs is looked at with many features:
// rooms with the same furniture agree on large things, not on the small ones between them, and stay
// apart. Then round after round, until one adds nothing: what connects groups, what closes loops,
// and the neighbours of that. Checks per photo are bounded, so that the cost grows with the number
// of photos.
// docs/pairs.md.

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "colmap_ext/database.h"
#include "colmap_ext/pair_options.h"
#include "core/progress.h"

namespace roomtex {

// What EXIF says of one photo.
struct PhotoHint {
  std::string date_time;
  std::optional<std::array<double, 2>> place;  // metres east and north of some origin
};

enum class PairSource {
  kDatabase,
  kSignature,
  kSequence,
  kTime,
  kPlace,
  kNeighbors,
  kBridge,
  kLoop
};
const char* PairSourceName(PairSource source);

// Photos are numbered as `photos` of the selection.
struct PairEdge {
  int photo1 = 0, photo2 = 0;  // photo1 < photo2
  PairSource source = PairSource::kSignature;
  int num_matches = 0;  // of the check; of kDatabase: verified ones
  int num_inliers = 0;
  // Several inliers agree, or the database has verified matches; else the pair is a guess for a
  // photo that has no neighbour: COLMAP decides.
  bool agrees = false;
  bool in_database = false;  // matched before, with or without success
  bool listed = false;       // worth matching
};

struct PairPhoto {
  uint32_t image_id = 0;
  std::string name;
  size_t num_features = 0;  // in the database
  int group = 0;            // photos that pairs that agree connect; 0 = the largest
  int num_pairs = 0;        // listed
};

// Two groups with pairs that agree on large things only: the same furniture in two rooms, perhaps.
struct GroupLookalike {
  int group1 = 0, group2 = 0;
  int num_pairs = 0;
};

struct PairSelection {
  std::vector<PairPhoto> photos;         // by image id
  std::vector<PairEdge> edges;           // that agree or are listed; by photo1, photo2
  std::vector<std::vector<int>> groups;  // the largest first
  std::vector<GroupLookalike> lookalikes;
  int num_checked = 0;      // pairs looked at
  int num_in_database = 0;  // pairs that were matched before
};

// hints: one per image in the order of their ids, or none at all. Features are read photo by photo;
// what stays in memory per photo is a signature, and the features of 2000 photos. Throws InputError
// for a database without two photos with features.
PairSelection SelectPairs(const Database& database, const std::vector<PhotoHint>& hints,
                          const PairOptions& options, int num_threads, uint64_t random_seed,
                          Progress* progress);

}  // namespace roomtex
