// Response curves and vignetting: files, brackets, and what overlaps show.

#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/frames.h"
#include "core/photo.h"
#include "tests/support/temp_folder.h"
#include "texture/sampling/photo_tone.h"
#include "texture/tone/response_bracket.h"
#include "texture/tone/tone_fit.h"

namespace roomtex {
namespace {

constexpr double kGamma = 1.8;
// Of red, green and blue: what mixes them up shows.
constexpr double kGammas[3] = {1.5, kGamma, 2.2};

// Linear light of a level 0..1 for a camera with a gamma, a toe and a shoulder.
double FilmLight(double level, double gamma) {
  double low = 0, high = 1;
  for (int i = 0; i < 50; ++i) {
    const double p = (low + high) / 2;
    (p - 0.3 * std::sin(2 * kPi * p) / (2 * kPi) < level ? low : high) = p;
  }
  return std::pow(low, gamma);
}
double FilmLight(double level) { return FilmLight(level, kGamma); }
double FilmLevel(double light) {
  const double p = std::pow(std::clamp(light, 0.0, 1.0), 1 / kGamma);
  return p - 0.3 * std::sin(2 * kPi * p) / (2 * kPi);
}

// One curve per colour.
ResponseCurve FilmCurve() {
  ResponseCurve::Table table{};
  for (int level = 0; level < 256; ++level) {
    for (int k = 0; k < 3; ++k) {
      table[level][k] = static_cast<float>(FilmLight(level / 255.0, kGammas[k]));
    }
  }
  return ResponseCurve(table);
}

double TrueLogFactor(double r2) { return 0.1 * r2 + 0.25 * r2 * r2; }

// Photos of exposures within +-1 EV that see samples of random light through a faulty camera.
struct FaultyCamera {
  bool film = false, vignetting = false;
  std::vector<double> log_exposure;
  std::vector<ExposureData> exif;

  explicit FaultyCamera(int num_photos) {
    for (int p = 0; p < num_photos; ++p) {
      log_exposure.push_back(std::log(2) * ((p * 5) % 7 - 3) / 3);
      ExposureData data;
      data.exposure_time = std::exp(log_exposure.back()) / 60;
      exif.push_back(data);
    }
  }

