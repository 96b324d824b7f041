#include "align/command/local_origin.h"

#include "core/text.h"

namespace roomtex {
namespace {

// Metres. Farther away, steps and limits of many fits are those of the distance, not of the room.
constexpr double kFar = 50;

}  // namespace

LocalOrigin::LocalOrigin(const std::vector<Scan>& scans) {
  Bounds all;
  for (const Scan& scan : scans) {
    const Bounds bounds = FindBounds(scan);
    all.min = all.min.cwiseMin(bounds.min);
    all.max = all.max.cwiseMax(bounds.max);
  }
  const Eigen::Vector3d middle = 0.5 * (all.min + all.max);
  if (middle.allFinite() && middle.norm() > kFar) offset_ = middle.array().round();
}

void LocalOrigin::Move(const Eigen::Vector3d& by, std::vector<Scan>* scans) {
  if (by.isZero()) return;
  for (Scan& scan : *scans) {
    for (Eigen::Vector3d& point : scan.points) point += by;
    scan.scan_from_station.translation += by;
  }
}

void LocalOrigin::MoveToLocal(std::vector<Pick>* picks) const {
  for (Pick& pick : *picks) pick.x_in_scan -= offset_;
}

void LocalOrigin::MoveToLocal(std::vector<NearHint>* hints) const {
  for (NearHint& hint : *hints) hint.x_in_scan -= offset_;
}

void LocalOrigin::MoveBack(SparseModel* model) const {
  if (offset_.isZero()) return;
  Similarity scan_from_local;
  scan_from_local.translation = offset_;
  TransformModel(scan_from_local, model);
}

Similarity LocalOrigin::MovedBack(Similarity local_from_sparse) const {
  local_from_sparse.translation += offset_;
  return local_from_sparse;
}

void LocalOrigin::MoveBack(Json* report) const {
  if (offset_.isZero() || (!report->is_object() && !report->is_array())) return;
  const auto move = [this](Json* place) {
    if (!place->is_array() || place->size() != 3) return;
    for (int k = 0; k < 3; ++k) (*place)[k] = (*place)[k].get<double>() + offset_[k];
  };
  for (const auto& [key, value] : report->items()) {
    const bool is_similarity = BeginsWith(key, "scan_from_sparse") && value.is_object();
    if (is_similarity && value.contains("translation")) {
      move(&value["translation"]);
    } else if (key == "point" || key == "far_corner" || key == "photos_middle") {
      move(&value);
    } else if (key != "options" && key != "inputs") {
      MoveBack(&value);
    }
  }
}

}  // namespace roomtex
