#pragma once
// Brings photos to agree on the surface that they see: first by their poses, then by a smooth warp
// each, alternating with the colours (the idea of Zhou and Koltun 2014, with patches in place of
// single pixels and all photos solved for at once).

#include <vector>

#include <Eigen/Core>

#include "texture/registration/photo_registrar.h"
#include "texture/registration/registration_options.h"
#include "texture/registration/registration_trial.h"
#include "texture/sampling/grid_colors.h"
#include "texture/sampling/observations.h"
#include "texture/sampling/photo_pass.h"
#include "texture/sampling/photo_view.h"

namespace roomtex {

struct Registration {
  std::vector<PhotoRegistration> photos;  // one per photo; none for "none"
  std::vector<RegistrationTrial> trials;  // of "auto", as they were made
};

// Moves the poses of the photos and gives them warps. Photos are decoded once more, each into a
// small grey picture; these take 256 MB at most.
// intensities: what the scanner measured at every cell of each grid, 0..255 (IntensityAsGrey).
// The result does not depend on num_threads.
Registration RegisterPhotos(const PhotoPassInput& input, const std::vector<GridOfSamples>& grids,
                            const std::vector<std::vector<uint8_t>>& intensities,
                            const ObservationStore& store,
                            const std::vector<Eigen::Vector3f>& gains,
                            const RegistrationOptions& options, int num_threads,
                            std::vector<PhotoView>* photos);

}  // namespace roomtex
