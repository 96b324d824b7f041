#pragma once
// The surface between the samples, for texture images finer than the scan's grid.

#include <vector>

#include <Eigen/Core>

#include "core/scan.h"
#include "texture/sampling/smoothed_scan.h"
#include "texture/texels/texel_pass.h"

namespace roomtex {

// scale x scale texels per sample of a scan with a grid; texel (c, r) lies at the sample
// coordinates ((c + 0.5) / scale - 0.5, (r + 0.5) / scale - 0.5). Bilinear between four connected
// samples; where they are not connected, the surface goes on straight to half way between them.
class ScanTexels : public TexelSource {
 public:
  // Scan, surface and colors must outlive this. colors: of the samples; a texel that no photo sees
  // takes its sample's.
  ScanTexels(const Scan& scan, const SmoothedScan& surface, const ColorGrid& colors, int scale)
      : scan_(scan), surface_(surface), colors_(colors), scale_(scale) {}

  int num_columns() const override { return scan_.num_columns * scale_; }
  int num_rows() const override { return scan_.num_rows * scale_; }
  double texels_per_sample() const override { return scale_; }
  Eigen::Vector3d station() const override { return scan_.Station(); }
  TexelBlock Rows(int first, int end) const override;

 private:
  struct Place;
  Place PlaceOf(int texel) const;
  int Neighbour(int index, int step_columns, int step_rows) const;
  void SetTexel(size_t texel, const Place& x, const Place& y, TexelBlock* block) const;

  const Scan& scan_;
  const SmoothedScan& surface_;
  const ColorGrid& colors_;
  int scale_;
};

}  // namespace roomtex
