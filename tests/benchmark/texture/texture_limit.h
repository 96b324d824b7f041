#pragma once
// The least that colouring a scan from photos takes: decode every photo once, draw the mesh into a
// depth map of 1024 pixels, look every visible sample up once and add it up. No exposure, no
// boundaries, no weights, no choice of the best photos, no noise: a yardstick, not a method.

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"
#include "texture/sampling/photo_view.h"

namespace roomtex {

struct TextureLimit {
  double decode_seconds = 0, draw_seconds = 0, sample_seconds = 0;  // CPU, one thread
  size_t num_triangles = 0;  // in the tiles that photos may see, summed over the photos
  size_t num_samples = 0;    // looked up, summed over the photos
  size_t num_seen = 0;       // samples that some photo sees
  std::vector<Eigen::Vector3f> mean_light;  // per grid cell; zero = not seen

  double Seconds() const { return decode_seconds + draw_seconds + sample_seconds; }
};

TextureLimit MeasureTextureLimit(const Scan& scan, const std::vector<PhotoView>& photos);

}  // namespace roomtex
