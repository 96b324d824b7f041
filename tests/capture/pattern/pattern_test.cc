#include "capture/pattern/pattern.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "capture/pattern/pattern_features.h"
#include "capture/pattern/pattern_quality.h"
#include "capture/pattern/pattern_steps.h"
#include "capture/simulation/room_pictures.h"
#include "core/error.h"
#include "tests/capture/pattern/pattern_camera.h"

namespace roomtex {
namespace {

PatternOptions Sized(int width, int height, int seed = 0) {
  PatternOptions options;
  options.width = width;
  options.height = height;
  options.random_seed = seed;
  return options;
}

// Pairs (feature of a, feature of b) that are each other's nearest, with a ratio below 0.8 both
// ways and a distance below 0.7 of a descriptor's length: as COLMAP matches by default.
std::vector<std::array<int, 2>> MatchMutually(const PatternFeatures& a, const PatternFeatures& b) {
  constexpr float kMostDistance = 0.7f * 512;  // OpenCV's descriptors have a length of 512
  const auto good = [&](const FeatureMatch& match) {
    return match.nearest >= 0 && match.distance < kMostDistance && match.Ratio() < 0.8;
  };
  const auto b_of_a = MatchFeatures(a, b, 0, 2), a_of_b = MatchFeatures(b, a, 0, 2);
  std::vector<std::array<int, 2>> pairs;
  for (int i = 0; i < static_cast<int>(b_of_a.size()); ++i) {
    if (!good(b_of_a[i])) continue;
    const FeatureMatch& back = a_of_b[b_of_a[i].nearest];
    if (good(back) && back.nearest == i) pairs.push_back({i, b_of_a[i].nearest});
  }
  return pairs;
}

bool IsEqual(const cv::Mat1b& a, const cv::Mat1b& b) {
  return a.size() == b.size() && cv::countNonZero(a != b) == 0;
}

TEST(Pattern, HoldsTenThousandDistinctFeatures) {
  const cv::Mat1b pattern = MakePattern(PatternOptions());
  ASSERT_EQ(pattern.size(), cv::Size(1920, 1080));
  const PatternQuality quality = MeasurePattern(pattern, FindFeatures(pattern), 16, 2);
  EXPECT_GT(quality.num_distinct, 12000);
  EXPECT_LT(quality.ratio_median, 0.8);
  EXPECT_EQ(quality.similar_neighbours, 0);
}

TEST(Pattern, IsBrightAtEveryWish) {
  for (const double brightness : {0.5, 0.65, 0.8}) {
    PatternOptions options = Sized(640, 480);
    options.brightness = brightness;
    const cv::Mat1b pattern = MakePattern(options);
    EXPECT_NEAR(cv::mean(pattern)[0] / 255, brightness, 0.01);
    double least = 0, most = 0;
    cv::minMaxLoc(pattern, &least, &most);
    EXPECT_LT(least, 10);
    EXPECT_GT(most, 250);
  }
}

TEST(Pattern, FitsEveryProjector) {
  for (const cv::Size size : {cv::Size(1280, 720), cv::Size(1280, 800), cv::Size(1366, 768),
                              cv::Size(1024, 768), cv::Size(3840, 2160)}) {
    const cv::Mat1b pattern = MakePattern(Sized(size.width, size.height));
    ASSERT_EQ(pattern.size(), size);
    EXPECT_EQ(CountSimilarNeighbours(pattern, 16), 0) << size;
    // No strip at the right or at the bottom is empty.
    for (const cv::Rect edge : {cv::Rect(size.width - 8, 0, 8, size.height),
                                cv::Rect(0, size.height - 8, size.width, 8)}) {
      cv::Scalar mean, deviation;
      cv::meanStdDev(pattern(edge), mean, deviation);
      EXPECT_GT(deviation[0], 40) << size;
    }
  }
}

TEST(Pattern, HoldsEnoughFeaturesOnASmallProjector) {
  const cv::Mat1b pattern = MakePattern(Sized(1280, 720));
  const PatternQuality quality = MeasurePattern(pattern, FindFeatures(pattern), 16, 2);
  EXPECT_GT(quality.num_distinct, WantedFeatures(pattern.size()));
  EXPECT_EQ(WantedFeatures(pattern.size()), 4444);
}

TEST(Pattern, IsTheSameForTheSameSeedOnly) {
  const cv::Mat1b pattern = MakePattern(Sized(640, 480, 5));
  EXPECT_TRUE(IsEqual(pattern, MakePattern(Sized(640, 480, 5))));
  EXPECT_GT(cv::countNonZero(pattern != MakePattern(Sized(640, 480, 6))), 640 * 480 * 9 / 10);
}

TEST(Pattern, OfAnotherSeedDoesNotMatch) {
  const PatternFeatures first = FindFeatures(MakePattern(Sized(800, 600, 1)));
  for (const int seed : {2, 100}) {
    const PatternFeatures second = FindFeatures(MakePattern(Sized(800, 600, seed)));
    EXPECT_LT(MatchedShare(first, second, 2), 0.012) << seed;
    EXPECT_LT(static_cast<double>(MatchMutually(first, second).size()),
              0.005 * static_cast<double>(first.places.size()));
  }
  EXPECT_GT(MatchedShare(first, first, 2), 0.98);
}

TEST(Pattern, OfAPhotoDoesNotMatchThatOfAnotherSeed) {
  const cv::Mat photo = DrawMap(1600, 1000, "PLAN", 4);
  const PatternFeatures first = FindFeatures(MakePattern(photo, Sized(800, 600, 1)));
  const PatternFeatures second = FindFeatures(MakePattern(photo, Sized(800, 600, 2)));
  EXPECT_LT(MatchedShare(first, second, 2), 0.015);
}

TEST(Pattern, OfAPhotoShowsThePhoto) {
  // Inverted and with --blocks 1 not shuffled: dark where the photo is bright.
  cv::Mat photo(600, 800, CV_8UC3, cv::Scalar::all(230));
  photo(cv::Rect(0, 0, 400, 600)).setTo(cv::Scalar::all(20));
  PatternOptions options = Sized(800, 600);
  options.blocks = 1;
  const cv::Mat1b pattern = MakePattern(photo, options);
  EXPECT_GT(cv::mean(pattern.colRange(0, 400))[0], cv::mean(pattern.colRange(400, 800))[0] + 60);
  EXPECT_NEAR(cv::mean(pattern)[0] / 255, options.brightness, 0.01);
}

TEST(Pattern, CoversTheProjectorWithThePhotosMiddle) {
  // A tall photo: its top and bottom, painted black, are cut off.
  cv::Mat photo(1800, 640, CV_8UC3, cv::Scalar::all(0));
  cv::randu(photo(cv::Rect(0, 660, 640, 480)), 100, 255);
  PatternOptions options = Sized(640, 480);
  options.blocks = 1;
  const cv::Mat1b pattern = MakePattern(photo, options);
  EXPECT_NEAR(cv::mean(pattern.rowRange(0, 60))[0], cv::mean(pattern.rowRange(200, 260))[0], 25);
}

TEST(Pattern, RefusesImpossibleOptions) {
  PatternOptions options = Sized(10, 20000);
  options.blocks = 0;
  options.brightness = std::nan("");
  EXPECT_EQ(options.Problems().size(), 3u);
  EXPECT_THROW(MakePattern(options), UsageError);
}

TEST(PatternBlocks, AreAllUsedOnce) {
  const cv::Mat1b detail = DrawDetail(640, 480, 6, 3);
  const std::vector<int> order = ShuffleBlocks(detail, 16, detail.size(), 9);
  EXPECT_EQ(std::set<int>(order.begin(), order.end()).size(), 256u);
  const cv::Mat1b shuffled = ApplyShuffle(detail, 16, order);
  for (const int place : {0, 17, 255}) {
    const int from = order[place];
    EXPECT_TRUE(IsEqual(shuffled({place % 16 * 40, place / 16 * 30, 40, 30}),
                        detail({from % 16 * 40, from / 16 * 30, 40, 30})));
  }
}

TEST(PatternBlocks, NeverStandBesideABlockThatLooksAlike) {
  // 30 % of the blocks are the same grey: a plain shuffle puts many of them side by side.
  cv::Mat1b image = DrawDetail(800, 800, 6, 3);
  for (int i = 0; i < 256 * 3 / 10; ++i) image({i % 16 * 50, i / 16 * 50, 50, 50}).setTo(200);
  const std::vector<int> order = ShuffleBlocks(image, 16, image.size(), 1);
  EXPECT_EQ(CountSimilarNeighbours(ApplyShuffle(image, 16, order), 16), 0);
  EXPECT_GT(CountSimilarNeighbours(image, 16), 100);
}

TEST(PatternBlocks, AreCountedWhereTooManyLookAlike) {
  cv::Mat1b image = DrawDetail(800, 800, 6, 3);
  image.rowRange(0, 600).setTo(200);
  const std::vector<int> order = ShuffleBlocks(image, 16, image.size(), 1);
  EXPECT_GT(CountSimilarNeighbours(ApplyShuffle(image, 16, order), 16), 20);
}

// Share of the features of a photo that find their own place in a photo from elsewhere.
struct Found {
  int features = 0, right = 0, wrong = 0;
};
Found FindAgain(const cv::Mat1b& pattern, const WallView& first, const WallView& second) {
  const PatternFeatures a = FindFeatures(TakePhoto(pattern, first, 1), 8192, 0.02);
  const PatternFeatures b = FindFeatures(TakePhoto(pattern, second, 2), 8192, 0.02);
  const cv::Matx33d second_from_first =
      PhotoFromPattern(second, pattern.size()) * PhotoFromPattern(first, pattern.size()).inv();
  Found found;
  found.features = static_cast<int>(a.places.size());
  for (const auto& [i, j] : MatchMutually(a, b)) {
    const cv::Vec3d q = second_from_first * cv::Vec3d(a.places[i].x, a.places[i].y, 1);
    const double off = std::hypot(q[0] / q[2] - b.places[j].x, q[1] / q[2] - b.places[j].y);
    (off < 2.5 ? found.right : found.wrong)++;
  }
  return found;
}

TEST(Pattern, IsFoundAgainByACameraNearAndFar) {
  // A third of the full size in all: a projector of 1280 pixels, a camera of 1 MP.
  const cv::Mat1b pattern = MakePattern(Sized(1280, 720));
  for (const double distance : {1.0, 3.0, 6.0}) {
    WallView first = SmallView(), second = SmallView();
    first.distance = distance;
    first.turn_deg = 20;
    first.roll_deg = 5;
    second.distance = 1.1 * distance;
    second.turn_deg = -5;
    const Found found = FindAgain(pattern, first, second);
    EXPECT_GT(found.right, 600) << distance << " m";
    EXPECT_GT(found.right, found.features * 3 / 10) << distance << " m";
    EXPECT_LT(found.wrong, 0.04 * found.right) << distance << " m";
  }
}

TEST(Pattern, SurvivesBlurNoiseAndRoomLight) {
  const cv::Mat1b pattern = MakePattern(Sized(1280, 720));
  WallView first = SmallView(), second = SmallView();
  first.blur_px = second.blur_px = 1.5;
  first.noise = second.noise = 6;
  first.room_light = second.room_light = 1.0;
  second.turn_deg = 25;
  const Found found = FindAgain(pattern, first, second);
  EXPECT_GT(found.right, 400);
  EXPECT_LT(found.wrong, 0.04 * found.right);
}

}  // namespace
}  // namespace roomtex
