#pragma once
// What the surfaces of the simulated room look like: procedural textures and pictures, all
// band-limited.

#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace roomtex {

// Linear light, red, green, blue, each 0..1.
using LinearRgb = Eigen::Vector3f;
// From sRGB values 0..255.
LinearRgb RgbFromSrgb(int red, int green, int blue);

// No texture holds detail finer than this (metres): a photo and a scan can agree on its colour.
inline constexpr float kTextureBandLimit = 0.0015f;

// The albedo of a surface. uv: metres on the surface, u right and v down seen from the front.
// footprint: width in metres over which the colour is averaged, at least kTextureBandLimit.
class RoomTexture {
 public:
  virtual ~RoomTexture() = default;
  virtual LinearRgb Albedo(const Eigen::Vector2f& uv, float footprint) const = 0;
};
using TexturePtr = std::shared_ptr<const RoomTexture>;
// Over the first half square metre.
LinearRgb MeanAlbedo(const RoomTexture& texture);

// One colour all over.
TexturePtr MakePlain(const LinearRgb& color);
// Mottled paint or paper. contrast: relative standard deviation, about 0.1.
TexturePtr MakePlaster(const LinearRgb& color, float contrast, uint32_t seed);
// Wallpaper with leaves strewn over faint stripes; no two places repeat.
TexturePtr MakeWallpaper(const LinearRgb& ground, const std::vector<LinearRgb>& leaves,
                         float leaf_length, uint32_t seed);
// Bricks in running bond, each with its own tone, and mortar.
TexturePtr MakeBrick(const LinearRgb& brick, const LinearRgb& mortar, uint32_t seed);
// Floor boards along u, each with its own tone, grain and knots.
TexturePtr MakePlanks(const LinearRgb& wood, uint32_t seed);
// Wood with its grain along u.
TexturePtr MakeWood(const LinearRgb& wood, uint32_t seed);
// Woven cloth: stripes of random widths both ways, and yarn.
TexturePtr MakePlaid(const std::vector<LinearRgb>& yarns, float mean_stripe, uint32_t seed);
// Leaf, soil and the like: blotches between two colours.
TexturePtr MakeBlotches(const LinearRgb& first, const LinearRgb& second, float size, uint32_t seed);
// A picture (8-bit BGR, sRGB) over `width` x `height` metres from uv = 0; its border continues
// outside. grain: relative standard deviation of a fine paper grain on top.
TexturePtr MakePicture(const cv::Mat& picture, float width, float height, float grain,
                       uint32_t seed);

}  // namespace roomtex
