#pragma once
// What roomtex-mapper thought of the model it wrote: its report stands beside the model, so that
// what is built on a model that it refused knows of it.

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "colmap_ext/sparse_model.h"

namespace roomtex {

// In the model's folder.

struct MapperVerdict {
  bool refined = false;  // the lenses are what the mapper made of them, not what was told
  // There are models of other rooms that are alike, of the same photos.
  bool is_alike = false;
  // The mapper's reasons not to trust the model, in sentences, by what they are about.
  std::vector<std::string> calibration;  // the lenses
  std::vector<std::string> photos;       // single photos, or how many there are
  std::vector<std::string> motion;  // how the cameras moved: before a wall there are two answers
  // The model lies in the frame of the scan, by photos with known poses (KnownPlacement); metres,
  // how far these were off that as mapped.
  std::optional<double> known_rms;
  // Those of them that are in the model exactly where they are known to stand.
  std::vector<std::string> photos_held;
  // Otherwise, of photos in the model that stand at a single known place: cam_from_scan by name.
  std::vector<std::pair<std::string, Rigid>> told_poses;
};

// Of the model read from `folder`; empty if there is no report, or if it is of another model (other
// numbers of photos and points), or cannot be read.
MapperVerdict ReadMapperVerdict(const std::string& folder, const SparseModel& model);

}  // namespace roomtex
