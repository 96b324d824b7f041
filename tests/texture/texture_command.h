#pragma once
// One simulated capture with true poses and what roomtex-texture makes of it, for all tests of the
// command.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "capture/simulation/capture_writer.h"
#include "capture/simulation/simulated_room.h"
#include "core/photo.h"
#include "importers/scan_reader.h"
#include "importers/scan_record.h"
#include "tests/support/ply_vertices.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {

using nlohmann::json;
namespace fs = std::filesystem;

inline json ReadJson(const std::string& path) { return json::parse(ReadBytes(path)); }

inline PlyVertices ReadPly(const std::string& path) {
  return ParsePlyVertices(ReadBytes(path), path);
}

// Decibels between the coloured vertices and the truth, in sRGB, after one gain in linear light.
inline double Psnr(const PlyVertices& model, const PlyVertices& truth) {
  const auto& linear = LinearFromSrgbByte();
  double cross = 0, square = 0;
  for (size_t i = 0; i < model.points.size(); ++i) {
    if (model.views[i] == 0) continue;
    for (int k = 0; k < 3; ++k) {
      const double m = linear[model.colors[i][k]], t = linear[truth.colors[i][k]];
      cross += m * t;
      square += m * m;
    }
  }
  const double gain = cross / square;
  double error = 0;
  size_t count = 0;
  for (size_t i = 0; i < model.points.size(); ++i) {
    if (model.views[i] == 0) continue;
    for (int k = 0; k < 3; ++k) {
      const double m = SrgbFromLinear(std::min(1.0, gain * linear[model.colors[i][k]]));
      error += std::pow(m - truth.colors[i][k] / 255.0, 2);
      ++count;
    }
  }
  return -10 * std::log10(error / static_cast<double>(count));
}

class TextureCommand : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempFolder;
    Progress progress(true);
    WriteCapture(SimulatedRoom(RoomOptions()), Capture(), &progress);
    result_ = Texture("textured");
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static SimulatedRoomOptions RoomOptions() {
    SimulatedRoomOptions options;
    options.random_seed = 5;
    options.num_photos = 12;
    options.photo_width = 1080;
    options.photo_height = 720;
    options.scan_columns = 500;
    options.scan_rows = 190;
    return options;
  }
  static std::string Capture() { return *folder_ / "capture"; }
  static CommandResult Texture(const std::string& output, const std::string& more = "",
                               const std::string& scan = "") {
    const bool scale_given = more.find("--Texture.scale") != std::string::npos;
    return RunCommandLine("roomtex-texture --quiet --input_path " + Capture() +
                          "/truth --image_path " + Capture() + "/photos --scan_path " +
                          (scan.empty() ? Capture() + "/scan.rtpi" : scan) + " --output_path " +
                          (*folder_ / output) + (scale_given ? " " : " --Texture.scale 1 ") + more);
  }
  static std::string Path(const std::string& name) { return *folder_ / name; }
  // The true model with what roomtex-align would leave beside it.
  static std::string Aligned(const std::string& name, bool trusted, const std::string& scan = "") {
    fs::copy(Capture() + "/truth", Path(name));
    const PlacedScans placed =
        ReadPlacedScans({scan.empty() ? Capture() + "/scan.rtpi" : scan}, "", {});
    Json report;
    report["trusted"] = trusted;
    report["reason"] = trusted ? "" : "Too few points lie on the surface.";
    report["scans"] = ToJson(RecordScans(placed, Path(name)));
    WriteJson(Path(name + "/alignment.json"), report);
    return Path(name);
  }
  static CommandResult TextureAligned(const std::string& model, const std::string& more) {
    return RunCommandLine("roomtex-texture --quiet --Texture.scale 1 --input_path " + model +
                          " --image_path " + Capture() + "/photos --output_path " +
                          (*folder_ / "textured_aligned") + " " + more);
  }
  static Scan ReadCaptureScan() { return ReadScan(Capture() + "/scan.rtpi", {}); }

  static inline TempFolder* folder_ = nullptr;
  static inline CommandResult result_;
};

}  // namespace roomtex
