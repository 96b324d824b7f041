#include "texture/unify_exposure.h"

#include "core/photo.h"

namespace roomtex {

ExposureSolution UnifyExposure(const std::vector<SampleTile>& tiles,
                               const std::vector<PhotoView>& photos, const ExposureOptions& options,
                               int num_threads, ObservationStore* store) {
  (void)tiles;
  (void)num_threads;
  std::vector<ExposureData> exposures;
  for (const PhotoView& photo : photos) exposures.push_back(ReadExposureData(photo.path));
  if (options.mode == "none") return SolveExposure(exposures, {}, options);
  const ExposureSamples samples = SelectSamples(*store, static_cast<int>(photos.size()));
  ExposureSolution solution = SolveExposure(exposures, FindOverlaps(samples), options);
  const float scale = OutputScale(*store, solution.gains);
  for (Eigen::Vector3f& gain : solution.gains) gain *= scale;
  return solution;
}

}  // namespace roomtex
