// The textures of the simulated room: what makes the colour of a point well defined.

#include "capture/simulation/room_texture.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "capture/simulation/room_pictures.h"
#include "core/random_stream.h"

namespace roomtex {
namespace {

std::vector<std::pair<std::string, TexturePtr>> AllTextures() {
  const LinearRgb red = RgbFromSrgb(180, 70, 60), sand = RgbFromSrgb(215, 190, 140);
  const LinearRgb green = RgbFromSrgb(70, 120, 80);
  return {{"plain", MakePlain(sand)},
          {"plaster", MakePlaster(sand, 0.1f, 1)},
          {"wallpaper", MakeWallpaper(green, {red, sand}, 0.11f, 2)},
          {"brick", MakeBrick(red, sand, 3)},
          {"planks", MakePlanks(sand, 4)},
          {"wood", MakeWood(sand, 5)},
          {"plaid", MakePlaid({red, sand, green}, 0.03f, 6)},
          {"blotches", MakeBlotches(red, green, 0.06f, 7)},
          {"picture", MakePicture(DrawAbstract(800, 600, 8), 0.8f, 0.6f, 0.03f, 9)}};
}

Eigen::Vector2f RandomPlace(RandomStream* random) {
  return {static_cast<float>(random->Uniform(0.1, 0.7)),
          static_cast<float>(random->Uniform(0.1, 0.5))};
}

TEST(RoomTexture, AlbedoIsBetweenNothingAndAll) {
  for (const auto& [name, texture] : AllTextures()) {
    RandomStream random(1);
    for (int i = 0; i < 2000; ++i) {
      const LinearRgb color = texture->Albedo(RandomPlace(&random), 0);
      EXPECT_GE(color.minCoeff(), 0) << name;
      EXPECT_LE(color.maxCoeff(), 1.3) << name;
    }
  }
}

TEST(RoomTexture, HoldsNoDetailBelowItsBandLimit) {
  for (const auto& [name, texture] : AllTextures()) {
    RandomStream random(2);
    double fine = 0, coarse = 0;
    for (int i = 0; i < 2000; ++i) {
      const Eigen::Vector2f uv = RandomPlace(&random);
      const LinearRgb here = texture->Albedo(uv, 0);
      fine += (texture->Albedo(uv + Eigen::Vector2f(0.0002f, 0.0001f), 0) - here).norm();
      coarse += (texture->Albedo(uv + Eigen::Vector2f(0.02f, 0.01f), 0) - here).norm();
    }
    EXPECT_LE(fine, 0.3 * coarse) << name;
  }
}

TEST(RoomTexture, FootprintIsTheMeanOverIt) {
  constexpr int kSide = 12;
  for (const auto& [name, texture] : AllTextures()) {
    for (const float footprint : {0.004f, 0.016f}) {
      RandomStream random(3);
      double difference = 0, variation = 0;
      LinearRgb bias = LinearRgb::Zero();
      constexpr int kPlaces = 300;
      for (int i = 0; i < kPlaces; ++i) {
        const Eigen::Vector2f uv = RandomPlace(&random);
        LinearRgb mean = LinearRgb::Zero();
        for (int k = 0; k < kSide * kSide; ++k) {
          const Eigen::Vector2f offset((k % kSide + 0.5f) / kSide - 0.5f,
                                       (k / kSide + 0.5f) / kSide - 0.5f);
          mean += texture->Albedo(uv + footprint * offset, 0) / (kSide * kSide);
        }
        const LinearRgb error = texture->Albedo(uv, footprint) - mean;
        difference += error.norm() / kPlaces;
        variation += (texture->Albedo(uv, 0) - mean).norm() / kPlaces;
        bias += error / kPlaces;
      }
      EXPECT_LT(difference, 0.03) << name << " at " << footprint;
      EXPECT_LT(bias.cwiseAbs().maxCoeff(), 0.006) << name << " at " << footprint;
      EXPECT_LE(difference, 0.9 * variation + 1e-6) << name << " at " << footprint;
    }
  }
}

// Also of several stripes that lie in it.
TEST(RoomTexture, FootprintOfClothIsTheMeanOfItsStripes) {
  constexpr int kSide = 24, kPlaces = 200;
  const TexturePtr cloth = MakePlaid(
      {RgbFromSrgb(230, 228, 220), RgbFromSrgb(40, 80, 150), RgbFromSrgb(180, 70, 60)}, 0.014f, 6);
  for (const float footprint : {0.008f, 0.02f, 0.06f}) {
    RandomStream random(3);
    double squares = 0;
    for (int i = 0; i < kPlaces; ++i) {
      const Eigen::Vector2f uv = RandomPlace(&random);
      LinearRgb mean = LinearRgb::Zero();
      for (int k = 0; k < kSide * kSide; ++k) {
        const Eigen::Vector2f offset((k % kSide + 0.5f) / kSide - 0.5f,
                                     (k / kSide + 0.5f) / kSide - 0.5f);
        mean += cloth->Albedo(uv + footprint * offset, 0) / (kSide * kSide);
      }
      squares += (cloth->Albedo(uv, footprint) - mean).squaredNorm() / 3;
    }
    EXPECT_LT(std::sqrt(squares / kPlaces), 0.015) << footprint;
  }
}

TEST(RoomTexture, DiffersForAnotherSeed) {
  const TexturePtr first = MakeWood(RgbFromSrgb(190, 140, 90), 1),
                   second = MakeWood(RgbFromSrgb(190, 140, 90), 2);
  double difference = 0;
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector2f uv(0.013f * i, 0.007f * i);
    EXPECT_EQ(first->Albedo(uv, 0), first->Albedo(uv, 0));
    difference += (first->Albedo(uv, 0) - second->Albedo(uv, 0)).norm() / 100;
  }
  EXPECT_GT(difference, 0.02);
}

}  // namespace
}  // namespace roomtex
