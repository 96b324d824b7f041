// The benchmark runs, and its numbers fit together. Nothing here is timed.

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "capture/simulation/simulated_room.h"
#include "core/photo.h"
#include "tests/benchmark/texture/texture_limit.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

TEST(TextureBenchmark, PrintsNumbersThatFitTogether) {
  const TempFolder folder;
  const CommandResult result = RunCommandLine(
      "texture_benchmark --quiet --num_photos 4 --photo_width 300 --photo_height 200 "
      "--scan_columns 300 --scan_rows 120 --Texture.scale 1 --report_path " +
      (folder / "report.json"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  for (const char* text : {"decode", "share of the limit", "triangles drawn", "peak memory"}) {
    EXPECT_NE(result.out.find(text), std::string::npos) << text;
  }
  const auto report = nlohmann::json::parse(ReadBytes(folder / "report.json"));
  double total = 0;
  for (const auto& [stage, seconds] : report["cpu_seconds"].items()) {
    EXPECT_GE(seconds.get<double>(), 0) << stage;
    total += seconds.get<double>();
  }
  EXPECT_NEAR(report["cpu_total"].get<double>(), total, 1e-9);
  EXPECT_LE(report["cpu_coloring"].get<double>(), total);
  EXPECT_GT(report["share_of_limit"].get<double>(), 0);
  EXPECT_GE(report["share_of_limit"].get<double>(), report["share_of_limit_all"].get<double>());
  EXPECT_GT(report["num_triangles"].get<int>(), 10000);
  EXPECT_GT(report["num_samples"].get<int>(), 5000);
  EXPECT_GT(report["texture_peak_memory_bytes"].get<double>(), 1e6);
}

TEST(TextureLimit, SeesWhatThereIs) {
  SimulatedRoomOptions options;
  options.num_photos = 4;
  options.photo_width = 600;
  options.photo_height = 400;
  options.scan_columns = 300;
  options.scan_rows = 120;
  options.exposure_range_ev = 0;
  const SimulatedRoom room(options);
  const TempFolder folder;
  std::vector<PhotoView> photos;
  for (int i = 0; i < 4; ++i) {
    PhotoView view;
    view.path = folder / room.PhotoName(i);
    view.camera = room.camera();
    view.cam_from_scan = room.CamFromScan(i);
    cv::imwrite(view.path, room.RenderPhoto(i));
    photos.push_back(view);
  }
  const TextureLimit limit = MeasureTextureLimit(room.MakeScan(), photos);
  EXPECT_GE(limit.num_samples, limit.num_seen);
  const std::vector<Eigen::Vector3f> truth = room.TrueColors();
  size_t seen = 0, near = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    if (limit.mean_light[i].isZero()) continue;
    ++seen;
    near += (limit.mean_light[i] - truth[i]).cwiseAbs().maxCoeff() < 0.1f;
  }
  EXPECT_LE(seen, limit.num_seen);
  EXPECT_GT(seen, truth.size() / 5);
  EXPECT_GT(static_cast<double>(near) / static_cast<double>(seen), 0.85);
}

}  // namespace
}  // namespace roomtex
