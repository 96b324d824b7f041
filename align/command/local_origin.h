#pragma once
// Scans in UTM or ECEF lie millions of metres from their origin, where a turn moves everything by
// far more than it turns: fits lose their footing. They are aligned about a near origin instead,
// and what comes out is moved back.

#include <vector>

#include <Eigen/Core>

#include "align/clicks/picks.h"
#include "align/search/search_hint.h"
#include "colmap_ext/sparse_model.h"
#include "core/report.h"
#include "core/scan.h"

namespace roomtex {

class LocalOrigin {
 public:
  // The origin stays where it is if the scans lie near it.
  explicit LocalOrigin(const std::vector<Scan>& scans);

  // `scan`, whole metres.
  const Eigen::Vector3d& offset() const { return offset_; }

  // From the scan frame to the near one, and back.
  void MoveToLocal(std::vector<Scan>* scans) const { Move(-offset_, scans); }
  void MoveBack(std::vector<Scan>* scans) const { Move(offset_, scans); }
  void MoveToLocal(std::vector<Pick>* picks) const;
  void MoveToLocal(std::vector<NearHint>* hints) const;
  void MoveBack(SparseModel* model) const;
  Similarity MovedBack(Similarity local_from_sparse) const;
  // Similarities, planes and places of the report.
  void MoveBack(Json* report) const;

 private:
  static void Move(const Eigen::Vector3d& by, std::vector<Scan>* scans);

  Eigen::Vector3d offset_ = Eigen::Vector3d::Zero();
};

}  // namespace roomtex
