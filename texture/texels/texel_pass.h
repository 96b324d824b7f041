#pragma once
// Colours the texels of a texture image as samples are coloured, a band of rows at a time, so that
// memory stays bounded however large the image is.

#include <vector>

#include <Eigen/Core>

#include "core/progress.h"
#include "texture/sampling/grid_colors.h"
#include "texture/sampling/grid_links.h"
#include "texture/sampling/photo_view.h"

namespace roomtex {

// Rows of a texture image.
struct TexelBlock {
  std::vector<Eigen::Vector3d> points;   // `scan` frame; NaN = no surface
  std::vector<Eigen::Vector3f> normals;  // unit or zero
  GridLinks links;                       // neighbours on one surface
  std::vector<Rgb> unseen;               // colour of a texel that no photo sees
};

// Where the texels of an image lie.
class TexelSource {
 public:
  virtual ~TexelSource() = default;
  virtual int num_columns() const = 0;
  virtual int num_rows() const = 0;
  // Texels per sample and direction: filters are given in samples.
  virtual double texels_per_sample() const = 0;
  // Where the scanner stood, `scan` frame; NaN = not known.
  virtual Eigen::Vector3d station() const = 0;
  virtual TexelBlock Rows(int first, int end) const = 0;
};

struct TexelPassOptions {
  OcclusionOptions occlusion;
  BlendOptions blend;
  DetailOptions detail;
  const PhotoChoice* choice = nullptr;  // of photos whose detail is taken; null = of all
  double max_bytes = 2e9;               // of the working memory, the finished image not counted
};

// Working memory per texel of a band, bytes.
double BytesPerTexel(const BlendOptions& blend);

// How many times ColorizeTexels goes over the photos.
int NumBands(const TexelSource& source, const TexelPassOptions& options);

// scene: what hides the texels; its samples are left out. gains: one per photo. Photos are decoded
// once per band that they may see something of. The result does not depend on the bands. progress:
// a tick for each photo and band.
ColorGrid ColorizeTexels(const TexelSource& source, const std::vector<PhotoView>& photos,
                         const std::vector<Eigen::Vector3f>& gains, const TexelPassOptions& options,
                         int num_threads, PhotoPassInput* scene, Progress* progress);

}  // namespace roomtex
