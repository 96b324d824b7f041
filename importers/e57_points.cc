#include "importers/e57_points.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/scan.h"
#include "core/text.h"
#include "importers/mesh_scan.h"

namespace roomtex {
namespace {

Eigen::Vector3d PointOfAngles(double range, double azimuth, double elevation) {
  const double horizontal = range * std::cos(elevation);
  return {horizontal * std::cos(azimuth), horizontal * std::sin(azimuth),
          range * std::sin(elevation)};
}

}  // namespace

bool IsStructured(const E57Scan& scan) {
  return scan.points.Find("rowIndex") >= 0 && scan.points.Find("columnIndex") >= 0;
}

E57PointReader::E57PointReader(const E57Pages& pages, const E57Scan& scan, bool with_colors)
    : pages_(pages), scan_(scan) {
  WantCoordinates();
  WantIntensity();
  if (with_colors || intensity_slot_ == kNone) WantColors();
  if (IsStructured(scan)) {
    row_ = Want("rowIndex");
    column_ = Want("columnIndex");
    return_ = Want("returnIndex");
  } else {
    const char* const kNormals[] = {"nor:normalX", "nor:normalY", "nor:normalZ"};
    for (int i = 0; i < 3; ++i) normals_[i] = Want(kNormals[i]);
    if (normals_[0] == kNone || normals_[1] == kNone) normals_[2] = kNone;
  }
  records_.emplace(pages, scan.points, wanted_);
}

// The slot of the field, kNone if the records do not have it.
int E57PointReader::Want(const std::string& name) {
  const int field = scan_.points.Find(name);
  if (field < 0 ||
      scan_.points.fields[static_cast<size_t>(field)].type == E57Field::Type::kString) {
    return kNone;
  }
  wanted_.push_back(field);
  return static_cast<int>(wanted_.size()) - 1;
}

void E57PointReader::WantCoordinates() {
  const char* const kCartesian[] = {"cartesianX", "cartesianY", "cartesianZ"};
  const char* const kSpherical[] = {"sphericalRange", "sphericalAzimuth", "sphericalElevation"};
  for (const bool spherical : {false, true}) {
    wanted_.clear();
    const char* const* names = spherical ? kSpherical : kCartesian;
    for (int i = 0; i < 3; ++i) coordinates_[i] = Want(names[i]);
    if (wanted_.size() < 3) continue;
    spherical_ = spherical;
    state_ = Want(spherical ? "sphericalInvalidState" : "cartesianInvalidState");
    return;
  }
  throw InputError(pages_.path(), pages_.Position(scan_.points.section),
                   "the points of the scan " + Quoted(scan_.name) +
                       " have neither cartesianX, Y, Z nor sphericalRange, Azimuth, Elevation",
                   "Export the scan again with its coordinates");
}

void E57PointReader::WantIntensity() {
  intensity_slot_ = Want("intensity");
  if (intensity_slot_ == kNone) return;
  intensity_scaling_ = ScalingOf(intensity_slot_, scan_.intensity_limits);
  intensity_state_ = Want("isIntensityInvalid");
}

void E57PointReader::WantColors() {
  const char* const kColors[] = {"colorRed", "colorGreen", "colorBlue"};
  for (int i = 0; i < 3; ++i) {
    colors_[i] = Want(kColors[i]);
    if (colors_[i] == kNone) {
      colors_[2] = kNone;
      return;
    }
    color_scaling_[i] = ScalingOf(colors_[i], scan_.color_limits[i]);
  }
  color_state_ = Want("isColorInvalid");
}

// 0 to 1 by the limits of the scan, else by those of an integer field, else nothing changes.
E57PointReader::Scaling E57PointReader::ScalingOf(int slot,
                                                  const std::optional<E57Limits>& limits) const {
  if (limits) return {limits->minimum, 1 / (limits->maximum - limits->minimum)};
  const E57Field& field =
      scan_.points.fields[static_cast<size_t>(wanted_[static_cast<size_t>(slot)])];
  if (!field.has_range || field.minimum >= field.maximum) return {};
  const double low = static_cast<double>(field.minimum) * field.scale + field.offset;
  const double high = static_cast<double>(field.maximum) * field.scale + field.offset;
  return low < high ? Scaling{low, 1 / (high - low)} : Scaling{};
}

int64_t E57PointReader::Next() {
  const int64_t count = records_->Next();
  points_.resize(static_cast<size_t>(count));
  intensity_.resize(static_cast<size_t>(count));
  TakePoints(count);
  TakeIntensities(count);
  return count;
}

void E57PointReader::TakePoints(int64_t count) {
  if (count == 0) return;
  const double* const a = Values(coordinates_[0]);
  const double* const b = Values(coordinates_[1]);
  const double* const c = Values(coordinates_[2]);
  const double* const state = state_ != kNone ? Values(state_) : nullptr;
  for (int64_t i = 0; i < count; ++i) {
    const Eigen::Vector3d point =
        spherical_ ? PointOfAngles(a[i], b[i], c[i]) : Eigen::Vector3d(a[i], b[i], c[i]);
    const bool measured = (state == nullptr || state[i] == 0) && std::isfinite(point.sum()) &&
                          (spherical_ ? a[i] > 0 : row_ == kNone || !point.isZero(0));
    points_[static_cast<size_t>(i)] = measured ? point : Scan::MissingPoint();
  }
}

void E57PointReader::TakeIntensities(int64_t count) {
  if (count == 0) return;
  std::fill(intensity_.begin(), intensity_.end(), 0.0f);
  if (intensity_slot_ != kNone) {
    const double* const values = Values(intensity_slot_);
    for (int64_t i = 0; i < count; ++i) {
      intensity_[static_cast<size_t>(i)] =
          static_cast<float>((values[i] - intensity_scaling_.offset) * intensity_scaling_.factor);
    }
  } else if (HasColors()) {
    for (int64_t i = 0; i < count; ++i) {
      intensity_[static_cast<size_t>(i)] = static_cast<float>(GreyOf(Color(i)));
    }
  }
  const double* const state = intensity_state_ != kNone ? Values(intensity_state_) : nullptr;
  for (int64_t i = 0; i < count; ++i) {
    float& intensity = intensity_[static_cast<size_t>(i)];
    if ((state != nullptr && state[i] != 0) || !std::isfinite(intensity)) intensity = 0;
  }
}

Eigen::Vector3d E57PointReader::Color(int64_t i) const {
  if (color_state_ != kNone && Values(color_state_)[i] != 0) return Eigen::Vector3d::Zero();
  Eigen::Vector3d color;
  for (int k = 0; k < 3; ++k) {
    color[k] = (Values(colors_[k])[i] - color_scaling_[k].offset) * color_scaling_[k].factor;
  }
  return color;
}

}  // namespace roomtex
