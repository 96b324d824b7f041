#pragma once
// All scans as one surface to shoot rays at, at full resolution. Frame: `scan`.

#include <optional>
#include <vector>

#include "core/ray_caster.h"
#include "core/scan.h"

namespace roomtex {

class ScanRays {
 public:
  explicit ScanRays(const std::vector<Scan>& scans);

  const RayCaster& caster() const { return *caster_; }
  // Index of the scan that a triangle of caster() belongs to.
  int ScanOf(int triangle) const;
  // Something lies before `to`, seen from `from`, by more than range noise.
  bool IsHidden(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const;

 private:
  std::vector<int> first_triangle_;  // one per scan
  std::optional<RayCaster> caster_;
};

}  // namespace roomtex
