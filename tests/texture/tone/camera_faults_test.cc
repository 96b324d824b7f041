// A simulated room through cameras with faults: exposures against the truth, and colours nearly as
// good as without the faults.

#include "capture/simulation/camera_faults.h"

#include <cmath>
#include <map>
#include <memory>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "capture/simulation/capture_writer.h"
#include "capture/simulation/simulated_room.h"
#include "core/frames.h"
#include "core/photo.h"
#include "tests/texture/colored_room.h"

namespace roomtex {
namespace {

struct Outcome {
  double gain_rms_ev = 0;  // green, after one factor
  double psnr_db = 0;      // after one gain
  ColorizeResult result;
};

class CameraFaults : public testing::Test {
 protected:
  static SimulatedRoomOptions Room() {
    SimulatedRoomOptions options;
    options.random_seed = 5;
    options.num_photos = 12;
    options.photo_width = 420;
    options.photo_height = 280;
    options.scan_columns = 400;
    options.scan_rows = 170;
    options.range_noise = 0.001;
    return options;
  }

  // photos: numbers of those that are used; empty = all.
  static Outcome Colorize(const SimulatedRoomOptions& room_options, const ExposureOptions& exposure,
                          const std::vector<int>& photos = {}, int texture_scale = 1) {
    const SimulatedRoom room(room_options);
    Progress quiet(true);
    const TempFolder& folder = Photos(room);
    std::vector<int> numbers = photos;
    for (int i = 0; photos.empty() && i < room.NumPhotos(); ++i) numbers.push_back(i);
    std::vector<PhotoView> views;
    for (const int i : numbers) {
      PhotoView view;
      view.name = room.PhotoName(i);
      view.path = folder / ("photos/" + view.name);
      view.camera = room.camera();
      view.cam_from_scan = room.CamFromScan(i);
      views.push_back(view);
    }
    ColorizeOptions options;
    options.exposure = exposure;
    options.texture_scale = texture_scale;
    Outcome outcome;
    outcome.result = ColorizeScans({room.MakeScan()}, views, options, 2, &quiet);
    outcome.gain_rms_ev = GainError(room, numbers, outcome.result.exposure.gains);
    outcome.psnr_db = ColorPsnr(room.TrueColors(), outcome.result.scans[0].samples);
    return outcome;
  }

  // The photos of a room; their pixels are rendered once per camera.
  static const TempFolder& Photos(const SimulatedRoom& room) {
    const SimulatedRoomOptions& o = room.options();
    const std::string key = o.response + std::to_string(o.vignetting + 10 * o.white_balance_ev) +
                            std::to_string(o.field_of_view_deg);
    std::unique_ptr<TempFolder>& folder = captures_[key];
    if (!folder) {
      folder = std::make_unique<TempFolder>();
      Progress quiet(true);
      WriteCapture(room, folder->path(), &quiet);
    }
    for (int i = 0; i < room.NumPhotos(); ++i) {
      ExposureData exif;
      if (o.exif) exif.exposure_time = room.NotedTime(i);
      WriteExposureData(*folder / ("photos/" + room.PhotoName(i)), exif);
    }
    return *folder;
  }
  static void TearDownTestSuite() { captures_.clear(); }

  static double GainError(const SimulatedRoom& room, const std::vector<int>& numbers,
                          const std::vector<Eigen::Vector3f>& gains) {
    std::vector<double> errors;
    double mean = 0;
    for (size_t i = 0; i < numbers.size(); ++i) {
      errors.push_back(std::log2(gains[i][1]) + room.ExposureEv(numbers[i]));
      mean += errors.back() / static_cast<double>(numbers.size());
    }
    double squares = 0;
    for (const double error : errors) squares += (error - mean) * (error - mean);
    return std::sqrt(squares / static_cast<double>(errors.size()));
  }

