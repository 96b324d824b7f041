#pragma once
// Buildings as closed solids: footprints extruded to their roofs (thesis 9.3, steps 5 and 6), with
// the semantic surfaces of CityGML at level of detail 2.

#include <utility>
#include <vector>

#include <Eigen/Core>

#include "building/outline.h"
#include "core/scan.h"

namespace roomtex {

struct SolidFace {
  enum class Kind { kGround, kRoof, kWall };
  Kind kind = Kind::kWall;
  std::vector<int> corners;  // counter-clockwise seen from outside; planar, no holes
};

// Every edge belongs to two faces, once in each direction.
struct BuildingSolid {
  std::vector<Eigen::Vector3d> vertices;  // `outline`
  std::vector<SolidFace> faces;

  double Volume() const;
  // Of the roof's lowest and highest corner: eaves and ridge.
  std::pair<double, double> RoofHeights() const;
  std::vector<Eigen::Vector3d> CornersOf(const SolidFace& face) const;
};

// building must have no Problems().
BuildingSolid ExtrudeBuilding(const OutlineBuilding& building);

// The face as triangles of the solid's vertices, turned like the face.
std::vector<Triangle> TrianglesOf(const BuildingSolid& solid, const SolidFace& face);

}  // namespace roomtex
