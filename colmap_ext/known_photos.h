#pragma once
// Photos whose poses were known before anything was mapped, a scanner's own (roomtex-import
// --images_path): they put the model into the frame in which they are known, `scan`.

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "colmap_ext/database.h"
#include "colmap_ext/lens_plan.h"
#include "colmap_ext/sparse_model.h"

namespace roomtex {

// By image_id of the database.
struct KnownPhotos {
  std::map<uint32_t, Rigid> cam_from_scan;
  std::map<uint32_t, Camera> cameras;  // as told; camera_id as in the model that told it
  std::vector<std::string> unmatched;  // names in that model that the database does not have
};

// The photos of `known` among those of a database: of the same name, or of the only one that ends
// with it behind a slash (copied into a folder of theirs). Throws InputError that names
// `known_path`: none is there, the size differs, two stand for the same photo, or panoramas, which
// have no picture plane.
KnownPhotos FindKnownPhotos(const std::string& known_path, const SparseModel& known,
                            const std::map<uint32_t, DatabaseImage>& images,
                            const std::map<uint32_t, Camera>& cameras);

// Gives the photos the cameras that are told of them, as calibrated ones.
void TellCameras(const KnownPhotos& known, LensPlan* plan);

// How the poses of a mapped model lie to those known.
struct KnownFit {
  enum class Kind {
    kPlaced,      // one similarity explains most of them
    kTooFew,      // fewer than two of the photos are in the model
    kOnePlace,    // they stand too near each other for the scale
    kContradicts  // no similarity explains more than half of them
  };
  Kind kind = Kind::kTooFew;
  Similarity scan_from_sparse;       // of kPlaced
  std::set<uint32_t> agreeing;       // of the photos in the model
  std::set<uint32_t> contradicting;  // kPlaced: those that stand elsewhere than is told
  double position_rms = 0;           // metres, of those agreeing, after the similarity
  double rotation_rms = 0;           // radians, likewise
  double baseline = 0;               // metres, largest distance between two of those agreeing
};
KnownFit FitToKnown(const SparseModel& model, const KnownPhotos& known);

}  // namespace roomtex
