#include "importers/scan_finish.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "core/error.h"
#include "core/input_guard.h"
#include "core/text.h"
#include "importers/cloud_grid.h"
#include "importers/doubtful_unit.h"
#include "importers/length_unit.h"
#include "importers/mesh_scan.h"
#include "importers/up_axis.h"

namespace roomtex {
namespace {

std::string NameOrFile(const Scan& scan) {
  return scan.name.empty() ? "the file" : "the scan " + Quoted(scan.name);
}

void TakeUpAxis(const ScanReaderOptions& options, Scan* scan) {
  if (options.up_axis == "auto") return;
  scan->up = UpAxisOf(options.up_axis);
  scan->up_is_assumed = false;
}

// A cell of a grid holds one point, though a cloud can have several there (further returns).
std::string WhatTheGridLacks(const Scan& cloud, const Scan& grid) {
  const auto measured = [](const Scan& scan) {
    return static_cast<long>(scan.points.size()) - scan.NumMissing();
  };
  const long num_lost = measured(cloud) - measured(grid);
  if (num_lost == 0) return "";
  return "; " + std::to_string(num_lost) +
         (num_lost == 1 ? " point shares its place there with another one and is"
                        : " points share their places there with others and are") +
         " left out";
}

void FindGridAgain(Scan* scan, std::vector<std::string>* notes) {
  const Eigen::Quaterniond station_from_scan = scan->scan_from_station.rotation.conjugate();
  std::vector<Eigen::Vector3d> axes = {Eigen::Vector3d::UnitZ()};  // of the station
  const Eigen::Vector3d up = station_from_scan * scan->up;
  if (!up.isApprox(axes[0], 1e-6)) axes.push_back(up);
  if (scan->up_is_assumed) axes.push_back(station_from_scan * Eigen::Vector3d::UnitY());
  std::optional<Scan> grid;
  for (size_t i = 0; i < axes.size() && !grid; ++i) {
    grid = GridFromCloud(*scan, axes[i]);
    if (grid && scan->up_is_assumed) grid->up = scan->scan_from_station.rotation * axes[i];
  }
  if (!grid) return;
  notes->push_back(NameOrFile(*scan) +
                   " is a cloud without a grid; its angles from the station show one of " +
                   std::to_string(grid->num_columns) + " columns x " +
                   std::to_string(grid->num_rows) + " rows" + WhatTheGridLacks(*scan, *grid));
  *scan = std::move(*grid);
}

void FindUpAxisAgain(Scan* scan, std::vector<std::string>* notes) {
  if (!scan->up_is_assumed) return;
  // A grid was found about the axis that is up.
  if (!scan->organised) scan->up = FindUpAxis(*scan);
  const std::string axis = NameOfUpAxis(scan->up);
  if (axis == "z" || axis.empty()) return;
  scan->up_is_assumed = false;
  notes->push_back("the file does not say which way is up; its " +
                   std::string(scan->organised ? "grid" : "surface") + " shows that " + axis +
                   " is (--up_axis says another)");
}

// Formats that do not say their unit, and scans that are hardly in metres. Whether it noted any.
bool NoteDoubtfulUnit(const ScanReaderOptions& options, const Scan& scan, ScanFile* file) {
  const bool is_silent = file->format == "PLY" || file->format == "OBJ" || file->format == "PCD" ||
                         file->format == "PTX" || file->format == "XYZ" || file->format == "LAS";
  if (!is_silent || file->unit_is_said || !options.units.empty()) return false;
  const std::string unit = LikelierUnit(scan);
  if (unit.empty()) return false;
  const Bounds bounds = FindBounds(scan);
  const Eigen::Vector3d size = bounds.max - bounds.min;
  const auto text = [&size](double factor) {
    std::string sizes;
    for (int k = 0; k < 3; ++k) {
      const double length = size[k] * factor;
      sizes += (k > 0 ? " x " : "") + Number(length, length < 100 ? 1 : 0);
    }
    return sizes + " m";
  };
  file->notes.push_back("the file does not say its unit; in metres it is " + text(1) +
                        " large. If these are " + unit + " (" + text(*MetersPerUnit(unit)) +
                        "), give --units " + unit);
  return true;
}

// Rec. 709, of sRGB values as they are; GreyOf (mesh_scan.h), of colours without an intensity
// beside them, is Rec. 601. Both stay: a scan that is read again has the intensity that it was
// aligned by.
float LumaOf(const std::array<uint8_t, 3>& color) {
  return 0.2126f * color[0] + 0.7152f * color[1] + 0.0722f * color[2];
}

// A scanner's camera has not seen what is black.
void TakeColorsAsIntensity(Scan* scan, std::vector<std::string>* notes) {
  size_t num_measured = 0, num_colored = 0;
  for (size_t i = 0; i < scan->colors.size(); ++i) {
    if (scan->IsMissing(static_cast<int>(i))) continue;
    ++num_measured;
    num_colored += LumaOf(scan->colors[i]) > 0;
  }
  constexpr double kMostSamples = 0.8;
  if (num_measured > 0 && num_colored >= kMostSamples * num_measured) {
    for (size_t i = 0; i < scan->colors.size(); ++i) {
      if (!scan->IsMissing(static_cast<int>(i))) scan->intensity[i] = LumaOf(scan->colors[i]);
    }
    notes->push_back(NameOrFile(*scan) +
                     " has colours of its own: these, not its intensity, are compared with photos");
  }
  CellColors().swap(scan->colors);
}

// What is no place of anything that was measured would make boxes, grids and files of all the rest.
void LeaveOutFarPlaces(Scan* scan, std::vector<std::string>* notes) {
  const std::string beyond = " beyond " + Significant(kFarthest, 3) + " m";
  const bool is_near = scan->scan_from_station.translation.cwiseAbs().maxCoeff() <= kFarthest;
  const size_t count = is_near ? LeaveOutFar(scan) : 0;
  if (!is_near || scan->NumMissing() == static_cast<int>(scan->points.size())) {
    throw InputError(scan->path, "",
                     is_near ? "holds no point but those" + beyond
                             : "has its scanner" + beyond + " from the origin",
                     "The file is damaged: export it again");
  }
  if (count == 0) return;
  notes->push_back(NameOrFile(*scan) + " has " + std::to_string(count) +
                   (count == 1 ? " point" : " points") + beyond +
                   ", which are no places: left out");
}

// Between the single floats that lie about a number.
double StepOfSingles(double number) {
  const auto single = static_cast<float>(std::abs(number));
  return std::nextafter(single, std::numeric_limits<float>::infinity()) - single;
}

// Whether coordinates along an axis are single floats: all are, and many are odd multiples of their
// step. Those of a raster, with few decimals, are even ones where the step is finer.
bool AreSingles(const std::vector<double>& values) {
  constexpr double kLeastOdd = 0.2;  // share; half of what was rounded to them
  size_t num_odd = 0;
  for (const double value : values) {
    if (static_cast<double>(static_cast<float>(value)) != value) return false;
    num_odd += std::fmod(std::abs(value) / StepOfSingles(value), 2) == 1;
  }
  return static_cast<double>(num_odd) >= kLeastOdd * static_cast<double>(values.size());
}

// Single floats far from the origin step by more than a scanner errs, and nothing shows it but the
// points of a wall that stand on a few planes.
void NoteCoarseCoordinates(const Scan& scan, std::vector<std::string>* notes) {
  constexpr double kFar = 1 << 14;    // metres, where single floats step by 2 mm
  constexpr size_t kLookedAt = 1000;  // points
  const size_t every = scan.points.size() / kLookedAt + 1;
  double farthest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    double largest = 0;
    for (size_t i = 0; i < scan.points.size(); i += every) {
      if (scan.IsMissing(static_cast<int>(i))) continue;
      values.push_back(scan.points[i][axis]);
      largest = std::max(largest, std::abs(values.back()));
    }
    if (largest < kFar) continue;
    if (!AreSingles(values)) return;
    farthest = std::max(farthest, largest);
  }
  if (farthest < kFar) return;
  notes->push_back(NameOrFile(scan) + " has coordinates of single precision, " +
                   Number(farthest, 0) + " m from the origin: there they step by " +
                   Millimetres(1000 * StepOfSingles(farthest)) +
                   ". Export it with doubles, or moved to near the origin");
}

// Of a grid in coordinates of a country whose file leaves the scanner at 0 0 0: how its samples are
// connected, and what hides what, is seen from there.
void NoteFarStation(const Scan& scan, std::vector<std::string>* notes) {
  constexpr double kLeast = 1000;   // metres, beyond which no scanner measures what fills a grid
  constexpr double kMostSizes = 5;  // of the scan
  const Bounds bounds = FindBounds(scan);
  const Eigen::Vector3d nearest = scan.Station().cwiseMax(bounds.min).cwiseMin(bounds.max);
  const double distance = (scan.Station() - nearest).norm();
  const double size = (bounds.max - bounds.min).norm();
  if (distance < std::max(kLeast, kMostSizes * size)) return;
  notes->push_back(NameOrFile(scan) + " has its scanner " + Number(distance, 0) +
                   " m from its points: surfaces, as seen from there, come out wrong. Export it "
                   "with the scanner's place, or in the scanner's own coordinates");
}

}  // namespace

void FinishScan(const ScanReaderOptions& options, ScanFile* file, Scan* scan) {
  NoteInput(scan->path, "the scan");
  LeaveOutFarPlaces(scan, &file->notes);
  TakeUpAxis(options, scan);
  if (scan->kind() == Scan::Kind::kCloud) FindGridAgain(scan, &file->notes);
  if (scan->kind() == Scan::Kind::kMesh && scan->station_is_assumed) FindViewpoint(scan);
  FindUpAxisAgain(scan, &file->notes);
  if (file->up_axis.empty()) file->up_axis = NameOfUpAxis(scan->up);
  if (!NoteDoubtfulUnit(options, *scan, file)) {
    NoteCoarseCoordinates(*scan, &file->notes);
    if (scan->kind() == Scan::Kind::kGrid) NoteFarStation(*scan, &file->notes);
  }
  if (options.colors_as_intensity) TakeColorsAsIntensity(scan, &file->notes);
}

}  // namespace roomtex