  ExposureSamples See() const {
    std::mt19937 random(11);
    std::uniform_real_distribution<double> log_light(std::log(0.02), std::log(0.9)), unit(0, 1);
    std::normal_distribution<double> noise(0, 1.5 / 255);
    ExposureSamples samples;
    samples.num_photos = static_cast<int>(exif.size());
    for (int k = 0; k < 12000; ++k) {
      const double base = log_light(random);
      for (int v = 0; v < 4; ++v) {
        ExposureView view;
        view.photo = static_cast<int>((k * 3 + v * (1 + k % 3)) % exif.size());
        view.radius2 = static_cast<float>(unit(random));
        for (int c = 0; c < 3; ++c) {
          double light = std::exp(base - 0.2 * c + log_exposure[view.photo]);
          if (vignetting) light *= std::exp(-TrueLogFactor(view.radius2));
          const double level = film ? FilmLevel(light) : SrgbFromLinear(std::min(light, 1.0));
          const double byte = std::round(255 * std::clamp(level + noise(random), 0.0, 1.0));
          view.light[c] = static_cast<float>(LinearFromSrgb(byte / 255));
        }
        // Someone walks through the picture.
        if (k % 23 == 0 && v == 1) view.light.setConstant(0.3f);
        view.trust = ExposureTrust(view.light);
        if (view.trust > 0) samples.views.push_back(view);
      }
      if (samples.views.size() < samples.begin.back() + 2) {
        samples.views.resize(samples.begin.back());
      } else {
        samples.begin.push_back(samples.views.size());
      }
    }
    return samples;
  }
};

// Largest error of a curve after one factor, in levels (0..255) of sRGB; levels below 15 are left
// out: they are noise, and no light to speak of.
double CurveError(const ResponseCurve& curve, double (*truth)(double)) {
  const double factor = truth(128 / 255.0) / curve.Linear(128, 1);
  double largest = 0;
  for (int level = 15; level <= 255; ++level) {
    const double light = std::min(1.0, factor * curve.Linear(static_cast<float>(level), 1));
    const double error = SrgbFromLinear(light) - SrgbFromLinear(truth(level / 255.0));
    largest = std::max(largest, 255 * std::abs(error));
  }
  return largest;
}

TEST(ResponseCurve, OfAPhotoIsSrgbUnlessSaidOtherwise) {
  const ResponseCurve curve;
  EXPECT_TRUE(curve.is_srgb());
  for (int level = 0; level < 256; ++level) {
    EXPECT_NEAR(curve.Linear(static_cast<float>(level), 2), LinearFromSrgb(level / 255.0), 1e-6);
  }
}

TEST(ResponseCurve, RoundTripsThroughItsFile) {
  const TempFolder folder;
  const ResponseCurve curve = FilmCurve();
  curve.Write(folder / "response.txt");
  const ResponseCurve read = ResponseCurve::Read(folder / "response.txt");
  EXPECT_FALSE(read.is_srgb());
  for (int level = 0; level < 256; ++level) {
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(read.Linear(static_cast<float>(level), k), FilmLight(level / 255.0, kGammas[k]),
                  1e-5);
    }
  }
}

TEST(ResponseCurve, IsReadAtAnyScaleWithOneNumberOrThree) {
  const TempFolder folder;
  std::string one = "# linear\n", three;
  for (int level = 0; level < 256; ++level) {
    one += std::to_string(level * 7) + "\n";
    three += std::to_string(level) + ", " + std::to_string(level) + ", " + std::to_string(level) +
             " # and a comment\n";
  }
  WriteBytes(folder / "one.txt", one);
  WriteBytes(folder / "three.txt", three);
  for (const char* name : {"one.txt", "three.txt"}) {
    EXPECT_NEAR(ResponseCurve::Read(folder / name).Linear(51, 0), 0.2, 1e-6);
  }
}

TEST(ResponseCurve, RefusesWhatIsNoCurve) {
  const TempFolder folder;
  const auto with = [&](const std::string& last) {
    std::string text;
    for (int level = 0; level < 255; ++level) text += std::to_string(level) + "\n";
    WriteBytes(folder / "curve.txt", text + last);
    return folder / "curve.txt";
  };
  EXPECT_INPUT_ERROR(ResponseCurve::Read(with("")), "255 levels");
  EXPECT_INPUT_ERROR(ResponseCurve::Read(with("255\n256\n")), "line 257");
  EXPECT_INPUT_ERROR(ResponseCurve::Read(with("12\n")), "darker than the level before");
  EXPECT_INPUT_ERROR(ResponseCurve::Read(with("nan\n")), "line 256");
  EXPECT_INPUT_ERROR(ResponseCurve::Read(with("bright\n")), "\"bright\"");
  EXPECT_INPUT_ERROR(ResponseCurve::Read(with("1 2\n")), "2 numbers");
  EXPECT_INPUT_ERROR(ResponseCurve::Read(folder / "none.txt"), "none.txt");
}

TEST(ResponseCurve, TurnsPhotosIntoSrgb) {
  cv::Mat3b photo(1, 256);
  for (int level = 0; level < 256; ++level) {
    photo(0, level) = cv::Vec3b::all(static_cast<uint8_t>(level));
  }
  cv::Mat converted = photo.clone();
  FilmCurve().ToSrgb(&converted);
  for (int level = 0; level < 256; ++level) {
    for (int k = 0; k < 3; ++k) {  // a photo's bytes are blue, green, red
      EXPECT_NEAR(converted.at<cv::Vec3b>(0, level)[2 - k] / 255.0,
                  SrgbFromLinear(FilmLight(level / 255.0, kGammas[k])), 0.51 / 255);
    }
  }
  EXPECT_EQ(converted.at<cv::Vec3b>(0, 255), cv::Vec3b::all(255));
}

TEST(Vignetting, IsFoundFromOverlaps) {
  FaultyCamera camera(9);
  camera.vignetting = true;
  const ExposureSamples samples = camera.See();
  const std::vector<Vignetting> found =
      FitVignetting(samples, std::vector<int>(9, 0), 1, std::vector<double>(9, 0));
  for (double r2 = 0.1; r2 < 0.99; r2 += 0.1) {
    EXPECT_NEAR(found[0].LogFactor(r2), TrueLogFactor(r2), 0.01) << r2;
  }
}

TEST(Vignetting, IsNotFoundWhereThereIsNone) {
  FaultyCamera camera(9);
  const std::vector<Vignetting> found =
      FitVignetting(camera.See(), std::vector<int>(9, 0), 1, std::vector<double>(9, 0));
  EXPECT_TRUE(found[0].is_none());
}

TEST(Vignetting, OfTwoLensesIsToldApart) {
  FaultyCamera camera(9);
  camera.vignetting = true;
  ExposureSamples samples = camera.See();
  std::vector<int> lens;
  for (int p = 0; p < 9; ++p) lens.push_back(p % 2);
  for (ExposureView& view : samples.views) {  // the second lens has none
    if (lens[view.photo] == 1) {
      view.light *= static_cast<float>(std::exp(TrueLogFactor(view.radius2)));
    }
  }
  const std::vector<Vignetting> found = FitVignetting(samples, lens, 2, std::vector<double>(9, 0));
  EXPECT_NEAR(found[0].LogFactor(0.9), TrueLogFactor(0.9), 0.02);
  EXPECT_NEAR(found[1].LogFactor(0.9), 0, 0.02);
}

TEST(ResponseFit, FindsACurveThatIsNotSrgb) {
  FaultyCamera camera(9);
  camera.film = true;
  const ResponseFit fit = FitResponse(camera.See(), camera.exif);
  ASSERT_TRUE(fit.determined) << fit.reason;
  EXPECT_GT(CurveError(ResponseCurve(), FilmLight), 20);
  EXPECT_LT(CurveError(fit.curve, FilmLight), 4);
}

TEST(ResponseFit, FindsACurveInSpiteOfVignettingAndRoundedExif) {
  FaultyCamera camera(9);
  camera.film = camera.vignetting = true;
  for (int p = 0; p < 9; ++p) *camera.exif[p].exposure_time *= p % 2 == 0 ? 1.05 : 0.95;
  const ResponseFit fit = FitResponse(camera.See(), camera.exif);
  ASSERT_TRUE(fit.determined) << fit.reason;
  EXPECT_LT(CurveError(fit.curve, FilmLight), 7);  // EXIF gives the power
}

TEST(ResponseFit, LeavesSrgbNearlyAsItIs) {
  FaultyCamera camera(9);
  const ResponseFit fit = FitResponse(camera.See(), camera.exif);
  ASSERT_TRUE(fit.determined) << fit.reason;
  EXPECT_LT(CurveError(fit.curve, LinearFromSrgb), 2);
}

TEST(ResponseFit, IsNotDeterminedWithoutExposuresThatDiffer) {
  FaultyCamera camera(9);
  camera.film = true;
  for (ExposureData& exif : camera.exif) exif.exposure_time = 1.0 / 60;
  const ResponseFit fit = FitResponse(camera.See(), camera.exif);
  EXPECT_FALSE(fit.determined);
  EXPECT_TRUE(fit.curve.is_srgb());
  EXPECT_NE(fit.reason.find("EXIF"), std::string::npos);
  EXPECT_FALSE(FitResponse(camera.See(), std::vector<ExposureData>(9)).determined);
}

TEST(ResponseFit, IsNotDeterminedByExifThatIsNonsense) {
  FaultyCamera camera(9);
  camera.film = true;
  for (int p = 0; p < 9; ++p) camera.exif[p].exposure_time = std::exp2(p * 7 % 5) / 60;
  const ResponseFit fit = FitResponse(camera.See(), camera.exif);
  EXPECT_FALSE(fit.determined);
  EXPECT_TRUE(fit.curve.is_srgb());
}

// Even patches from dark to light, photographed with a film camera.
void ShootBracket(const std::string& folder, const std::vector<double>& seconds) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 1.0 / 255);
  for (size_t i = 0; i < seconds.size(); ++i) {
    cv::Mat3b photo(240, 320);
    for (int y = 0; y < photo.rows; ++y) {
      for (int x = 0; x < photo.cols; ++x) {
        const int patch = y / 20 * 16 + x / 20;  // 0..191
        const double light = 0.002 * std::exp(patch / 191.0 * std::log(500.0));
        const double level = FilmLevel(light * seconds[i]) + noise(random);
        photo(y, x) = cv::Vec3b::all(cv::saturate_cast<uchar>(255 * level));
      }
    }
    const std::string path = folder + "/" + std::to_string(i) + ".jpg";
    cv::imwrite(path, photo, {cv::IMWRITE_JPEG_QUALITY, 97});
    if (seconds[i] <= 0) continue;
    ExposureData exif;
    exif.exposure_time = seconds[i];
    WriteExposureData(path, exif);
  }
}

TEST(Bracket, GivesTheCurve) {
  const TempFolder folder;
  ShootBracket(folder.path(), {0.25, 0.5, 1, 2, 4, 8});
  EXPECT_LT(CurveError(ResponseFromBracket(folder.path()), FilmLight), 3);
}

TEST(Bracket, IsRefusedWhenItIsNone) {
  const TempFolder folder, few, same;
  EXPECT_INPUT_ERROR(ResponseFromBracket(folder / "nowhere"), "nowhere");
  ShootBracket(few.path(), {1, 4});
  EXPECT_INPUT_ERROR(ResponseFromBracket(few.path()), "2 photos");
  ShootBracket(same.path(), {1, 1, 1.5});
  EXPECT_INPUT_ERROR(ResponseFromBracket(same.path()), "two EV");
  ShootBracket(folder.path(), {1, 4, -1});
  EXPECT_INPUT_ERROR(ResponseFromBracket(folder.path()), "2.jpg");
}

}  // namespace
}  // namespace roomtex
