#pragma once
// Photos of a simulated room, and how true the colours are that they give its scan.

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "capture/simulation/capture_writer.h"
#include "capture/simulation/simulated_room.h"
#include "core/frames.h"
#include "core/photo.h"
#include "core/random_stream.h"
#include "core/statistics.h"
#include "core/twist.h"
#include "tests/support/temp_folder.h"
#include "texture/colorize.h"

namespace roomtex {

// Decibels in sRGB against the truth in linear light, after one gain.
inline double ColorPsnr(const std::vector<Eigen::Vector3f>& truth, const ColorGrid& grid) {
  const auto& linear = LinearFromSrgbByte();
  std::vector<double> ratios;
  for (size_t i = 0; i < truth.size(); ++i) {
    if (grid.views[i] > 0 && grid.rgb[i][1] > 40) {
      ratios.push_back(truth[i][1] / linear[grid.rgb[i][1]]);
    }
  }
  const double gain = Median(&ratios);
  double squares = 0, count = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    if (grid.views[i] == 0) continue;
    for (int k = 0; k < 3; ++k, ++count) {
      const double have = SrgbFromLinear(std::min(1.0, gain * linear[grid.rgb[i][k]]));
      squares += std::pow(have - SrgbFromLinear(truth[i][k]), 2);
    }
  }
  return -10 * std::log10(squares / count);
}

class ColoredRoomTest : public testing::Test {
 protected:
  static SimulatedRoomOptions Options() {
    SimulatedRoomOptions options;
    options.random_seed = 5;
    options.num_photos = 12;
    options.photo_width = 480;
    options.photo_height = 320;
    options.scan_columns = 800;
    options.scan_rows = 300;
    options.finest_detail = 0.006;
    options.exposure_range_ev = 0.5;
    return options;
  }
  // Once, in SetUpTestSuite().
  static void Make(const SimulatedRoomOptions& options) {
    room_ = std::make_unique<SimulatedRoom>(options);
    folder_ = std::make_unique<TempFolder>();
    Progress quiet(true);
    WriteCapture(*room_, folder_->path(), &quiet);
  }
  static void TearDownTestSuite() {
    room_.reset();
    folder_.reset();
  }

  // Poses turned and moved at random.
  static std::vector<PhotoView> Photos(double turn_deg, double move) {
    std::vector<PhotoView> views;
    for (int i = 0; i < room_->NumPhotos(); ++i) {
      PhotoView view;
      view.name = room_->PhotoName(i);
      view.path = *folder_ / ("photos/" + view.name);
      view.camera = room_->camera();
      RandomStream random(MixBits(7, static_cast<uint64_t>(i)));
      Eigen::Matrix<double, 6, 1> step;
      for (int k = 0; k < 3; ++k) step[k] = RadFromDeg(turn_deg) * random.Gaussian();
      for (int k = 3; k < 6; ++k) step[k] = move * random.Gaussian();
      view.cam_from_scan = Moved(room_->CamFromScan(i), step);
      views.push_back(view);
    }
    return views;
  }

  static ColorizeResult Colorize(const std::vector<PhotoView>& photos, const std::string& mode,
                                 int num_threads = 2) {
    ColorizeOptions options;
    options.registration.mode = mode;
    return Colorize(photos, options, num_threads);
  }
  static ColorizeResult Colorize(const std::vector<PhotoView>& photos,
                                 const ColorizeOptions& options, int num_threads = 2) {
    Progress quiet(true);
    return ColorizeScans({room_->MakeScan()}, photos, options, num_threads, &quiet);
  }

  static double Psnr(const ColorizeResult& result) {
    return ColorPsnr(room_->TrueColors(), result.scans[0].samples);
  }

  inline static std::unique_ptr<SimulatedRoom> room_;
  inline static std::unique_ptr<TempFolder> folder_;
};

}  // namespace roomtex
