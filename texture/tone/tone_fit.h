#pragma once
// Vignetting and response curve from what photos that see the same samples say differently.

#include <string>
#include <vector>

#include "core/photo.h"
#include "texture/sampling/photo_tone.h"
#include "texture/tone/exposure_samples.h"

namespace roomtex {

// The logarithm of the light at a sample is the same in all photos once corrected: log light + log
// gain of the photo + vignetting(radius) is linear in what is not known, so is a response curve
// given as log light + b0 log srgb(u) + b1 log u + b2 (u - 1) + b3 (u^2 - 1) + ... over the level
// u, 0..1. Least squares with Cauchy weights over all samples; the light of each sample is
// eliminated.

// lens: number of the lens per photo, 0 .. num_lenses - 1. log_gains: start values per photo. A
// lens whose views do not show it (too few, or less than 1 % in the corners) gets none.
std::vector<Vignetting> FitVignetting(const ExposureSamples& samples, const std::vector<int>& lens,
                                      int num_lenses, const std::vector<double>& log_gains);

struct ResponseFit {
  ResponseCurve curve;  // sRGB if not determined
  bool determined = false;
  std::string reason;  // why not, a phrase
};

// exposures: EXIF; it has to vary by an EV among photos that overlap, because a curve raised to a
// power and gains raised to it explain the photos as well.
ResponseFit FitResponse(const ExposureSamples& samples, const std::vector<ExposureData>& exposures);

// The samples as the curve and the vignetting have them.
void ApplyResponse(const ResponseCurve& curve, ExposureSamples* samples);
void ApplyVignetting(const std::vector<Vignetting>& of_lens, const std::vector<int>& lens,
                     ExposureSamples* samples);

}  // namespace roomtex
