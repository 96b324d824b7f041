#pragma once
// What EXIF says about the photos' exposures, how far that can be trusted, and which photos are
// tied to each other at all.

#include <optional>
#include <vector>

#include "core/photo.h"
#include "texture/tone/exposure_overlaps.h"

namespace roomtex {

// Logarithms of gains that undo the exposure in EXIF. Only photos of one kind compare: of one
// camera, with the same fields filled in (a lens without contacts notes no aperture).
struct ExposurePrior {
  std::vector<std::optional<double>> log_gain;  // per photo
  std::vector<int> kind;                        // per photo; -1 without EXIF
  int num_kinds = 0;
  // Standard deviation of the log that EXIF is trusted to. A camera's nominal exposure is true to
  // about a tenth.
  double sigma = 0.1;

  void Forget();  // as if there were no EXIF
};
// one_kind: every photo compares with every other.
ExposurePrior PriorFromExif(const std::vector<ExposureData>& exposures, bool one_kind);

// Robust standard deviation of EXIF about log gains that come from overlaps alone, whose groups
// float freely. None for fewer than five photos in groups of at least three.
std::optional<double> ExifScatter(const ExposurePrior& prior, const std::vector<int>& groups,
                                  const std::vector<double>& log_gains);

// Numbers of groups, per photo, that chains of overlaps hold together; with a prior, EXIF ties all
// photos that have it.
std::vector<int> GroupPhotos(int num_photos, const std::vector<Overlap>& overlaps,
                             const ExposurePrior* prior);
// The number of the largest group; of equals the one of the earliest photo.
int LargestGroup(const std::vector<int>& groups);

}  // namespace roomtex
