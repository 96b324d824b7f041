#pragma once
// What is told to roomtex-align.

#include <string>
#include <vector>

#include "align/alignment.h"
#include "align/photo_alignment.h"
#include "core/surfels.h"
#include "importers/scan_reader.h"
#include "importers/scan_record.h"

namespace roomtex {

class Command;

struct AlignCommandOptions {
  // Sparse models; input_path: the first, or the one that is aligned now; "" = there is none.
  std::vector<std::string> input_paths;
  std::string input_path, picks_path, output_path, image_path, database_path, scan_poses;
  std::string panoramas_path;
  std::string geo_origin;
  std::vector<std::string> scan_paths;
  std::string near;
  ScanReaderOptions scan_reader;
  ScanBound bound;
  AlignmentOptions alignment;
  PhotoCameraOptions camera;
  ScanPlaneOptions planes;
  std::string planes_path, refine_intrinsics = "auto";
  int overlays = 0;
  bool register_stations = false;
  bool strict = false;
};

void AddOptions(AlignCommandOptions* a, Command* command);

// Sets input_path. Throws UsageError, InputError: what contradicts, is missing, or cannot be read
// or written.
void CheckOptions(AlignCommandOptions* a);
// Throws UsageError. A model that lies in the scan's frame already needs neither.
void RequirePicksOrPhotos(const AlignCommandOptions& a);

}  // namespace roomtex
