#pragma once
// Which photos are blurred: each against the others that show the same surface as large. Content
// does not count, since it is the same; neither does distance, since photos are compared where
// their pixels are about as wide on the surface.

#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace roomtex {

// What a photo shows around one sample.
struct SharpnessProbe {
  uint32_t sample = 0;    // slot
  float contrast = 0;     // energy of the gradient, over the square of the brightness
  float pixel_width = 0;  // on the surface, metres; of a slanted one the mean of both directions
};

struct PhotoSharpness {
  size_t num_samples = 0;  // at which it was compared
  // Its gradients, beside those of the sharp photos of the set at the same surface, 0..1; 1 also
  // where nothing could be compared.
  double sharpness = 1;
  double weight = 1;  // share of its weight in the blend that it keeps
};

// Every how many slots a sample is probed.
size_t SharpnessStride(size_t num_slots);
// Of one photo's probes, ordered by sample, as many as make 24 MB for all photos; those of the same
// samples in every photo.
void KeepSomeProbes(size_t num_photos, std::vector<SharpnessProbe>* probes);

// Mean of the squared central differences of the 3 x 3 pixels around, over the squared mean of
// their 5 x 5. 8-bit BGR; negative too near the border, or where it is too dark or too light to
// say.
float ContrastAt(const cv::Mat& photo, float x_in_img, float y_in_img);

// probes: per photo, ordered by sample.
std::vector<PhotoSharpness> CompareSharpness(
    const std::vector<std::vector<SharpnessProbe>>& probes);

}  // namespace roomtex
