#include "texture/texels/texture_scale.h"

#include <algorithm>
#include <cmath>

#include "core/statistics.h"
#include "texture/texels/texel_pass.h"

namespace roomtex {

double MedianPixelsPerSample(const PhotoPassInput& input, const ObservationStore& store,
                             const std::vector<PhotoView>& photos) {
  if (!(input.angular_spacing > 0)) return 0;
  const size_t stride = std::max<size_t>(1, store.num_samples() / 50000);
  std::vector<float> pixels;
  for (const SampleTile& tile : input.samples) {
    if (!tile.scanner.allFinite()) continue;
    for (int i = 0; i < tile.points.size(); ++i) {
      const size_t slot = static_cast<size_t>(tile.first_slot) + i;
      if (slot % stride != 0 || store.Count(slot) == 0) continue;
      const PhotoView& photo = photos[store.Begin(slot)->photo];
      const Eigen::Vector3f point(tile.points.x[i], tile.points.y[i], tile.points.z[i]);
      const Eigen::Vector3d in_cam =
          photo.cam_from_scan * (tile.points.origin + point.cast<double>());
      const double depth = photo.camera.IsPerspective() ? in_cam.z() : in_cam.norm();
      const double spacing = input.angular_spacing * (tile.scanner - point).norm();
      if (depth > 0) {
        pixels.push_back(static_cast<float>(spacing * photo.camera.MeanFocalLength() / depth));
      }
    }
  }
  return Median(&pixels);
}

int ChooseTextureScale(const std::vector<Scan>& scans, double pixels_per_sample,
                       const BlendOptions& blend, double max_bytes) {
  double cells = 0;
  for (const Scan& scan : scans) {
    if (scan.organised) cells += static_cast<double>(scan.points.size());
  }
  if (!(cells > 0)) return 1;
  const double most_texels =
      std::min(kMaxAutoTexels, kMaxAutoBands * max_bytes / BytesPerTexel(blend));
  const double bound = std::min<double>(kMaxAutoScale, std::floor(std::sqrt(most_texels / cells)));
  return static_cast<int>(
      std::clamp(std::ceil(pixels_per_sample - 1e-9), 1.0, std::max(1.0, bound)));
}

}  // namespace roomtex
