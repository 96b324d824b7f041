#pragma once
// What roomtex-outline writes and reads: buildings as footprints with roofs, in a file that a hand
// can edit (docs/outline.md).

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/report.h"
#include "core/similarity.h"
#include "importers/geo_frame.h"

namespace roomtex {

// A plane of a roof: at `point` it is so high, and falls by slope_deg towards downhill_deg, counted
// from the x axis counter-clockwise (x = east: 0 = east, 90 = north).
struct RoofPlane {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  double slope_deg = 0, downhill_deg = 0;

  // Rise of the height per metre of x and y.
  Eigen::Vector2d Gradient() const;
  double HeightAt(const Eigen::Vector2d& x) const {
    return point.z() + Gradient().dot(x - point.head<2>());
  }
  static RoofPlane FromGradient(const Eigen::Vector3d& point, const Eigen::Vector2d& gradient);
};

// In the frame `outline`: z up, metres if known.
struct OutlineBuilding {
  std::string name;
  double ground = 0;                       // height of the floor
  std::vector<Eigen::Vector2d> footprint;  // counter-clockwise, simple, the first not repeated
  std::vector<RoofPlane> roof;             // its surface is the lowest of them everywhere

  double RoofHeightAt(const Eigen::Vector2d& x) const;
  // "flat", "shed", "gable" or "planes".
  std::string RoofShape() const;
  // What keeps it from being a solid: a footprint that crosses itself, a roof below the floor ...
  std::vector<std::string> Problems() const;
};

// What the aligned model that the points are from says of itself: the buildings are worth no more.
struct OutlineAlignment {
  bool trusted = true;
  std::string reason;          // why not
  bool north_assumed = false;  // on the Earth, but nobody has said which way it is turned there
};

struct Outline {
  // Frame of the buildings. `input` is the frame of the points (a model's: `sparse` or `scan`).
  Similarity outline_from_input;
  bool metric = false;          // lengths are metres, else units of the input
  std::optional<GeoFrame> geo;  // the frame is `enu` about this place
  std::vector<OutlineBuilding> buildings;
  std::optional<OutlineAlignment> alignment;  // none: of no model of roomtex-align

  const char* Unit() const { return metric ? "metres" : "units of the input"; }
};

// Throws InputError with the place in the file: not JSON, another kind of file, a number that is
// none, a building that is no solid.
Outline ReadOutline(const std::string& path, std::vector<std::string>* left_out = nullptr);
// From a JSON text that is named `path` in messages. left_out: buildings that are no solids, or
// have the name of another one, are left out and their sentences added to it; null = they throw.
Outline ParseOutline(const std::string& path, const Json& json,
                     std::vector<std::string>* left_out = nullptr);
Json OutlineToJson(const Outline& outline);
// With its numbers as the file holds them.
OutlineBuilding AsWritten(OutlineBuilding building);

// Gives an outline that has no place on the Earth this one: the frame `input` is east-north-up
// about it, as --geo_origin says, and the buildings move into that. Throws UsageError, which names
// `path`, for lengths that are no metres, a frame that does not stand upright, and a place that
// contradicts the outline's own.
void PlaceOnEarth(const GeoPosition& origin, const std::string& path, Outline* outline);
// Floors, footprints and roofs go along with the corners they stand at; walls stay upright.
void MoveBuildings(const Similarity& target_from_outline, std::vector<OutlineBuilding>* buildings);

// proposed: nobody has changed it yet. The file then holds a seal, so that it is known later
// whether a hand or the page did (WasEdited).
void WriteOutline(const std::string& path, const Outline& outline, bool proposed);
// The file is there and not as WriteOutline(proposed) wrote it: somebody's work. A file that is no
// outline at all is somebody's work, too.
bool WasEdited(const std::string& path);
// The same buildings in the same place. Throws InputError as ReadOutline() does.
bool HoldsSameOutline(const std::string& path, const Outline& outline);

}  // namespace roomtex
