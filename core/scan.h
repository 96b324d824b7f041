#pragma once
// The range scan: measured 3D points with intensity, organised in the grid in which the scanner
// took them (thesis 5.1.1), or a plain triangle mesh, or points, without a grid.

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/similarity.h"

namespace roomtex {

// Indices into Scan::points, counter-clockwise seen from the front.
using Triangle = std::array<int, 3>;

// Red, green and blue, sRGB.
using CellColors = std::vector<std::array<uint8_t, 3>>;

struct Scan {
  std::string path;  // the file it came from, for messages and reports
  std::string name;  // of the station, "" if the file gives none

  // A grid, a triangle mesh or points alone.
  enum class Kind { kGrid, kMesh, kCloud };
  Kind kind() const {
    return organised ? Kind::kGrid : triangles.empty() ? Kind::kCloud : Kind::kMesh;
  }

  // The grid. Sample (column, row) has the index row * num_columns + column; row 0 is the TOP row
  // (largest elevation), columns keep the order of the file. A mesh without a grid is not
  // organised: num_columns == points.size(), num_rows == 1.
  bool organised = true;
  int num_columns = 0;
  int num_rows = 0;

  // One per grid cell. A missing sample is NaN in all three coordinates.
  std::vector<Eigen::Vector3d> points;  // `scan` frame
  // One per grid cell, in the unit of the file (RTPI: integers; PTX: 0..1). Missing samples: 0.
  std::vector<float> intensity;

  // The file's own colours, one per cell, where they were asked for and the file has some.
  CellColors colors;
  // Of a cloud whose file says them: unit normals of the surface, outwards; zero = none.
  std::vector<Eigen::Vector3f> normals;

  // Triangles of a mesh without a grid. Empty when organised: see scan_mesh.h.
  std::vector<Triangle> triangles;

  // Where the scanner stood. The origin of `station` is the point that all ranges start from.
  Rigid scan_from_station;
  bool station_is_assumed = false;  // the file does not say it: `station` is the frame of the file
  // `station`: from where the surface shows its front. The scanner's place, unless that is assumed
  // and cannot be it.
  Eigen::Vector3d viewpoint = Eigen::Vector3d::Zero();
  // Unit vector of the scan frame that points up (RTPI: y; PTX: z).
  Eigen::Vector3d up = Eigen::Vector3d::UnitY();
  bool up_is_assumed = false;  // the file does not say it
  bool is_rtpi = false;
  // Without a grid: what the file has as points but are none, too far or withheld; not in `points`.
  int64_t num_left_out = 0;
  // Among the scans of its file, from 1; those that are left out because they are empty count.
  int number_in_file = 1;

  int Index(int column, int row) const { return row * num_columns + column; }
  bool IsMissing(int index) const { return !(points[index].x() == points[index].x()); }
  Eigen::Vector3d Station() const { return scan_from_station * viewpoint; }
  int NumMissing() const;

  static Eigen::Vector3d MissingPoint() {
    return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  }
};

// How messages call scans[index]: by its path, and of a file with several among these by FILE#k, as
// --scan_poses takes it.
std::string ScanName(const std::vector<Scan>& scans, size_t index);

// Called for every scan of a file as soon as it is read, the last one of `of_file`. Those there may
// be changed before the next one is read, so that not all have to be held in full.
using ScanVisitor = std::function<void(std::vector<Scan>* of_file)>;

// Every stride-th column and row of a grid, from the first on; every stride^2-th point of a cloud;
// a mesh as it is. Thinned by 2 twice is thinned by 4.
Scan Thinned(const Scan& scan, int stride);

// Smallest axis-aligned box around the measured points; min > max when there are none.
struct Bounds {
  Eigen::Vector3d min = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d max = Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity());
};
Bounds FindBounds(const Scan& scan);

// Metres from the origin from which on files have double coordinates: up to there a float is exact
// to 0.06 mm.
inline constexpr double kLargeCoordinate = 1000;
// Whether the scan measured a point beyond it.
bool NeedsDouble(const Scan& scan);

// Where a point (`scan`) is if the scan is read with the other sense of its azimuths: across the
// station's plane of y and z.
Eigen::Vector3d MirroredAt(const Rigid& scan_from_station, const Eigen::Vector3d& x_in_scan);

// What of the intensities becomes black and what white.
struct GreyScale {
  float low = 0, high = 1;
  uint8_t operator()(float intensity) const;
};
// By percentiles of the intensities, which must be finite; of none of them: 0 to 1.
GreyScale FindGreyScale(std::vector<float> intensities, double low_percentile = 1.0,
                        double high_percentile = 99.0);

// Intensities as grey values 0..255 in grid order: the given percentiles of the measured samples
// become black and white. Missing samples: 0.
std::vector<uint8_t> IntensityAsGrey(const Scan& scan, double low_percentile = 1.0,
                                     double high_percentile = 99.0);

}  // namespace roomtex
