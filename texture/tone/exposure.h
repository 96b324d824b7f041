#pragma once
// Exposure unification (thesis 8.2.1): one factor per photo (and channel), in linear light. From
// what photos see in common: gain compensation (Brown and Lowe 2007, "Automatic Panoramic Image
// Stitching Using Invariant Features"), here robust and with EXIF as a prior.

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/photo.h"
#include "texture/sampling/observations.h"
#include "texture/sampling/photo_tone.h"
#include "texture/tone/exposure_overlaps.h"
#include "texture/tone/exposure_samples.h"

namespace roomtex {

class OptionFields;

struct ExposureOptions {
  // "exif": the ratio of shutter time * ISO / aperture^2 (thesis 8.2.1); photos without EXIF are
  // matched. "match": least squares over what several photos see, with EXIF as a prior where there
  // is any: cameras keep the exposure they note down to about a tenth only, and some programs drop
  // it. "none": photos are used as they are.
  std::string mode = "match";
  // Match red, green and blue on their own: for photos whose white balance changed. On, because it
  // takes 7 % off the disagreement of real photos and leaves simulated ones as they are.
  bool white_balance = true;
  // Find the light that the lens loses towards the corners, one even polynomial per camera.
  bool vignetting = false;
  // How bytes become light: "srgb", a file (ResponseCurve::Read), or "estimate": from the overlaps
  // of photos whose exposure differs.
  std::string response = "srgb";
  // A folder with a bracket, photos of one still scene exposed differently, to find the response
  // from; "" = none.
  std::string bracket_path;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

struct ExposureSolution {
  std::vector<Eigen::Vector3f> gains;  // per photo: r, g, b factors in linear light
  int reference_photo = -1;            // gain 1 before `output_scale`; the photo of median exposure
  // Photos outside the largest group that chains of overlaps hold together: those that EXIF ties to
  // it, and those that nothing does; the median gain of the latter is that of the rest.
  std::vector<int> by_exif, unconnected;
  std::vector<int> contradicted;  // photos whose EXIF the overlaps contradict by half an EV
  bool exif_ignored = false;      // EXIF as a whole contradicts the overlaps and was left out
  // How each photo's bytes become light; none = sRGB without vignetting.
  std::vector<std::shared_ptr<const PhotoTone>> tones;
  std::string response = "srgb";  // or "file", "bracket", "estimate": where it comes from
  std::string response_problem;  // why it could not be estimated; "" = it was, or was not asked for
  int without_exif = 0;          // in mode "exif": photos that had to be matched
  // Scatter of EXIF about the overlaps (robust standard deviation of the log); none without enough
  // of both.
  std::optional<double> exif_scatter;
};

// exposures: EXIF per photo. Photos are numbered as in the overlaps.
ExposureSolution SolveExposure(const std::vector<ExposureData>& exposures,
                               const std::vector<Overlap>& overlaps,
                               const ExposureOptions& options);

// Factor <= 1 for the whole result so that at most one sample in a hundred is lighter than 1 (but
// never below 1/2): the overall brightness is that of the reference photo, unless this would blow
// out lights.
float OutputScale(const ObservationStore& store, const std::vector<Eigen::Vector3f>& gains);

// Mean absolute colour difference between the photos that give the same sample its colour
// (NumThatCount), 0-255 in sRGB.
struct Disagreement {
  double before = 0, after = 0;  // with gains of 1, with the given gains
  double at_random = 0;          // after, between photos at two samples that have nothing in common
  size_t num_pairs = 0;
};
Disagreement MeasureDisagreement(const ObservationStore& store,
                                 const std::vector<Eigen::Vector3f>& gains);
// The same of one sample, with the given gains: mean over all pairs of the observations that count
// and over the channels. NaN with fewer than two.
float SampleDisagreement(const Observation* observations, int count,
                         const std::vector<Eigen::Vector3f>& gains);

}  // namespace roomtex
