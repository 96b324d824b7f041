#pragma once
// How far sparse model and scan disagree in shape, room over: what no similarity takes away, and
// what keypoint noise does not explain. A bent model, a drifting scan and a wrong lens show here.

#include <cstdint>
#include <map>
#include <vector>

#include "align/fit/scan_bend.h"
#include "align/fit/similarity_fit.h"
#include "align/surface/scan_patches.h"
#include "colmap_ext/sparse_model.h"
#include "core/similarity.h"

namespace roomtex {

struct PhotoDisagreement {
  double shift = 0;     // metres: by how much what the photo sees is off, root mean square
  double rotation = 0;  // radians: the same seen from the photo
};

// Metres; model and scan that differ by less (ShapeDisagreement::rms) leave nothing to mend.
inline constexpr double kSameShape = 0.01;

struct ShapeDisagreement {
  double rms = 0;  // metres, over the surface that the sparse points lie on
  int num_cells = 0;
  std::map<uint32_t, PhotoDisagreement> photos;  // by image_id; none for one that sees no surface
};

// The residual field: per half-metre cell of the surface the median distance of its points from it,
// less what their noise explains. Only what is across the surface shows; the same is assumed along
// it, twice, so that lengths are sqrt(3) times the distances. bend: of the scan (scan_bend.h), as
// far as it is believed; scan_from_sparse then leads to the room as it is.
ShapeDisagreement FindDisagreement(const SparseModel& model,
                                   const std::vector<SurfacePoint>& points,
                                   const ScanPatches& surface, const Similarity& scan_from_sparse,
                                   const ScanBend& bend);

}  // namespace roomtex
