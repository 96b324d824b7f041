#include "texture/tone/exposure.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace roomtex {
namespace {

// Photos of known exposure that see random samples of known light.
struct Capture {
  std::vector<double> exposure;
  std::vector<ExposureData> exif;
  ObservationStore store;

  // Sample i is seen by the photos for which sees(photo, i) holds.
  template <typename Sees>
  Capture(const std::vector<double>& exposures, int num_samples, double noise, const Sees& sees)
      : exposure(exposures), exif(exposures.size()), store(num_samples, 6) {
    std::mt19937 random(7);
    std::uniform_real_distribution<float> light(0.04f, 0.4f);
    // Of a deviation of 0 the library makes no promise.
    const auto sigma = static_cast<float>(noise);
    std::normal_distribution<float> spread;
    for (size_t p = 0; p < exposures.size(); ++p) exif[p].exposure_time = exposures[p] / 60;
    for (int i = 0; i < num_samples; ++i) {
      const Eigen::Vector3f truth(light(random), light(random), light(random));
      for (size_t p = 0; p < exposures.size(); ++p) {
        if (!sees(static_cast<int>(p), i)) continue;
        Observation o;
        o.color =
            PackColor(truth * static_cast<float>(exposures[p]) * std::exp(sigma * spread(random)));
        o.weight = PackWeight(0.5f);
        o.photo = static_cast<uint16_t>(p);
        store.Add(i, o);
      }
    }
  }

