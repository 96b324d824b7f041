#pragma once
// Colours range scans from registered photos: visibility, exposure, blend and detail (thesis
// chapter 8).

#include <string>
#include <vector>

#include "core/progress.h"
#include "core/scan.h"
#include "core/scan_mesh.h"
#include "texture/registration/register_photos.h"
#include "texture/sampling/blend.h"
#include "texture/sampling/detail.h"
#include "texture/sampling/grid_colors.h"
#include "texture/sampling/photo_list.h"
#include "texture/sampling/photo_sharpness.h"
#include "texture/sampling/photo_view.h"
#include "texture/sampling/smoothed_scan.h"
#include "texture/sampling/visibility.h"
#include "texture/texels/colored_scan.h"
#include "texture/texels/mesh_atlas.h"
#include "texture/tone/compare_photos.h"
#include "texture/tone/exposure.h"

namespace roomtex {

class OptionFields;

struct ColorizeOptions {
  ScanMeshOptions mesh;
  SmoothedScanOptions surface;
  OcclusionOptions occlusion;
  ExposureOptions exposure;
  RegistrationOptions registration;
  BlendOptions blend;
  DetailOptions detail;
  // Colour of samples that no photo sees: "intensity" (grey), "scan" (Scan::colors, where there are
  // none intensity), or "black".
  std::string unseen = "intensity";
  // Texels per sample and direction of the texture image. 1 = one texel a sample; more colour the
  // surface between the samples as well. 0 = by the photos' resolution, see ChooseTextureScale.
  int texture_scale = 1;
  // Working memory for texture images finer than the samples, megabytes (1e6 bytes); the finished
  // image adds 7 bytes a texel. Less = more passes over the photos.
  double texture_memory_mb = 2000;
  AtlasOptions atlas;  // of meshes without a grid
  // ColorizeStation() follows: the result keeps what hides.
  bool keep_occluders = false;
  size_t num_left_out_as_foreign = 0;  // photos, before: of the fifth that may be
  std::string debug_path;              // folder for debug_images.h; "" = none

  void Declare(OptionFields* fields);  // its own, not those of the structs in it
  std::vector<std::string> Problems() const;
};

struct ColorizeResult {
  std::vector<ColoredScan> scans;
  size_t num_vertices = 0, num_colored = 0;
  double views_mean = 0;      // of the coloured ones
  ExposureSolution exposure;  // gains as applied, output scale included
  Disagreement disagreement;
  std::vector<PhotoAgreement> agreement;  // per photo
  PhotoComparison comparison;
  std::vector<PhotoSharpness> sharpness;  // per photo
  Registration registration;
  std::vector<size_t> samples_seen;          // per photo
  std::vector<std::vector<size_t>> seen_of;  // per photo and scan: samples that it sees
  std::vector<PhotoView> photos;             // with the tones, poses and warps that were found
  std::vector<OccluderTiles> occluders;      // per scan; empty without keep_occluders
  // Photo pixels per sample and direction, median over the samples; 0 = not known.
  double pixels_per_sample = 0;
  int texture_scale = 1;  // in effect
};

// Photos are decoded once each, num_threads of them at a time. The result does not depend on
// num_threads. Throws UnusablePhotos (photo_pass.h).
ColorizeResult ColorizeScans(const std::vector<Scan>& scans, const std::vector<PhotoView>& photos,
                             const ColorizeOptions& options, int num_threads, Progress* progress);

// One of many stations in full, after all of them were coloured together as coarse scans (with
// keep_occluders): in the light and with the poses that were found there. Hidden it is by itself
// and by the coarse surface of the others, set back by kCoarseTolerance. station: the one scan;
// index: of its coarse scan in `coarse`, which is as it was afterwards. The result has scans[0] and
// the counts.
ColorizeResult ColorizeStation(const std::vector<Scan>& station, size_t index,
                               const ColorizeOptions& options, int num_threads, Progress* progress,
                               ColorizeResult* coarse);
// Metres: what another station alone has seen hides nothing that lies less than this behind it.
inline constexpr double kCoarseTolerance = 0.02;

// ColorizeScans with photos that cannot be used: a file that looked like a photo and is broken
// further down, a photo that contradicts the others. They go from list->photos to list->left_out,
// and all is done again without them. strict, or none left: throws.
ColorizeResult ColorizeUsable(const std::vector<Scan>& scans, ColorizeOptions options, bool strict,
                              int num_threads, Progress* progress, PhotoList* list);

}  // namespace roomtex
