#pragma once
// Vignetting and response curve from what photos that see the same samples say differently (Goldman
// and Chen 2005, "Vignette and Exposure Calibration and Compensation"). What such photos leave open
// is a power of the curve (Grossberg and Nayar 2003, "Determining the Camera Response from Images:
// What Is Knowable?").

#include <string>
#include <vector>

#include "core/photo.h"
#include "texture/sampling/photo_tone.h"
#include "texture/tone/exposure_samples.h"

namespace roomtex {

// All photos show the same light at a sample once they are corrected:
//     log light + log gain of the photo + vignetting(radius)
// is linear in what is not known. So is a response curve over the level u (0..1) in the form
//     log light + b0 log srgb(u) + b1 log u + b2 (u - 1) + b3 (u^2 - 1) + ...
// Least squares with Cauchy weights over all samples; the light of each sample is eliminated.

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
