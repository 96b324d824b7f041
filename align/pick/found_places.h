#pragma once
// Where the search of roomtex-align has put the photos, for a look while no picks place them.

#include <map>
#include <memory>
#include <string>

#include "align/pick/pick_scene.h"
#include "core/camera_model.h"
#include "core/report.h"

namespace roomtex {

struct FoundPlaces {
  struct Photo {
    Rigid cam_from_scan;
    std::shared_ptr<const CameraProjection> projection;  // the alignment may adjust the lens
  };
  std::map<std::string, Photo> photos;  // by name; those that were left out are not there
  bool trusted = false;
  // The photo in which one pick would decide; "" = nothing is undecided, or one is not enough.
  std::string confirm_in;
};

// Whether a run read the scans the other way round than they are shown.
bool IsMirroredReading(const Json& report, const PickScene& scene);

// Of a run's report, and of the model beside it. Null: it did not search, it found nothing, or it
// read the scans the other way round. Throws InputError for a model that cannot be read.
std::shared_ptr<const FoundPlaces> ReadFoundPlaces(const std::string& aligned_path,
                                                   const Json& report, const PickScene& scene);

}  // namespace roomtex
