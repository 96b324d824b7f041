#pragma once
// The one pass over the photos: every photo is decoded once and says what it sees of the samples.

#include <utility>
#include <vector>

#include "core/error.h"
#include "core/photo_fit.h"
#include "core/progress.h"
#include "texture/sampling/blend.h"
#include "texture/sampling/mesh_tiles.h"
#include "texture/sampling/observations.h"
#include "texture/sampling/photo_sharpness.h"
#include "texture/sampling/photo_view.h"
#include "texture/sampling/visibility.h"

namespace roomtex {

struct PhotoPassInput {
  std::vector<OccluderTiles> occluders;  // of all scans
  std::vector<SampleTile> samples;       // of all scans; first_slot numbers them through
  std::vector<size_t> grid_ends;         // the tiles of each grid (AddGrid) end here
  double angular_spacing = 0;            // of the finest scan, radians; 0 = not known
};

// Photos that turned out to be unreadable when they were decoded (all were tried), or that
// contradict the others (tone/compare_photos.h).
class UnusablePhotos : public InputError {
 public:
  explicit UnusablePhotos(std::vector<PhotoLeftOut> photos)
      : InputError(photos[0].name, "", "cannot be used: " + AsClause(photos[0].reason), ""),
        photos_(std::move(photos)) {}
  const std::vector<PhotoLeftOut>& photos() const { return photos_; }

 private:
  std::vector<PhotoLeftOut> photos_;
};

// They show something else than the others.
class ForeignPhotos : public UnusablePhotos {
 public:
  using UnusablePhotos::UnusablePhotos;
};

// Adds every photo's observations to the store. Returns how many samples each photo sees of each
// grid. probes: null, or what CompareSharpness() asks for, per photo. Throws UnusablePhotos; the
// store is then of no use.
std::vector<std::vector<size_t>> ObservePhotos(
    const PhotoPassInput& input, const std::vector<PhotoView>& photos,
    const OcclusionOptions& occlusion, const BlendOptions& blend, int num_threads,
    Progress* progress, ObservationStore* store,
    std::vector<std::vector<SharpnessProbe>>* probes = nullptr);

}  // namespace roomtex
