#pragma once
// How well photos and scan intensity agree: the three measures of the thesis' Appendix A and the
// local shifts of gradient_shift.h, at the solution and at poses turned and moved away from it.
// Mutual information as a measure of registration: Viola and Wells 1997, "Alignment by Maximization
// of Mutual Information".

#include <cstdint>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "align/trust/gradient_shift.h"
#include "align/trust/perspective_views.h"
#include "align/trust/scan_view.h"
#include "colmap_ext/sparse_model.h"

namespace roomtex {

struct AgreementOptions {
  // Photos are evenly taken from all, in the order of their names: num_photos at first, up to twice
  // more such sets while there are fewer than enough_patches for gradient_shift.
  int num_photos = 8;
  int enough_patches = 400;
  int pixels_across = 320;  // Appendix A compares about this many positions per row of a photo
  // Edge of the patches of the normalised cross correlation, in such positions.
  int ncc_patch = 16;
  // Degrees by which the cameras are turned to see how fast Appendix A's measures fall.
  std::vector<double> turns_deg = {0.5, 1.0, 3.0};
  GradientShiftOptions gradient;
};

// Joint histogram of two 8-bit images, 256 x 256; its densities are smoothed by a Gaussian Parzen
// window of sigma 2 (thesis A.1.2).
class JointHistogram {
 public:
  void Add(uint8_t a, uint8_t b) { ++bins_[256 * a + b]; }
  struct Dependence {
    // Thesis (A.4)-(A.11), M_a + M_b - M_ab, in nats.
    double mutual_information = 0;
    // Thesis (A.13), (A.14): sum of (P_ab - P_a P_b)^2 / (P_a P_b). 0 = independent.
    double chi_square = 0;
  };
  // Both 0 when empty.
  Dependence Measure() const;

 private:
  std::vector<float> bins_ = std::vector<float>(256 * 256, 0.0f);
};

// Thesis A.3.2: both images (8-bit, of equal size) are cut into patches of patch x patch pixels; of
// the patches without an invalid pixel, the mean of those normalised cross correlations (A.19) that
// are positive. 0 if there are none. Flat patches have no correlation and do not count.
double PatchNcc(const cv::Mat1b& a, const cv::Mat1b& b, const cv::Mat1b& valid, int patch);

// The measures of Appendix A; means over the photos.
struct ImageMeasures {
  double mutual_information = 0, chi_square = 0, patch_ncc = 0;
};

struct Agreement {
  int num_photos = 0;
  long num_pixels = 0;  // positions that Appendix A compared
  ImageMeasures at_pose;
  struct Turned {
    double turn_deg = 0;
    ImageMeasures measures;  // mean over the photos and four directions
  };
  std::vector<Turned> turned;
  // The verdict: gradient.contradicts means that the alignment is not to be trusted.
  GradientAgreement gradient;
};

// Photos are read one by one (a few side by side); those that cannot be read or have another size
// than their camera are named in `warnings` and left out.
Agreement MeasureAgreement(const AlignedPhotos& aligned, const ScanViewer& viewer,
                           const AgreementOptions& options, int num_threads,
                           std::vector<std::string>* warnings);

}  // namespace roomtex
