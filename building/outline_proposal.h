#pragma once
// Buildings proposed from points, and how far each of them is to be believed.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "building/outline.h"
#include "building/outline_cloud.h"
#include "building/plane_segments.h"

namespace roomtex {

class OptionFields;

struct ProposalOptions {
  std::string area;          // "x0,y0,x1,y1" of the outline frame: points outside are left out
  double min_area = 0;       // of a footprint; 0 = 4 steps^2 (9 square metres)
  bool right_angles = true;  // walls that may be parallel or at right angles are

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
  std::optional<std::array<double, 4>> Area() const;
};

// How the cloud came to stand upright.
struct UpFinding {
  Eigen::Vector3d up_in_input = Eigen::Vector3d::UnitZ();
  std::string source;     // "given", "geographic", "cameras", "file" or "planes"
  double spread_deg = 0;  // of the walls found from the vertical, root mean square
  int num_walls = 0;      // that say so
  bool trusted = true;
};

// Finds up by walls and ground near the one that the cloud has (not when it is given, nor on the
// Earth) and turns cloud and segments so that it is z.
UpFinding Level(OutlineCloud* cloud, std::vector<PlaneSegment>* segments);

// Turns, moves and scales cloud and segments into the frame that an outline's buildings are in.
void AdoptFrame(const Outline& outline, OutlineCloud* cloud, std::vector<PlaneSegment>* segments);

// What the points say of one building; lengths in units of the outline.
struct BuildingEvidence {
  struct Wall {
    double length = 0;
    double covered = 0;  // share of the length that points lie on
    int num_points = 0;
    double rms = 0;                            // of the points across the wall
    double sigma_offset = 0, sigma_angle = 0;  // standard deviations; offset at `middle`
    double middle = 0;                         // of the points, from the first corner
  };
  std::vector<Wall> walls;                  // wall i goes from corner i to the next
  std::vector<double> corner_sigma;         // standard deviation of each corner's position
  double ground_sigma = 0, roof_sigma = 0;  // of the heights
  int num_ground_points = 0, num_roof_points = 0;
  double roof_rms = 0;
  double roof_covered = 0;          // share of the footprint with points of the roof
  double explained = 0;             // share of the points within and above that lie on the solid
  int num_points = 0;               // within the footprint and above the ground
  std::vector<std::string> doubts;  // empty: to be trusted
};

struct OutlineProposal {
  Outline outline;
  std::vector<BuildingEvidence> evidence;  // one per building
  double explained = 0;  // share of the points above the ground that lie on a building
};

// cloud: level (z up). segments: of it.
OutlineProposal ProposeOutline(const OutlineCloud& cloud, const std::vector<PlaneSegment>& segments,
                               const ProposalOptions& options);

// The same measures for buildings that a person drew or changed, in the frame of the cloud
// (AdoptFrame).
OutlineProposal JudgeOutline(const OutlineCloud& cloud, const std::vector<PlaneSegment>& segments,
                             const Outline& outline);

// Floor and roof heights of a footprint from the points (flat, shed, gable ...). None if the points
// tell no roof.
std::optional<OutlineBuilding> HeightsFromPoints(const OutlineCloud& cloud,
                                                 const std::vector<PlaneSegment>& segments,
                                                 const OutlineBuilding& building);

// The lines that walls draw in the top view, for contours to snap to: ends of each stretch.
std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> WallStretches(
    const OutlineCloud& cloud, const std::vector<PlaneSegment>& segments);

// The ground: a plane for all, and how far points lie from it.
struct GroundPlane {
  Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
  double height = 0;  // at the origin
  bool found = false;
  double HeightAt(const Eigen::Vector2d& x) const { return height + gradient.dot(x); }
};
GroundPlane FindGround(const OutlineCloud& cloud, const std::vector<PlaneSegment>& segments);

}  // namespace roomtex
