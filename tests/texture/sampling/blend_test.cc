#include "texture/sampling/blend.h"

#include <gtest/gtest.h>

#include "core/photo.h"
#include "texture/tone/exposure.h"

namespace roomtex {
namespace {

Observation Seen(float r, float g, float b, float weight, int photo) {
  Observation o;
  o.color = PackColor({r, g, b});
  o.weight = PackWeight(weight);
  o.photo = static_cast<uint16_t>(photo);
  return o;
}

const std::vector<Eigen::Vector3f> kUnitGains(8, Eigen::Vector3f::Ones());

// Numbers worked out by hand from the formula of thesis 8.2.2.
TEST(ThesisWeight, FollowsTheFormula) {
  // Centre of the photo: (1 - 0) * 0.9 + 0.01.
  EXPECT_NEAR(ThesisWeight(320, 240, 640, 480, false), 0.91, 1e-6);
  // Centre, masked: 0.9 - 0.899.
  EXPECT_NEAR(ThesisWeight(320, 240, 640, 480, true), 0.001, 1e-6);
  // Corner: (1 - (1 + 1) / 2) = 0.
  EXPECT_NEAR(ThesisWeight(0, 480, 640, 480, false), 0.01, 1e-6);
  EXPECT_NEAR(ThesisWeight(640, 480, 640, 480, true), 0.0, 1e-6);
  // Half way to the right: 1 - 0.25 / 2 = 0.875; 0.875 * 0.9 + 0.01.
  EXPECT_NEAR(ThesisWeight(480, 240, 640, 480, false), 0.7975, 1e-6);
}

TEST(AngleWeight, IsOneHeadOnAndFallsWithTheSlant) {
  const Eigen::Vector3f normal(0, 0, 1), front(0, 0, 1);
  EXPECT_NEAR(AngleWeight(front, front, normal), 1, 1e-6);
  float before = 1;
  for (float angle : {0.3f, 0.6f, 0.9f, 1.2f}) {
    const Eigen::Vector3f slanted(std::sin(angle), 0, std::cos(angle));
    const float weight = AngleWeight(slanted, front, normal);
    EXPECT_LT(weight, before);
    EXPECT_GT(weight, 0);
    before = weight;
  }
  // 45 degrees from a scanner head on: the sample's noise shifts by tan 45 = 1, the slant adds 1.
  const Eigen::Vector3f diagonal(std::sqrt(0.5f), 0, std::sqrt(0.5f));
  EXPECT_NEAR(AngleWeight(diagonal, front, normal), 1.0 / 3, 1e-5);
  EXPECT_EQ(AngleWeight(diagonal, front, Eigen::Vector3f::Zero()), 1);
}

TEST(Observation, KeepsColorAndWeightToAThousandth) {
  for (float value : {0.0f, 0.001f, 0.02f, 0.2f, 0.5f, 0.999f, 1.0f}) {
    const Eigen::Vector3f color(value, 1 - value, value * value);
    const Eigen::Vector3f back = UnpackColor(PackColor(color));
    EXPECT_LE((back - color).cwiseAbs().maxCoeff(), 1e-3);
    if (value > 0) {
      EXPECT_NEAR(UnpackWeight(PackWeight(value)) / value, 1, 0.005);
    }
  }
  EXPECT_GT(PackWeight(0.5f), PackWeight(0.49f));
  EXPECT_GT(PackWeight(1e-7f), 0);
}

TEST(ObservationStore, KeepsTheBestInAnyOrderOfAdding) {
  std::vector<Observation> all;
  for (int photo = 0; photo < 7; ++photo) {
    all.push_back(Seen(0.1f, 0.2f, 0.3f, 0.1f + 0.1f * static_cast<float>(photo % 4), photo));
  }
  ObservationStore forward(1, 3), backward(1, 3);
  for (int i = 0; i < 7; ++i) {
    forward.Add(0, all[i]);
    backward.Add(0, all[6 - i]);
  }
  EXPECT_EQ(forward.NumViews(0), 7);
  ASSERT_EQ(forward.Count(0), 3);
  const int expected[3] = {3, 2, 6};  // weights 0.4, 0.3, 0.3: of equals the first photo
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(forward.Begin(0)[i].photo, expected[i]);
    EXPECT_EQ(backward.Begin(0)[i].photo, expected[i]);
  }
}

// What is in doubt counts only where there is nothing else.
TEST(ObservationStore, CountsThePhotosThatGiveTheColour) {
  ObservationStore store(2, 2);
  for (int photo = 0; photo < 5; ++photo) {
    Observation seen = Seen(0.2f, 0.2f, 0.2f, 0.5f, photo);
    seen.in_doubt = 1;
    store.Add(1, seen);
    seen.in_doubt = photo < 2;
    store.Add(0, seen);
  }
  EXPECT_EQ(store.NumViews(0), 3);
  EXPECT_EQ(store.NumViews(1), 5);
  EXPECT_EQ(store.Count(0), 2);
  EXPECT_EQ(store.Begin(0)[1].photo, 3);
}

TEST(BlendSample, SaysWhatCounts) {
  Observation seen[3] = {Seen(0.2f, 0.2f, 0.2f, 0.5f, 0), Seen(0.8f, 0.8f, 0.8f, 0.9f, 1),
                         Seen(0.21f, 0.2f, 0.2f, 0.8f, 2)};
  EXPECT_EQ(NumThatCount(seen, 0, kUnitGains), 0);
  EXPECT_EQ(NumThatCount(seen, 3, kUnitGains), 3);
  seen[1].in_doubt = seen[2].in_doubt = 1;
  EXPECT_EQ(NumThatCount(seen, 3, kUnitGains), 1);
  EXPECT_TRUE(std::isnan(SampleDisagreement(seen, 3, kUnitGains)));
  seen[0].in_doubt = 1;
  EXPECT_EQ(NumThatCount(seen, 3, kUnitGains), 3);  // the first and the last agree
  EXPECT_FALSE(std::isnan(SampleDisagreement(seen, 3, kUnitGains)));
  EXPECT_EQ(NumThatCount(seen, 2, kUnitGains), 0);
  EXPECT_TRUE(std::isnan(SampleDisagreement(seen, 2, kUnitGains)));
}

TEST(BlendSample, IsTheWeightedMeanOfLinearLight) {
  const Observation seen[2] = {Seen(0.2f, 0.4f, 0.6f, 0.75f, 0), Seen(0.4f, 0.2f, 0.6f, 0.25f, 1)};
  const BlendedSample sample = BlendSample(seen, 2, kUnitGains, 0);
  EXPECT_NEAR(sample.blend[0], 0.25, 2e-3);
  EXPECT_NEAR(sample.blend[1], 0.35, 2e-3);
  EXPECT_NEAR(sample.blend[2], 0.6, 2e-3);
  EXPECT_EQ(sample.dominant_photo, 0);
  EXPECT_NEAR(sample.dominant[0], 0.2, 2e-3);
}

TEST(BlendSample, AppliesTheGainOfEachPhoto) {
  const Observation seen[2] = {Seen(0.2f, 0.2f, 0.2f, 0.5f, 0), Seen(0.4f, 0.4f, 0.4f, 0.5f, 1)};
  std::vector<Eigen::Vector3f> gains = kUnitGains;
  gains[0] *= 2;
  EXPECT_NEAR(BlendSample(seen, 2, gains, 0.08).blend[0], 0.4, 2e-3);
}

TEST(BlendSample, LeavesOutAColorThatTheOthersContradict) {
  // The passer-by in photo 0 even has the largest weight.
  const Observation seen[4] = {Seen(0.7f, 0.1f, 0.1f, 0.9f, 0), Seen(0.2f, 0.3f, 0.4f, 0.7f, 1),
                               Seen(0.21f, 0.3f, 0.4f, 0.6f, 2), Seen(0.2f, 0.31f, 0.4f, 0.5f, 3)};
  const BlendedSample robust = BlendSample(seen, 4, kUnitGains, 0.08);
  EXPECT_NEAR(robust.blend[0], 0.205, 0.01);
  EXPECT_FALSE(robust.dominant_fits);
  const BlendedSample plain = BlendSample(seen, 4, kUnitGains, 0);
  EXPECT_GT(plain.blend[0], 0.3);
}

// At an edge that photos show beside its place as many see one side as the other. Who is right
// cannot be known; the mean is off by half of what the wrong side is, whoever weighs more.
TEST(BlendSample, TakesTheMeanWherePhotosAreDivided) {
  const Observation seen[4] = {Seen(0.8f, 0.8f, 0.8f, 0.9f, 0), Seen(0.8f, 0.8f, 0.8f, 0.7f, 1),
                               Seen(0.1f, 0.1f, 0.1f, 0.8f, 2), Seen(0.1f, 0.1f, 0.1f, 0.4f, 3)};
  const BlendedSample plain = BlendSample(seen, 4, kUnitGains, 0);
  EXPECT_NEAR(BlendSample(seen, 4, kUnitGains, 0.3).blend[0], plain.blend[0], 0.01);
  EXPECT_NEAR(BlendSample(seen, 3, kUnitGains, 0.3).blend[0], 0.8, 0.15);
  EXPECT_LT(BlendSample(seen, 3, kUnitGains, 0).blend[0], 0.6);
}

TEST(CastVotes, MostPhotosOutvoteTheRestAndHalfOfThemDoNot) {
  using Votes = std::vector<Vote>;
  const auto cast = [](std::vector<Observation> seen) {
    Votes votes(seen.size());
    CastVotes(seen.data(), static_cast<int>(seen.size()), kUnitGains, 0.3, votes.data());
    return votes;
  };
  const Observation wall = Seen(0.4f, 0.3f, 0.3f, 1, 0), too = Seen(0.41f, 0.3f, 0.3f, 0.2f, 1),
                    coat = Seen(0, 0, 0.05f, 0.9f, 2), hair = Seen(0, 0.4f, 0, 0.1f, 3);
  EXPECT_EQ(cast({wall, coat, too}), (Votes{Vote::kAgrees, Vote::kOutvoted, Vote::kAgrees}));
  EXPECT_EQ(cast({wall, too}), (Votes{Vote::kAgrees, Vote::kAgrees}));
  EXPECT_EQ(cast({wall, coat}), (Votes{Vote::kOpen, Vote::kOpen}));
  EXPECT_EQ(cast({wall, coat, hair}), Votes(3, Vote::kOpen));
  EXPECT_EQ(cast({wall}), (Votes{Vote::kNone}));
  Observation doubtful = too;
  doubtful.in_doubt = 1;
  EXPECT_EQ(cast({wall, coat, doubtful}), (Votes{Vote::kOpen, Vote::kOpen, Vote::kNone}));
}

// White paper is clipped in every photo that sees it, and one photo with a wrong pose sees
// something dark there: clipped photos weigh little in the mean, but they are as good witnesses as
// any other.
TEST(BlendSample, ClippedPhotosOutvoteOneThatContradictsThem) {
  std::vector<Observation> observations(4);
  std::vector<Eigen::Vector3f> gains;
  for (int i = 0; i < 4; ++i) {
    const bool wrong = i == 0;
    observations[i].color =
        PackColor(wrong ? Eigen::Vector3f(0.1f, 0.01f, 0.02f) : Eigen::Vector3f(1, 1, 1));
    observations[i].weight = PackWeight(wrong ? 0.8f : 0.8f * 0.5f);
    observations[i].photo = static_cast<uint16_t>(i);
    gains.emplace_back(
        Eigen::Vector3f::Constant(wrong ? 1.0f : 0.7f + 0.1f * static_cast<float>(i)));
  }
  const BlendedSample sample = BlendSample(observations.data(), 4, gains, 0.08);
  EXPECT_GT(sample.blend.minCoeff(), 0.7f);
  EXPECT_FALSE(sample.dominant_fits);
}

TEST(BlendSample, WhitePaperThatIsClippedInMostPhotosStaysWhite) {
  // Three photos see it clipped; one is short enough; a fifth one sees something red in front of
  // it.
  const Observation seen[5] = {Seen(1, 1, 1, 0.8f, 0), Seen(1, 1, 1, 0.7f, 1),
                               Seen(1, 0.99f, 1, 0.6f, 2), Seen(0.62f, 0.6f, 0.58f, 0.3f, 3),
                               Seen(0.2f, 0.02f, 0.02f, 0.5f, 4)};
  std::vector<Eigen::Vector3f> gains = kUnitGains;
  gains[3] *= 2;  // 1.24, 1.2, 1.16: lighter than what the clipped ones can say
  const BlendedSample sample = BlendSample(seen, 5, gains, 0.08);
  EXPECT_NEAR(sample.blend[0], 1.24, 0.06);
  EXPECT_NEAR(sample.blend[1], 1.20, 0.06);
  EXPECT_FALSE(sample.dominant_fits);  // clipped
}

TEST(BlendSample, HasNoColorWithoutPhotos) {
  EXPECT_EQ(BlendSample(nullptr, 0, kUnitGains, 0.08).dominant_photo, -1);
}

TEST(LookUpPhoto, HitsPixelCentresAndMixesLinearLight) {
  cv::Mat3b photo(2, 2);
  photo(0, 0) = {10, 20, 30};  // b, g, r
  photo(0, 1) = {200, 20, 30};
  photo(1, 0) = {10, 20, 30};
  photo(1, 1) = {200, 20, 30};
  const PhotoColor at = LookUpPhoto(photo, 0.5f, 0.5f);
  EXPECT_NEAR(at.linear[0], LinearFromSrgb(30 / 255.0), 1e-6);
  EXPECT_NEAR(at.linear[2], LinearFromSrgb(10 / 255.0), 1e-6);
  EXPECT_NEAR(at.reliability, 1, 1e-6);
  // Half way the cubic weights of the two pixels on either side (here the border's) are equal.
  const double middle = (LinearFromSrgb(10 / 255.0) + LinearFromSrgb(200 / 255.0)) / 2;
  EXPECT_NEAR(LookUpPhoto(photo, 1.0f, 1.0f).linear[2], middle, 1e-6);
  // Outside: the border's colour.
  EXPECT_NEAR(LookUpPhoto(photo, 0, 0).linear[2], LinearFromSrgb(10 / 255.0), 1e-6);
  EXPECT_NEAR(LookUpPhoto(photo, 2, 2).linear[2], LinearFromSrgb(200 / 255.0), 1e-6);
  photo(1, 1) = {255, 20, 30};
  EXPECT_NEAR(LookUpPhoto(photo, 1.5f, 1.5f).reliability, 0.5, 1e-6);
}

TEST(LookUpPhoto, IsExactOnEvenGradients) {
  // Linear light that rises evenly; bytes are rounded, so allow half a step.
  cv::Mat3b photo(5, 30);
  const auto light = [](float x) { return 0.2f + 0.01f * x; };
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 30; ++x) {
      const uint8_t value = SrgbByteFromLinear(light(static_cast<float>(x) + 0.5f));
      photo(y, x) = {value, value, value};
    }
  }
  for (float x = 5; x < 25; x += 0.37f) {
    EXPECT_NEAR(LookUpPhoto(photo, x, 2.3f).linear[1], light(x), 0.004);
  }
}

