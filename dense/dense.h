#pragma once
// Surfaces from photos where scans have none (thesis chapter 10).

#include <string>
#include <vector>

#include "core/photo.h"
#include "core/photo_fit.h"
#include "core/progress.h"
#include "core/scan.h"
#include "core/undistortion.h"
#include "dense/patch_match.h"
#include "dense/supplement.h"

namespace roomtex {

class OptionFields;

struct DenseOptions {
  PinholeOptions pinhole;
  PatchMatchOptions patch_match;
  SupplementOptions fusion;
  DenseOptions() { pinhole.max_image_size = 2000; }
  // Photos that are compared with one, or confirm or deny its depth.
  int MaxNeighbours() const;

  void Declare(OptionFields* fields);  // its own, not those of the structs in it
  std::vector<std::string> Problems() const;
};

// A registered photo, as its file is.
struct DensePhoto {
  std::string name, path;
  PhotoPixels pixels = PhotoPixels::kAsStored;
  Camera camera;
  Rigid cam_from_scan;
};

struct DenseResult {
  Supplement supplement;
  struct Photo {
    std::string name;
    int num_neighbours = 0;
    double share_open = 0;  // of the pixels: where the scan leaves anything open
    double share_new = 0;   // of the pixels: found and not in the scan
  };
  std::vector<Photo> photos;
};

// Writes into `folder` COLMAP's dense workspace (images, sparse, stereo) and supplement.ply. Memory
// is that of the scans and of some ten pictures, whatever the number of photos; the disk's is
// compared with what is free before anything is done (InputError). Photos that cannot be
// undistorted or read go to left_out. Does not depend on num_threads.
DenseResult MakeDense(const std::vector<Scan>& scans, const std::vector<DensePhoto>& photos,
                      const DenseOptions& options, const std::string& folder, uint64_t seed,
                      int num_threads, Progress* progress, std::vector<PhotoLeftOut>* left_out);

}  // namespace roomtex
