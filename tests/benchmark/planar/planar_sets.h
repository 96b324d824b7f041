#pragma once
// The simulated sets of the benchmark: what lies before the cameras, how well its keypoints and
// matches are, and a name that brings any one of them back.

#include <string>
#include <vector>

#include "tests/colmap_ext/simulated_views.h"

namespace roomtex {

struct PlanarSet {
  enum class Kind {
    kGrid,           // overlapping views in a row, as SimulateViews makes them
    kWeakTriples,    // eight views along a wall, few points seen three times
    kTurnOnly,       // the camera only turns
    kGhost,          // kWeakTriples, one view with keypoints of another place
    kShiftedPair,    // repeated texture, one pair matched one period off
    kWrongLens,      // eight views; the lens has a distortion that the database does not tell
    kNeighborsOnly,  // twelve views, no point matched in more than one pair
  };
  Kind kind = Kind::kGrid;
  SimulatedViewsOptions::Scene scene = SimulatedViewsOptions::Scene::kWall;
  double relief = 0;  // kRelief: share of the distance
  double field_of_view_deg = 58;
  double noise_px = 0.5;
  double outlier_share = 0.1;
  int num_views = 4;
  enum class Matches { kFew, kMany, kPhotos };  // about 60-150, 350 and 1000 for neighbours
  Matches matches = Matches::kMany;

  // "relief 3 %, 28 deg, 1 px, 30 % outliers, 4 views, few"
  std::string Name() const;
};

// One row of the in-process table: scene, lens and noise, with every combination of outliers (0,
// 10, 30 %), views (3, 4, 8) and matches (few, many) as its cells.
struct GridRow {
  std::string name;
  std::vector<PlanarSet> cells;
};
std::vector<GridRow> GridRows();

// Rows of the tables that run programs.
std::vector<PlanarSet> MapperRows();
std::vector<PlanarSet> SequenceRows();
std::vector<PlanarSet> AdversarialRows();

// seed: 0 to 199. Sets of different names are independent of each other.
SimulatedViews MakeSet(const PlanarSet& set, int seed);
// The set of that name, from any of the tables; throws std::runtime_error if there is none.
PlanarSet FindSet(const std::string& name);

// The number of the ghost view of a kGhost set.
inline constexpr uint32_t kGhostId = 8;

}  // namespace roomtex
