#pragma once
// The points that buildings are found in: those of a sparse model, or of a scan file (a dense
// cloud), with what is known of up, of scale and of the place on the Earth.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "building/outline.h"
#include "importers/scan_reader.h"

namespace roomtex {

class OptionFields;

struct OutlineInputOptions {
  std::string input_path;   // a model's folder, or a scan file
  std::string sparse_path;  // for a scan file: the model that its points belong to
  std::string up;           // "x,y,z" in the frame of the input; "" = found
  double scale = 0;         // metres per unit of the input; 0 = as far as it is known
  // "LATITUDE,LONGITUDE,HEIGHT": the input's frame is east-north-up about this place.
  std::string geo_origin;
  ScanReaderOptions reader;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
  std::optional<GeoPosition> GeoOrigin() const;  // none for "" and what is no place
};

struct OutlineCloud {
  using Color = std::array<uint8_t, 3>;
  std::vector<Eigen::Vector3d> points;  // `input` as read; `outline` after MoveTo
  std::vector<Eigen::Vector3d> eyes;    // of each point: from where it was seen; NaN = not known
  std::vector<Color> colors;            // of each point; empty = none
  std::vector<Eigen::Vector3d> cameras;
  double num_read = 0;  // points of the input, before they were thinned out

  double spacing = 0;  // median distance from a point to its sixth neighbour
  double noise = 0;    // of a point across the surface it lies on: a low quantile over the cloud
  double step = 0;     // the length that sizes hang on: 1.5 metres, less of small things

  // Up in the frame of `points`; how far it may be believed.
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  enum class UpSource { kGiven, kEarth, kCameras, kFile } up_source = UpSource::kFile;
  Outline frame;  // its buildings are empty

  void MoveTo(const Similarity& target_from_here);
};

// Reads the points; those of a dense cloud are thinned to at most kMaxOutlinePoints by averaging in
// cubes. Throws InputError, UsageError.
inline constexpr size_t kMaxOutlinePoints = 150000;
OutlineCloud ReadOutlineCloud(const OutlineInputOptions& options, int num_threads);

// The medians of the coordinates. points must not be empty.
Eigen::Vector3d MiddleOf(const std::vector<Eigen::Vector3d>& points);

// step, spacing and noise from the points; for clouds that were made, not read.
void MeasureCloud(bool metric, int num_threads, OutlineCloud* cloud);

}  // namespace roomtex
