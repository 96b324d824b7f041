#pragma once
// Parts of photos that the other photos contradict: people, moved chairs, screens that changed.
// Where several photos see a place, the blend itself takes what most of them say; where only two
// do, it cannot know which is right. But what stands before the surface is a thing: it goes on in
// the photo to where others outvote it, and is known by that.

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "texture/sampling/blend.h"
#include "texture/sampling/observations.h"
#include "texture/sampling/photo_mask.h"
#include "texture/sampling/photo_pass.h"
#include "texture/sampling/photo_view.h"

namespace roomtex {

// One per photo, null where nothing of some size is contradicted. gains: one per photo. The result
// does not depend on num_threads.
std::vector<std::shared_ptr<const PhotoMask>> FindContradictedParts(
    const PhotoPassInput& input, const ObservationStore& store,
    const std::vector<Eigen::Vector3f>& gains, const std::vector<PhotoView>& photos,
    const BlendOptions& blend, int num_threads);

}  // namespace roomtex
