#include "texture/sampling/photo_sharpness.h"

#include <cmath>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "core/random_stream.h"

namespace roomtex {
namespace {

cv::Mat Noisy(uint64_t seed) {
  cv::Mat photo(100, 100, CV_8UC3);
  RandomStream random(seed);
  for (int i = 0; i < 30000; ++i) {
    photo.data[i] = static_cast<uint8_t>(random.Uniform(60, 200));
  }
  return photo;
}

TEST(ContrastAt, IsThatOfTheGradientWhateverTheExposure) {
  cv::Mat ramp(20, 20, CV_8UC3);
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 20; ++x) ramp.at<cv::Vec3b>(y, x) = cv::Vec3b::all(40 + 5 * x);
  }
  // 10 grey levels between the pixels on both sides, 90 in the middle of the patch.
  EXPECT_NEAR(ContrastAt(ramp, 10.5f, 10.5f), std::pow(10.0 / 90, 2), 1e-4);
  EXPECT_NEAR(ContrastAt(0.5 * ramp, 10.5f, 10.5f), ContrastAt(ramp, 10.5f, 10.5f), 2e-3);
}

TEST(ContrastAt, SaysNothingAtTheBorderOrInTheDark) {
  const cv::Mat photo = Noisy(1);
  EXPECT_GT(ContrastAt(photo, 2.0f, 2.0f), 0);
  for (const float at : {0.0f, 1.9f, 98.0f, 100.0f}) {
    EXPECT_LT(ContrastAt(photo, at, 50), 0) << at;
    EXPECT_LT(ContrastAt(photo, 50, at), 0) << at;
  }
  EXPECT_LT(ContrastAt(0.05 * photo, 50, 50), 0);
  EXPECT_LT(ContrastAt(photo + cv::Scalar::all(120), 50, 50), 0);
}

// Photos of one pattern, `count` probes each; pixels of about the given widths see contrast that
// grows with them, and as much less as the photo is blurred.
std::vector<std::vector<SharpnessProbe>> Probes(const std::vector<double>& sharpness,
                                                const std::vector<double>& widths, int count) {
  std::vector<std::vector<SharpnessProbe>> probes(sharpness.size());
  for (size_t photo = 0; photo < sharpness.size(); ++photo) {
    for (int i = 0; i < count; ++i) {
      RandomStream random(MixBits(3, i));
      const double pattern = random.Uniform(0.5, 1.5);
      RandomStream own(MixBits(4, i, photo));
      const double width = widths[photo] * own.Uniform(0.8, 1.25);
      const double contrast =
          pattern * width * sharpness[photo] * sharpness[photo] * own.Uniform(0.7, 1.3);
      probes[photo].push_back(
          {static_cast<uint32_t>(7 * i), static_cast<float>(contrast), static_cast<float>(width)});
    }
  }
  return probes;
}

TEST(CompareSharpness, TellsBlurFromDistance) {
  const std::vector<double> sharpness = {1, 0.5, 1, 0.6, 1, 1};
  const auto photos = CompareSharpness(Probes(sharpness, {1, 1, 1.2, 1.4, 1.6, 1.8}, 2000));
  for (size_t i = 0; i < sharpness.size(); ++i) {
    EXPECT_NEAR(photos[i].sharpness, sharpness[i], 0.06) << i;
    EXPECT_GT(photos[i].num_samples, 1000u) << i;
    EXPECT_EQ(photos[i].weight == 1, sharpness[i] == 1) << i;
  }
  EXPECT_LT(photos[1].weight, 0.15);
}

TEST(CompareSharpness, PhotosThatAreAlikeKeepTheirWeight) {
  for (const auto& photo : CompareSharpness(Probes({0.9, 0.88, 0.95, 0.9}, {1, 1, 1, 1}, 1000))) {
    EXPECT_EQ(photo.weight, 1);
  }
}

TEST(CompareSharpness, SaysNothingOfPhotosThatCannotBeCompared) {
  // Too few samples; far away; alone; none at all.
  EXPECT_EQ(CompareSharpness(Probes({1, 0.3}, {1, 1}, 100))[1].sharpness, 1);
  EXPECT_EQ(CompareSharpness(Probes({1, 0.3}, {1, 3}, 1000))[1].sharpness, 1);
  EXPECT_EQ(CompareSharpness(Probes({0.3}, {1}, 1000))[0].sharpness, 1);
  EXPECT_EQ(CompareSharpness({{}, {}})[1].weight, 1);
  EXPECT_TRUE(CompareSharpness({}).empty());
}

TEST(SharpnessProbes, AreBoundedAndOfTheSameSamples) {
  EXPECT_EQ(SharpnessStride(0), 1u);
  EXPECT_LE(20'000'000 / SharpnessStride(20'000'000), 200'000u);
  constexpr size_t kPhotos = 1000;
  std::vector<SharpnessProbe> all, odd;
  for (uint32_t i = 0; i < 20000; ++i) all.push_back({i, 1.0f, 1.0f});
  for (uint32_t i = 1; i < 20000; i += 2) odd.push_back({i, 1.0f, 1.0f});
  std::vector<SharpnessProbe> few(all.begin(), all.begin() + 100);
  for (auto* probes : {&all, &odd, &few}) KeepSomeProbes(kPhotos, probes);
  EXPECT_EQ(few.size(), 100u);
  EXPECT_EQ(all.size(), 24'000'000 / sizeof(SharpnessProbe) / kPhotos);
  EXPECT_EQ(odd.size(), all.size());
  // Each odd one of those kept of all is kept of the odd ones, too.
  size_t shared = 0;
  for (size_t a = 0, b = 0; a < all.size() && b < odd.size();) {
    if (all[a].sample == odd[b].sample) ++shared;
    all[a].sample < odd[b].sample ? ++a : ++b;
  }
  EXPECT_NEAR(static_cast<double>(shared) / static_cast<double>(all.size()), 0.5, 0.05);
}

}  // namespace
}  // namespace roomtex
