#pragma once
// What EXIF says about the photos' exposures, how far that can be trusted, and which photos are
// tied to each other at all.

#include <array>
#include <optional>
#include <vector>

#include "core/photo.h"
#include "texture/tone/exposure.h"

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

// What ties the photos' exposures together.
struct ExposureTies {
  ExposurePrior prior;
  std::vector<int> overlap_groups, groups;  // by overlaps alone, with EXIF
};
// Also fills in what the solution says about them.
ExposureTies TieExposures(const std::vector<ExposureData>& exposures,
                          const std::vector<Overlap>& overlaps, const ExposureOptions& options,
                          ExposureSolution* solution);
// Gains of log gains per channel and photo: the photo of median exposure gets 1, in the largest
// group and in every group that nothing ties to it.
void FinishGains(const ExposureTies& ties, const std::array<std::vector<double>, 3>& log_gains,
                 ExposureSolution* solution);

double Median(std::vector<double> values);  // 0 for none; the upper one of two

}  // namespace roomtex
