#pragma once
// What the readers of meshes and clouds (PLY, OBJ, PCD ...) have in common.

#include <string>

#include "core/scan.h"

namespace roomtex {

// Colours that come one after the other without saying their scale: 0 to 1, 0 to 255 or 0 to 65535,
// the smallest that holds all.
class ColorScale {
 public:
  // largest: 1, 255 or 65535, of the scale that it is at least.
  explicit ColorScale(double largest) : largest_(largest) {}

  // rgb as bytes (black where it is none). before: those of earlier calls, which change when rgb
  // shows that the scale is a larger one.
  std::array<uint8_t, 3> Bytes(const Eigen::Vector3d& rgb, CellColors* before);

 private:
  double largest_;
};

// Grey of a colour in the unit of its channels (Rec. ITU-R BT.601).
inline double GreyOf(const Eigen::Vector3d& rgb) {
  return rgb.dot(Eigen::Vector3d(0.299, 0.587, 0.114));
}

// Makes the vertices and triangles that were read a scan without a grid: points that are not finite
// or farther from the station than max_range (metres; 0 = no limit) are missing, and triangles at
// them go. points and intensity (and colors, if there are any) have one value per vertex. Throws
// InputError if no triangle is left.
void FinishMesh(const std::string& path, double max_range, Scan* scan);

// Metres from the origin along an axis: nothing that was measured lies beyond, in whatever unit and
// coordinate system. What fits into 64 bits of micrometres ends there, too.
inline constexpr double kFarthest = 1e12;
// Points beyond kFarthest become missing, with the triangles at them, and those of a cloud go. How
// many there were.
size_t LeaveOutFar(Scan* scan);

// The viewpoint of a mesh whose file does not say where it was scanned from: the middle of it,
// unless the file's origin lies well within, as where a scanning app was started.
void FindViewpoint(Scan* mesh);

// Makes the points that were read a cloud (Scan::Kind): those that are not finite or too far away
// go, with their intensities, colours and normals. Throws InputError if none is left.
void FinishCloud(const std::string& path, double max_range, Scan* scan);

}  // namespace roomtex