TEST(BlendSample, TrustsDoubtfulObservationsOnlyIfTwoAgree) {
  Observation seen[2] = {Seen(0.2f, 0.3f, 0.4f, 1e-3f, 0), Seen(0.6f, 0.1f, 0.1f, 1e-3f, 1)};
  seen[0].in_doubt = seen[1].in_doubt = 1;
  EXPECT_EQ(BlendSample(seen, 1, kUnitGains, 0.08).dominant_photo, -1);
  EXPECT_EQ(BlendSample(seen, 2, kUnitGains, 0.08).dominant_photo, -1);
  seen[1].color = PackColor({0.21f, 0.3f, 0.39f});
  EXPECT_EQ(BlendSample(seen, 2, kUnitGains, 0.08).dominant_photo, 0);
}

TEST(ObservationStore, PutsDoubtLast) {
  ObservationStore store(1, 2);
  Observation doubtful = Seen(0.1f, 0.1f, 0.1f, 0.9f, 5);
  doubtful.in_doubt = 1;
  store.Add(0, doubtful);
  store.Add(0, Seen(0.2f, 0.2f, 0.2f, 0.1f, 1));
  EXPECT_EQ(store.Begin(0)[0].photo, 1);
  EXPECT_EQ(store.Begin(0)[1].photo, 5);
}

TEST(ResolutionWeight, GrowsWithThePixels) {
  EXPECT_NEAR(ResolutionWeight(25), 0.5, 1e-6);
  EXPECT_LT(ResolutionWeight(4), ResolutionWeight(9));
  EXPECT_GT(ResolutionWeight(-1), 0);
}

TEST(LookUpPhoto, AveragesOverAFootprint) {
  cv::Mat3b stripes(40, 40);
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 40; ++x)
      stripes(y, x) = x % 2 ? cv::Vec3b(200, 200, 200) : cv::Vec3b(0, 0, 0);
  }
  const double mean = LinearFromSrgb(200 / 255.0) / 2;
  EXPECT_NEAR(LookUpPhoto(stripes, 20.5f, 20.5f, 8).linear[0], mean, 0.02);
  EXPECT_NEAR(LookUpPhoto(stripes, 20.5f, 20.5f).linear[0], 0, 1e-6);
}

TEST(BlendOptions, NamesEveryProblem) {
  BlendOptions options;
  EXPECT_TRUE(options.Problems().empty());
  options.max_views = 0;
  options.outlier = -1;
  options.footprint = 9;
  EXPECT_EQ(options.Problems().size(), 3u);
}

}  // namespace
}  // namespace roomtex
