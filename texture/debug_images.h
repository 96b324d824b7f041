#pragma once
// Pictures of what colouring saw and decided, for people who wonder about a colour.

#include <string>
#include <vector>

#include "core/progress.h"
#include "core/scan.h"
#include "texture/sampling/grid_colors.h"
#include "texture/sampling/photo_view.h"

namespace roomtex {

struct DebugInput {
  const std::vector<Scan>& scans;
  const std::vector<PhotoView>& photos;
  const PhotoPassInput& scene;              // occluders and samples
  const std::vector<GridOfSamples>& grids;  // one per scan
  const ObservationStore& store;
  const std::vector<Eigen::Vector3f>& gains;
  const OcclusionOptions& occlusion;
  const BlendOptions& blend;
};

// Writes per photo its depth map, its depth boundaries, how it sees the scan and what it gives to
// it; per scan which photo dominates, how many see a sample and how far they disagree; and
// README.txt with the legend. Scans without a grid have the photos' own pictures only. Makes the
// folder. Throws InputError if something cannot be written.
void WriteDebugImages(const std::string& folder, const DebugInput& input, int num_threads,
                      Progress* progress);

// Colours that are easily told apart, one per photo, b, g, r.
cv::Vec3b ColorOfPhoto(int photo);

}  // namespace roomtex