  ExposureSolution Solve(const std::string& mode) const {
    ExposureOptions options;
    options.mode = mode;
    return SolveExposure(
        exif, FindOverlaps(SelectSamples(store, static_cast<int>(exposure.size()))), options);
  }
  // Largest error of log(gain * exposure) after the common factor.
  double LargestError(const ExposureSolution& solution) const {
    std::vector<double> logs;
    double mean = 0;
    for (size_t p = 0; p < exposure.size(); ++p) {
      logs.push_back(std::log(solution.gains[p][1] * exposure[p]));
      mean += logs.back() / static_cast<double>(exposure.size());
    }
    double largest = 0;
    for (double value : logs) largest = std::max(largest, std::abs(value - mean));
    return largest;
  }
  void DropExif() { std::fill(exif.begin(), exif.end(), ExposureData()); }
};

const std::vector<double> kExposures = {0.5, 1, 2, 1.26, 0.79};
// A chain: photo p sees samples [1000 p, 1000 p + 2000).
bool Chain(int photo, int sample) { return sample / 1000 == photo || sample / 1000 == photo + 1; }

TEST(Exposure, IsFoundFromOverlapsAlone) {
  Capture capture(kExposures, 6000, 0.05, Chain);
  capture.DropExif();
  const ExposureSolution solution = capture.Solve("match");
  EXPECT_LT(capture.LargestError(solution), 0.02);
  EXPECT_TRUE(solution.unconnected.empty());
}

TEST(Exposure, IsFoundWithExif) {
  Capture capture(kExposures, 6000, 0.05, Chain);
  EXPECT_LT(capture.LargestError(capture.Solve("match")), 0.01);
  EXPECT_LT(capture.LargestError(capture.Solve("exif")), 1e-4);
}

TEST(Exposure, IsFoundInSpiteOfWrongExif) {
  Capture capture(kExposures, 6000, 0.02, Chain);
  capture.exif[2].exposure_time = 1.0;  // is 2 / 60
  const ExposureSolution solution = capture.Solve("match");
  EXPECT_LT(capture.LargestError(solution), 0.02);
  EXPECT_EQ(solution.contradicted, std::vector<int>{2});
}

TEST(Exposure, OfAPhotoWithoutOverlapComesFromExif) {
  Capture capture(kExposures, 6000, 0.02, [](int photo, int sample) {
    return photo == 4 ? sample >= 5000 : sample < 5000;
  });
  const ExposureSolution solution = capture.Solve("match");
  EXPECT_LT(capture.LargestError(solution), 0.02);
  EXPECT_TRUE(solution.unconnected.empty());
  EXPECT_EQ(solution.by_exif, std::vector<int>{4});
}

TEST(Exposure, OfAPhotoWithNothingAtAllStaysAndIsNamed) {
  Capture capture(kExposures, 6000, 0.02, [](int photo, int sample) {
    return photo == 4 ? sample >= 5000 : sample < 5000;
  });
  capture.DropExif();
  const ExposureSolution solution = capture.Solve("match");
  EXPECT_EQ(solution.unconnected, std::vector<int>{4});
  EXPECT_FLOAT_EQ(solution.gains[4][0], 1);
}

TEST(Exposure, IsFoundInSpiteOfTheSameNonsenseInEveryExif) {
  Capture capture({0.5, 1, 2, 1.26, 0.79, 1.6, 0.63}, 8000, 0.02, Chain);
  for (ExposureData& exif : capture.exif) exif.exposure_time = 1.0 / 60;
  const ExposureSolution solution = capture.Solve("match");
  EXPECT_LT(capture.LargestError(solution), 0.01);
  EXPECT_TRUE(solution.exif_ignored);
}

TEST(Exposure, IsFoundInSpiteOfRoundedExif) {
  Capture capture({0.5, 1, 2, 1.26, 0.79, 1.6, 0.63}, 8000, 0.02, Chain);
  for (size_t p = 0; p < capture.exif.size(); ++p) {
    *capture.exif[p].exposure_time *= p % 2 == 0 ? 1.08 : 0.93;
  }
  const ExposureSolution solution = capture.Solve("match");
  EXPECT_LT(capture.LargestError(solution), 0.01);
  EXPECT_FALSE(solution.exif_ignored);
  ASSERT_TRUE(solution.exif_scatter);
  EXPECT_NEAR(*solution.exif_scatter, 0.1, 0.06);
}

// Photos 0-2 and 3-4 see two rooms.
bool TwoRooms(int photo, int sample) { return (photo < 3) == (sample < 3000); }

TEST(Exposure, OfTwoGroupsThatDoNotOverlapIsTiedByExif) {
  Capture capture(kExposures, 6000, 0.02, TwoRooms);
  const ExposureSolution solution = capture.Solve("match");
  EXPECT_LT(capture.LargestError(solution), 0.02);
  EXPECT_EQ(solution.by_exif, (std::vector<int>{3, 4}));
}

TEST(Exposure, OfAGroupThatNothingTiesIsEvenWithinAndAtTheMedian) {
  Capture capture({0.5, 1, 2, 1.26, 0.6}, 6000, 0.02, TwoRooms);
  capture.DropExif();
  const ExposureSolution solution = capture.Solve("match");
  EXPECT_EQ(solution.unconnected, (std::vector<int>{3, 4}));
  EXPECT_NEAR(std::log(solution.gains[4][1] / solution.gains[3][1]), std::log(1.26 / 0.6), 0.02);
  EXPECT_NEAR(solution.gains[0][1] * 0.5, solution.gains[2][1] * 2, 0.02);
  EXPECT_FLOAT_EQ(solution.gains[3][1], 1);  // the lower median of two
}

TEST(Exposure, OfOnePhotoOnlyIsLeftAlone) {
  Capture capture({2.0}, 500, 0.02, [](int, int) { return true; });
  const ExposureSolution solution = capture.Solve("match");
  EXPECT_EQ(solution.gains[0], Eigen::Vector3f::Ones());
  EXPECT_EQ(solution.reference_photo, 0);
  EXPECT_TRUE(solution.unconnected.empty());
  EXPECT_TRUE(solution.by_exif.empty());
}

TEST(Exposure, ComparesExifOfTheSameFieldsOnly) {
  // Photos 3 and 4 were taken with a lens without contacts: no aperture in EXIF.
  Capture capture(kExposures, 6000, 0.02, Chain);
  for (int p = 0; p < 5; ++p) {
    if (p < 3) capture.exif[p].f_number = 8;
  }
  const ExposureSolution solution = capture.Solve("match");
  EXPECT_LT(capture.LargestError(solution), 0.01);
  EXPECT_TRUE(solution.contradicted.empty());
}

TEST(Exposure, TrustsNeitherClippedNorNearlyBlackLight) {
  // Two photos, one four times as long: a third of its samples is clipped, a third of the other's
  // is black.
  ObservationStore store(3000, 2);
  std::mt19937 random(5);
  std::normal_distribution<float> noise(0, 0.003f);
  for (int i = 0; i < 3000; ++i) {
    const float truth = i % 3 == 0 ? 0.5f : i % 3 == 1 ? 0.1f : 0.003f;
    for (int p = 0; p < 2; ++p) {
      const float light = std::clamp(truth * (p == 0 ? 1.0f : 4.0f) + noise(random), 0.0f, 1.0f);
      Observation o;
      o.color = PackColor(Eigen::Vector3f::Constant(light));
      o.weight = PackWeight(0.5f);
      o.photo = static_cast<uint16_t>(p);
      store.Add(i, o);
    }
  }
  const std::vector<Overlap> overlaps = FindOverlaps(SelectSamples(store, 2));
  ASSERT_EQ(overlaps.size(), 1u);
  EXPECT_NEAR(overlaps[0].log_ratio[3], -std::log(4), 0.01);
}

// Where samples lie much closer than pixels, every view weighs little (ResolutionWeight); the third
// photo's lie at a depth boundary and show something else.
TEST(Exposure, ComparesViewsOfLittleWeightButNoneAtABoundary) {
  ObservationStore store(3000, 3);
  for (int i = 0; i < 3000; ++i) {
    const float truth = 0.05f + 0.0001f * static_cast<float>(i);
    for (int p = 0; p < 3; ++p) {
      Observation o;
      o.color =
          PackColor(Eigen::Vector3f::Constant(p == 2 ? 0.3f : truth * (p == 0 ? 1.0f : 2.0f)));
      o.weight = PackWeight(p == 0 ? 0.003f : p == 1 ? 0.0004f : 0.000003f);
      o.photo = static_cast<uint16_t>(p);
      o.at_boundary = p == 2;
      store.Add(i, o);
    }
  }
  const std::vector<Overlap> overlaps = FindOverlaps(SelectSamples(store, 3));
  ASSERT_EQ(overlaps.size(), 1u);
  EXPECT_NEAR(overlaps[0].log_ratio[3], -std::log(2), 0.01);
}

TEST(Exposure, ModeExifMatchesPhotosWithoutExif) {
  Capture capture(kExposures, 6000, 0.02, Chain);
  capture.exif[3] = ExposureData();
  const ExposureSolution solution = capture.Solve("exif");
  EXPECT_EQ(solution.without_exif, 1);
  EXPECT_LT(capture.LargestError(solution), 0.02);
}

TEST(Exposure, ModeExifObeysWrongExifButNamesIt) {
  Capture capture(kExposures, 6000, 0.02, Chain);
  capture.exif[2].exposure_time = 0.5 / 60;  // is 2 / 60
  const ExposureSolution solution = capture.Solve("exif");
  EXPECT_NEAR(solution.gains[2][1] / solution.gains[1][1], 2, 1e-3);
  EXPECT_EQ(solution.contradicted, std::vector<int>{2});
}

TEST(Exposure, ModeNoneLeavesPhotosAlone) {
  Capture capture(kExposures, 3000, 0.02, Chain);
  for (const Eigen::Vector3f& gain : capture.Solve("none").gains) {
    EXPECT_EQ(gain, Eigen::Vector3f::Ones());
  }
}

TEST(Exposure, RefersToThePhotoOfMedianExposure) {
  Capture capture(kExposures, 6000, 0.02, Chain);
  const ExposureSolution solution = capture.Solve("match");
  EXPECT_EQ(solution.reference_photo, 1);  // exposure 1 of 0.5, 0.79, 1, 1.26, 2
  EXPECT_NEAR(solution.gains[1][0], 1, 1e-6);
}

TEST(Exposure, WhiteBalanceIsMatchedPerChannel) {
  ObservationStore store(3000, 4);
  std::mt19937 random(3);
  std::uniform_real_distribution<float> light(0.05f, 0.4f);
  for (int i = 0; i < 3000; ++i) {
    const Eigen::Vector3f truth(light(random), light(random), light(random));
    for (int p = 0; p < 3; ++p) {
      Observation o;
      o.color = PackColor(
          truth.cwiseProduct(p == 2 ? Eigen::Vector3f(1.5f, 1, 0.7f) : Eigen::Vector3f(1, 1, 1)));
      o.weight = PackWeight(0.5f);
      o.photo = static_cast<uint16_t>(p);
      store.Add(i, o);
    }
  }
  ExposureOptions options;
  options.white_balance = true;
  const ExposureSolution solution =
      SolveExposure(std::vector<ExposureData>(3), FindOverlaps(SelectSamples(store, 3)), options);
  const Eigen::Vector3f relative = solution.gains[2].cwiseQuotient(solution.gains[0]);
  EXPECT_NEAR(relative[0], 1 / 1.5, 0.01);
  EXPECT_NEAR(relative[1], 1, 0.01);
  EXPECT_NEAR(relative[2], 1 / 0.7, 0.015);
}

TEST(Exposure, ShrugsOffAnOverlapThatContradictsTheRest) {
  std::vector<Overlap> overlaps;
  for (int a = 0; a < 4; ++a) {
    for (int b = a + 1; b < 4; ++b) {
      Overlap overlap;
      overlap.photo_a = a;
      overlap.photo_b = b;
      overlap.num_samples = 500;
      overlap.spread = 0.05f;
      overlaps.push_back(overlap);
    }
  }
  overlaps[0].log_ratio.setConstant(1.0f);  // photos 0 and 1, say a mirror
  const ExposureSolution solution =
      SolveExposure(std::vector<ExposureData>(4), overlaps, ExposureOptions());
  for (const Eigen::Vector3f& gain : solution.gains) EXPECT_NEAR(gain[0], 1, 0.02);
}

TEST(Disagreement, FallsWithTheRightGains) {
  Capture capture(kExposures, 6000, 0.02, Chain);
  const Disagreement d = MeasureDisagreement(capture.store, capture.Solve("match").gains);
  EXPECT_GT(d.before, 20);
  EXPECT_LT(d.after, 4);
  EXPECT_GT(d.at_random, 20);
}

TEST(OutputScale, DarkensOnlyWhatWouldBeBlownOut) {
  Capture capture({1.0}, 2000, 0, [](int, int) { return true; });
  EXPECT_FLOAT_EQ(OutputScale(capture.store, {Eigen::Vector3f::Ones()}), 1);
  const float scale = OutputScale(capture.store, {Eigen::Vector3f::Constant(4)});  // up to 1.6
  EXPECT_NEAR(scale, 1 / 1.6, 0.02);
}

}  // namespace
}  // namespace roomtex
