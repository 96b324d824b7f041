#pragma once
// Records of an E57 file as points: coordinates, intensity, place in the grid.

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "importers/e57_document.h"
#include "importers/e57_records.h"

namespace roomtex {

// The records say row and column.
bool IsStructured(const E57Scan& scan);

class E57PointReader {
 public:
  // Both must outlive this. Throws InputError for records without coordinates.
  E57PointReader(const E57Pages& pages, const E57Scan& scan, bool with_colors = false);

  // Reads the next points, 0 at the end.
  int64_t Next();
  // In the frame of the scan, NaN = not measured: its state says so, or, with row and column, it
  // lies in the scanner itself (how older programs mark it).
  const Eigen::Vector3d& Point(int64_t i) const { return points_[static_cast<size_t>(i)]; }
  float Intensity(int64_t i) const { return intensity_[static_cast<size_t>(i)]; }
  // From 0 to 1 by the limits that the file gives; black where its state says that it is none.
  bool HasColors() const { return colors_[2] != kNone; }
  Eigen::Vector3d Color(int64_t i) const;
  // By the extension nor, in the frame of the scan.
  bool HasNormals() const { return normals_[2] != kNone; }
  Eigen::Vector3d Normal(int64_t i) const {
    return {Values(normals_[0])[i], Values(normals_[1])[i], Values(normals_[2])[i]};
  }
  // Of structured scans.
  double Row(int64_t i) const { return Values(row_)[i]; }
  double Column(int64_t i) const { return Values(column_)[i]; }
  bool HasReturns() const { return return_ >= 0; }
  // 0 = the first return of the pulse.
  double Return(int64_t i) const { return Values(return_)[i]; }

  int64_t num_records() const { return records_->num_records(); }

 private:
  static constexpr int kNone = -1;
  // Raw values become (value - offset) * factor.
  struct Scaling {
    double offset = 0, factor = 1;
  };

  const double* Values(int slot) const { return records_->Values(static_cast<size_t>(slot)); }
  int Want(const std::string& name);
  void WantCoordinates();
  void WantIntensity();
  void WantColors();
  Scaling ScalingOf(int slot, const std::optional<E57Limits>& limits) const;
  void TakePoints(int64_t count);
  void TakeIntensities(int64_t count);

  const E57Pages& pages_;
  const E57Scan& scan_;
  std::vector<int> wanted_;  // fields of the record; "slots" are places in here
  std::optional<E57Records> records_;
  bool spherical_ = false;
  int coordinates_[3] = {kNone, kNone, kNone}, state_ = kNone;
  int row_ = kNone, column_ = kNone, return_ = kNone;
  int intensity_slot_ = kNone, intensity_state_ = kNone;
  int colors_[3] = {kNone, kNone, kNone}, color_state_ = kNone;
  int normals_[3] = {kNone, kNone, kNone};  // of clouds
  Scaling intensity_scaling_, color_scaling_[3];
  std::vector<Eigen::Vector3d> points_;
  std::vector<float> intensity_;
};

}  // namespace roomtex
