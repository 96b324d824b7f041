#pragma once
// Several stations see what one of them alone does not: the space that is unseen lies in the shadow
// of all (free space as in Curless and Levoy 1996, "A Volumetric Method for Building Complex Models
// from Range Images"). Its border is made of the parts of each station's shadows that lie in those
// of all others.

#include <vector>

#include <Eigen/Core>

#include "core/scan.h"
#include "texture/sampling/mesh_tiles.h"

namespace roomtex {

// How far a scanner looked, by direction: in cells of twice its spacing, the nearest range of each.
class LookedPast {
 public:
  // scan: a grid around scan.Station(). angular_spacing: radians between neighbouring samples,
  // above 0. range_noise: metres, standard deviation.
  LookedPast(const Scan& scan, double angular_spacing, double range_noise);

  // Whether the scanner saw something behind x in all directions near it, and so nothing at x.
  // False where it measured nothing.
  bool operator()(const Eigen::Vector3d& x_in_scan) const;

 private:
  int CellOf(int row, double azimuth, int step) const;

  Eigen::Vector3d station_;
  double cell_, tolerance_;
  std::vector<int> first_;      // cell of every row, from the pole at +z down; one more
  std::vector<float> nearest_;  // metres; 0 = nothing measured there
};

// Shadows and fringes of several stations.
class ShadowsOfStations {
 public:
  // Takes them out of `tiles`, which were made of `grid`. As LookedPast.
  void Take(const Scan& grid, double angular_spacing, double range_noise, OccluderTiles* tiles);
  // Adds to `tiles` what no other station looked past; of one station all of it, as it was.
  void Give(OccluderTiles* tiles, int num_threads);

 private:
  struct Station {
    LookedPast looked_past;
    std::vector<MeshTile> shadows, fringes;
  };
  class Cutter;
  std::vector<Station> stations_;
};

}  // namespace roomtex
