#pragma once
// How well photos and scan intensity agree: mutual information (thesis Appendix A.1) at the
// solution, and at poses turned away from it.

#include <string>
#include <vector>

#include <Eigen/Core>

#include "align/free_space.h"
#include "colmap_ext/sparse_model.h"

namespace roomtex {

struct AgreementOptions {
  int max_photos = 8;       // evenly taken from all, in the order of their names
  int pixels_across = 240;  // the photo is sampled at this many positions per row
  // Degrees by which the cameras are turned to see how fast the agreement falls.
  std::vector<double> turns_deg = {0.5, 1.0, 3.0};
};

// Joint histogram of two 8-bit images, 256 x 256.
class JointHistogram {
 public:
  void Add(uint8_t a, uint8_t b) { ++bins_[256 * a + b]; }
  // Thesis (A.4)-(A.11): the histogram smoothed by a Gaussian Parzen window of sigma 2, then
  // M_a + M_b - M_ab, in nats. 0 when empty.
  double MutualInformation() const;

 private:
  std::vector<float> bins_ = std::vector<float>(256 * 256, 0.0f);
};

struct Agreement {
  int num_photos = 0;
  long num_pixels = 0;
  double mutual_information = 0;  // mean over the photos
  struct Turned {
    double turn_deg = 0;
    double mutual_information = 0;  // mean over the photos and four directions
  };
  std::vector<Turned> turned;
};

// aligned: model in the scan frame. image_path: folder of the photos. Photos that cannot be read or
// have another size than their camera are named in `warnings` and left out.
Agreement MeasureAgreement(const SparseModel& aligned, const std::string& image_path,
                           const FreeSpace& free_space, const AgreementOptions& options,
                           int num_threads, std::vector<std::string>* warnings);

}  // namespace roomtex