  static std::map<std::string, std::unique_ptr<TempFolder>> captures_;
};
std::map<std::string, std::unique_ptr<TempFolder>> CameraFaults::captures_;

TEST_F(CameraFaults, NoneLeavesExposuresToATwoHundredthOfAStop) {
  EXPECT_LT(Colorize(Room(), {}).gain_rms_ev, 0.005);
}

TEST_F(CameraFaults, WrongExifHarmsNothing) {
  SimulatedRoomOptions room = Room();
  room.wrong_exif = "one";
  const Outcome one = Colorize(room, {});
  EXPECT_LT(one.gain_rms_ev, 0.005);
  EXPECT_EQ(one.result.exposure.contradicted, std::vector<int>{room.num_photos / 2});
  room.wrong_exif = "all";
  EXPECT_LT(Colorize(room, {}).gain_rms_ev, 0.005);
}

TEST_F(CameraFaults, OnePhotoAloneKeepsItsExposure) {
  const Outcome outcome = Colorize(Room(), {}, {4});
  EXPECT_GT(outcome.result.exposure.gains[0][1], 0.4f);
  EXPECT_LE(outcome.result.exposure.gains[0][1], 1.0f);
}

TEST_F(CameraFaults, PhotosThatOverlapNothingKeepTheirExif) {
  SimulatedRoomOptions room = Room();
  room.field_of_view_deg = 22;  // telephoto pictures of different walls
  const Outcome outcome = Colorize(room, {}, {0, 3, 6, 9});
  const ExposureSolution& exposure = outcome.result.exposure;
  EXPECT_EQ(exposure.by_exif.size(), 3u);
  EXPECT_TRUE(exposure.unconnected.empty());
  EXPECT_LT(outcome.gain_rms_ev, 1e-3);
}

TEST_F(CameraFaults, WhiteBalanceThatVariesIsEvenedOut) {
  SimulatedRoomOptions room = Room();
  room.white_balance_ev = 0.25;
  ExposureOptions options;
  options.white_balance = false;
  const Outcome without = Colorize(room, options);
  const Outcome with = Colorize(room, {});
  EXPECT_LT(with.gain_rms_ev, 0.01);
  EXPECT_LT(with.result.disagreement.after, without.result.disagreement.after - 0.5);
  const SimulatedRoom truth(room);
  for (int k = 0; k < 3; k += 2) {
    std::vector<double> errors;
    double mean = 0;
    for (int i = 0; i < room.num_photos; ++i) {
      const Eigen::Vector3f& gain = with.result.exposure.gains[i];
      errors.push_back(std::log2(gain[k] / gain[1] * truth.WhiteBalance(i)[k]));
      mean += errors.back() / room.num_photos;
    }
    for (const double error : errors) EXPECT_NEAR(error, mean, 0.03);
  }
}

TEST_F(CameraFaults, VignettingIsUndone) {
  SimulatedRoomOptions room = Room();
  const double plain = Colorize(room, {}).psnr_db;
  room.vignetting = 0.5;
  const Outcome without = Colorize(room, {});
  ExposureOptions options;
  options.vignetting = true;
  const Outcome with = Colorize(room, options);
  EXPECT_GT(without.gain_rms_ev, 0.02);
  EXPECT_LT(with.gain_rms_ev, 0.005);
  EXPECT_GT(with.psnr_db, without.psnr_db + 0.4);
  EXPECT_GT(with.psnr_db, plain - 0.15);
  ASSERT_TRUE(with.result.exposure.tones[0]);
  EXPECT_NEAR(std::exp(-with.result.exposure.tones[0]->vignetting.LogFactor(0.8)),
              1 - 0.5 * (0.6 * 0.8 + 0.4 * 0.64), 0.02);
  EXPECT_NEAR(std::exp(-with.result.exposure.tones[0]->vignetting.LogFactor(1)), 0.5, 0.04);
}

TEST_F(CameraFaults, ResponseIsEstimatedAndUndone) {
  SimulatedRoomOptions room = Room();
  const double plain = Colorize(room, {}).psnr_db;
  room.response = "film";
  const Outcome without = Colorize(room, {});
  ExposureOptions options;
  options.response = "estimate";
  const Outcome with = Colorize(room, options);
  EXPECT_EQ(with.result.exposure.response, "estimate");
  EXPECT_LT(without.psnr_db, plain - 3);
  EXPECT_GT(with.psnr_db, plain - 0.8);
  EXPECT_LT(with.gain_rms_ev, 0.02);
}

// Mean of the seen cells' sRGB bytes, red to blue.
Eigen::Vector3d MeanColor(const ColorGrid& grid) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double count = 0;
  for (size_t i = 0; i < grid.rgb.size(); ++i) {
    if (grid.views[i] == 0) continue;
    for (int k = 0; k < 3; ++k) sum[k] += grid.rgb[i][k];
    ++count;
  }
  return sum / count;
}

TEST_F(CameraFaults, AreUndoneInFinerTexturesToo) {
  SimulatedRoomOptions room = Room();
  room.response = "film";
  ExposureOptions options;
  options.response = "estimate";
  options.vignetting = true;
  const Outcome outcome = Colorize(room, options, {}, 2);
  const ColoredScan& colored = outcome.result.scans[0];
  EXPECT_EQ(colored.texture.num_columns, 2 * colored.samples.num_columns);
  const Eigen::Vector3d difference = MeanColor(colored.texture) - MeanColor(colored.samples);
  EXPECT_LT(difference.cwiseAbs().maxCoeff(), 1.5) << difference.transpose();
}

// A still scene, photo 0 of the room, taken with shorter and longer times by the film camera.
void ShootBracket(const std::string& photo_path, const std::string& folder) {
  const cv::Mat scene = ReadPhoto(photo_path);
  const ResponseTable film("film");
  for (int ev = -3; ev <= 3; ++ev) {
    cv::Mat photo = scene.clone();
    for (int i = 0; i < static_cast<int>(photo.total()); ++i) {
      auto& bgr = photo.at<cv::Vec3b>(i);
      for (int k = 0; k < 3; ++k) {
        const float light = LinearFromSrgbByte()[bgr[k]] * static_cast<float>(std::exp2(ev));
        bgr[k] = cv::saturate_cast<uchar>(film.Grey(light));
      }
    }
    const std::string path = folder + "/bracket_" + std::to_string(ev + 3) + ".jpg";
    cv::imwrite(path, photo, {cv::IMWRITE_JPEG_QUALITY, 95});
    ExposureData exif;
    exif.exposure_time = std::exp2(ev) / 30;
    WriteExposureData(path, exif);
  }
}

TEST_F(CameraFaults, ResponseFromABracketIsUndone) {
  SimulatedRoomOptions room = Room();
  const double plain = Colorize(room, {}).psnr_db;
  const TempFolder bracket;
  ShootBracket(Photos(SimulatedRoom(room)) / "photos/photo_000.jpg", bracket.path());
  room.response = "film";
  ExposureOptions options;
  options.bracket_path = bracket.path();
  const Outcome with = Colorize(room, options);
  EXPECT_EQ(with.result.exposure.response, "bracket");
  EXPECT_GT(with.psnr_db, plain - 0.6);
  EXPECT_LT(with.gain_rms_ev, 0.01);
}

TEST_F(CameraFaults, ResponseFromAFileIsUndone) {
  SimulatedRoomOptions room = Room();
  const double plain = Colorize(room, {}).psnr_db;
  room.response = "film";
  std::string text;
  for (int level = 0; level < 256; ++level) {
    double low = 0, high = 1;
    for (int i = 0; i < 50; ++i) {
      const double p = (low + high) / 2;
      (p - 0.3 * std::sin(2 * kPi * p) / (2 * kPi) < level / 255.0 ? low : high) = p;
    }
    text += std::to_string(std::pow(low, 1.8)) + "\n";
  }
  const TempFolder folder;
  WriteBytes(folder / "film.txt", text);
  ExposureOptions options;
  options.response = folder / "film.txt";
  const Outcome with = Colorize(room, options);
  EXPECT_GT(with.psnr_db, plain - 0.4);
  EXPECT_LT(with.gain_rms_ev, 0.005);
}

}  // namespace
}  // namespace roomtex
