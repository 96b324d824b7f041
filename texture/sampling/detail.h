#pragma once
// Preservation of details (thesis 8.2.3): coarse parts blended, fine parts from one photo, as in
// two-band blending (Burt and Adelson 1983, "A Multiresolution Spline with Application to Image
// Mosaics"; Brown and Lowe 2007).

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"
#include "texture/sampling/grid_links.h"

namespace roomtex {

class OptionFields;

struct DetailOptions {
  // Standard deviation of the Gaussian that parts detail from the rest, samples. Larger = coarser
  // detail is taken from the dominant photo. (The thesis names none.)
  double sigma = 2.0;
  // How often the borders between dominant photos are dilated by 3 x 3 samples: no detail there.
  // Larger = wider seams without detail. (The thesis names none.)
  int border = 2;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// Per grid cell; `photo` < 0 where no photo sees the sample.
struct DominantMap {
  std::vector<Eigen::Vector3f> color;  // C = M_S
  std::vector<int16_t> photo;          // S
  std::vector<uint8_t> fits;           // 0 = no detail from this sample
  // Share of the detail that is put in place of the blend's; it changes softly, and so borders are
  // left alone. Empty: all of it, but none at borders.
  std::vector<float> strength;
};

// Adds the detail to `blend` (M, linear light, one per grid cell):
//   M + (1 - S_t) (H(C) - H(M)), H(X) = X - X * g_sigma.
// Departure from the thesis' M + H(C) (8.5): that adds the detail to what the blend has kept of it,
// and with well registered photos this is nearly all, so that detail would come out twice as
// strong. On a blend without any detail both are the same. The convolution runs within connected
// surface only (normalised convolution, Knutsson and Westin 1993). Meshes without a grid are left
// as they are.
void PreserveDetail(const Scan& scan, const GridLinks& links, const DominantMap& dominant,
                    const DetailOptions& options, int num_threads,
                    std::vector<Eigen::Vector3f>* blend);

// S_t: 1 where the dominant photo changes to the right, left, above or below, dilated `times` times
// by 3 x 3.
std::vector<uint8_t> DominanceBorders(int num_columns, int num_rows,
                                      const std::vector<int16_t>& photo, int times);

}  // namespace roomtex
