#pragma once
// A mapped model put where its known photos stand.

#include <set>
#include <string>

#include "colmap_ext/known_photos.h"
#include "colmap_ext/mapper_run.h"
#include "core/report.h"

namespace roomtex {

struct KnownPlacement {
  KnownFit fit;  // as the photos were mapped, before any pose was held
  // The known poses stay as told, and all else is adjusted to them. False though placed: the model
  // was only moved, because the keypoints do not bear the poses out.
  bool held = false;
  std::set<uint32_t> rough;  // of held ones: whose poses are not exact enough, and were adjusted
  // Keypoint noise (KeypointNoise) of the model as mapped, and with the known poses held, pixels.
  double free_px = 0, held_px = 0;
  std::set<uint32_t> added;  // photos that nothing but their known pose registered
};

// cameras: of the plan that the model was mapped with. Of kPlaced the model is moved into the frame
// of the known poses and stands in `folder`; else it stays.
KnownPlacement PlaceByKnownPhotos(const KnownPhotos& known,
                                  const std::map<uint32_t, DatabaseImage>& images,
                                  const std::map<uint32_t, Camera>& cameras,
                                  const std::string& folder, MapperRun* mapper,
                                  MapperResult* result);

// The report's `known`. names: of the database.
Json KnownToJson(const KnownPlacement& placement, const KnownPhotos& known,
                 const std::map<uint32_t, DatabaseImage>& images);

}  // namespace roomtex
