#pragma once
// Samples that several photos see, and what each of them shows there: what photos are compared by.

#include <cmath>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "texture/sampling/grid_colors.h"
#include "texture/sampling/observations.h"
#include "texture/sampling/photo_pass.h"
#include "texture/sampling/photo_view.h"

namespace roomtex {

// How one photo sees one sample.
struct Sighting {
  int sample = 0;
  float weight = 0;  // as for blending
  float grey = NAN;  // brought to one exposure; NaN = not in the photo
  Eigen::Vector2f place = Eigen::Vector2f::Zero();  // `img`, by the camera model
};

// One level of a photo's pyramid.
struct LevelPicture {
  cv::Mat1b grey;
  int level = 0;                                  // each has half the pixels of the one before
  Eigen::Array2f scale = Eigen::Array2f::Ones();  // pixels of level 0 per pixel of the photo

  // Where it shows a place of the photo; both `img`. cv::pyrDown puts the middle of its pixel j
  // onto the middle of pixel 2 j.
  Eigen::Vector2f Place(const Eigen::Vector2f& in_photo) const {
    const float share = 1.0f / static_cast<float>(1 << level);
    return in_photo.array() * scale * share + 0.5f * (1 - share);
  }
};

class SharedSamples {
 public:
  // An even selection of the samples that two photos or more see without doubt, by what is kept of
  // them in the store: memory is bounded, however fine the scan is.
  // intensities: what the scanner measured at every cell of each grid, 0..255.
  SharedSamples(const PhotoPassInput& input, const std::vector<GridOfSamples>& grids,
                const std::vector<std::vector<uint8_t>>& intensities, const ObservationStore& store,
                int num_photos);

  // Looks at all samples anew in the pictures of one level of detail, from where the photos stand
  // now, and adds up what they say.
  // pictures, gains of their greys: per photo.
  void Look(const std::vector<PhotoView>& photos, const std::vector<LevelPicture>& pictures,
            const std::vector<float>& gains, int num_threads);

  int num_photos() const { return static_cast<int>(sightings_.size()); }
  // Ordered by sample.
  const std::vector<Sighting>& Of(int photo) const { return sightings_[photo]; }
  // The weight that the other photos have, and their mean.
  float OthersWeight(const Sighting& s) const { return weight_[s.sample] - s.weight; }
  float OthersGrey(const Sighting& s) const {
    return (sum_[s.sample] - s.weight * s.grey) / OthersWeight(s);
  }
  struct SightingOfPhoto {
    int photo, number;  // Of(photo)[number]
  };
  // All sightings of a sample, by photo.
  const SightingOfPhoto* Begin(int sample) const { return &of_sample_[first_of_sample_[sample]]; }
  const SightingOfPhoto* End(int sample) const { return &of_sample_[first_of_sample_[sample + 1]]; }

  // From now on one in seven of the cubes of that edge that space is cut into is kept aside: what
  // is seen there judges what was found from the rest. 0 = none.
  void KeepAside(double edge);
  bool IsKeptAside(int sample) const { return !kept_aside_.empty() && kept_aside_[sample] != 0; }

  Eigen::Vector3d Point(int sample) const;  // `scan` frame
  const Eigen::Vector3f& Normal(int sample) const { return normals_[sample]; }
  uint8_t Intensity(int sample) const { return intensities_[sample]; }

 private:
  void ListBySample();
  void LookFrom(const PhotoView& photo, const LevelPicture& picture, float gain,
                std::vector<Sighting>* sightings) const;

  std::vector<PointBlock> blocks_;
  std::vector<int> first_of_block_;  // sample; one more at the end
  std::vector<Eigen::Vector3f> normals_;
  std::vector<uint8_t> intensities_;
  std::vector<uint8_t> kept_aside_;               // empty = none
  std::vector<std::vector<Sighting>> sightings_;  // per photo
  std::vector<SightingOfPhoto> of_sample_;
  std::vector<int> first_of_sample_;
  std::vector<float> weight_, sum_;  // per sample, over the photos
};

}  // namespace roomtex
