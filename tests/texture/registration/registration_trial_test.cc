#include "texture/registration/registration_trial.h"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace roomtex {
namespace {

constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();

// 50 places; with the scan they are alike by `scan`.
KeptAsideLikeness Likeness(float photos, float scan) {
  KeptAsideLikeness likeness;
  for (int i = 0; i < 50; ++i) {
    const float jitter = 0.002f * static_cast<float>(i % 5);
    likeness.among_photos.push_back(photos + jitter);
    likeness.with_scan.push_back(scan + jitter);
  }
  return likeness;
}

RegistrationTrial Kept(const std::string& mode) {
  RegistrationTrial trial;
  trial.mode = mode;
  trial.kept = true;
  return trial;
}

TEST(RegistrationTrial, CountsOnlyPlacesThatWereComparedBothTimes) {
  const LikenessChange change = FindLikenessChange({0.5f, kNothing, 0.7f, 0.1f, 0.2f},
                                                   {0.6f, 0.9f, kNothing, 0.2f, 0.8f}, 0.4f);
  EXPECT_EQ(change.num_places, 2);  // the first and the last one
  EXPECT_NEAR(change.before, 0.35, 1e-6);
  EXPECT_NEAR(change.after, 0.7, 1e-6);
  EXPECT_NEAR(change.sigma, 0.25 / std::sqrt(2), 1e-6);
}

TEST(RegistrationTrial, PosesAreKeptIfPhotosAgreeMuchBetter) {
  EXPECT_TRUE(JudgeTrial("pose", {}, Likeness(0.8f, 0.8f), Likeness(0.9f, 0.8f)).kept);
  EXPECT_FALSE(JudgeTrial("pose", {}, Likeness(0.8f, 0.8f), Likeness(0.81f, 0.8f)).kept);
  EXPECT_FALSE(JudgeTrial("pose", {}, Likeness(0.8f, 0.8f), Likeness(0.7f, 0.8f)).kept);
}

TEST(RegistrationTrial, PhotosThatSlideAlongTheScanGoBack) {
  EXPECT_FALSE(JudgeTrial("pose", {}, Likeness(0.8f, 0.8f), Likeness(0.9f, 0.7f)).kept);
  // A scan that is unlike the photos in either case is no witness.
  EXPECT_TRUE(JudgeTrial("pose", {}, Likeness(0.8f, 0.3f), Likeness(0.9f, 0.2f)).kept);
}

TEST(RegistrationTrial, TheScanMayNotUndoWhatThePhotosSay) {
  const std::vector<RegistrationTrial> earlier = {Kept("pose")};
  const auto judge = [&](float photos, float scan) {
    return JudgeTrial("pose_by_scan", earlier, Likeness(0.9f, 0.8f), Likeness(photos, scan)).kept;
  };
  EXPECT_TRUE(judge(0.9f, 0.81f));
  EXPECT_FALSE(judge(0.9f, 0.79f));
  EXPECT_FALSE(judge(0.89f, 0.95f));
}

TEST(RegistrationTrial, TooFewPlacesSayNothing) {
  KeptAsideLikeness before = Likeness(0.8f, 0.8f), after = Likeness(0.9f, 0.8f);
  before.among_photos.resize(10);
  after.among_photos.resize(10);
  EXPECT_FALSE(JudgeTrial("pose", {}, before, after).kept);
}

}  // namespace
}  // namespace roomtex
