#pragma once
// The scan as small flat patches: a point's nearest patch gives the distance to the surface, with
// the range noise averaged out. Graphics calls such patches surfels (Pfister et al. 2000, "Surfels:
// Surface Elements as Rendering Primitives"); the normal is that of PCA (Hoppe et al. 1992), the
// tree a k-d tree (Bentley 1975).

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"

namespace roomtex {

class OptionFields;

struct ScanPatch {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();   // centre of gravity of its samples, `scan`
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // unit length, towards the scanner
  double thickness = 0;  // RMS distance of its samples from its plane, metres
  int num_samples = 0;
};

// Calls `visit` with points of the scan's surface: every measured sample of a grid; of a mesh
// without a grid, points all over its triangles, at most `spacing` metres apart.
void VisitSurface(const Scan& scan, double spacing,
                  const std::function<void(const Eigen::Vector3d& x_in_scan)>& visit);

struct ScanPatchOptions {
  // Metres; edge of the cubes whose samples make one patch. Larger for scans that are so coarse or
  // noisy that most samples would lie in none.
  double cell_size = 0.06;
  int min_samples = 6;  // a cube with fewer samples makes no patch
  // A cube makes a patch only if its samples are flat: thickness below this share of their second
  // extent.
  double max_thickness_share = 0.25;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// The flat patches of one or more scans, in a k-d tree.
class ScanPatches {
 public:
  ScanPatches(const std::vector<Scan>& scans, const ScanPatchOptions& options);

  const std::vector<ScanPatch>& patches() const { return patches_; }
  double cell_size() const { return cell_size_; }  // metres; no less than the options'
  // Median thickness of the patches: the noise of the scan, metres; 0 without patches.
  double TypicalThickness() const;

  struct Nearest {
    int patch = -1;
    double distance = 0;  // along the normal, metres, positive on the scanner's side
  };
  // The patch whose centre is nearest, no farther than max_distance; none if there is none.
  std::optional<Nearest> FindNearest(const Eigen::Vector3d& x_in_scan, double max_distance) const;

 private:
  struct Node {
    int begin = 0, end = 0;  // range of patches_
    int axis = -1;           // -1 = leaf
    double split = 0;
    int left = -1, right = -1;
  };
  int BuildTree(int begin, int end);
  void Search(int node, const Eigen::Vector3d& x, double* best2, int* best) const;

  std::vector<ScanPatch> patches_;  // in the order of the tree's leaves
  std::vector<Node> nodes_;
  double cell_size_;
};

}  // namespace roomtex
