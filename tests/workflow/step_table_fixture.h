#pragma once
// A folder for roomtex-auto, with a program in COLMAP's place, and the steps it then has.

#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "core/child_program.h"
#include "tests/support/temp_folder.h"
#include "workflow/step.h"

namespace roomtex {

inline constexpr char kColmap38[] =
    "#!/bin/sh\n"
    "case $1 in\n"
    "help) echo 'COLMAP 3.8 -- Structure-from-Motion'; echo '(Commit x on y without CUDA)';;\n"
    "*) for o in database_path SiftExtraction.use_gpu SiftExtraction.max_image_size \\\n"
    "  SiftMatching.use_gpu SiftMatching.guided_matching SiftMatching.num_threads \\\n"
    "  SiftExtraction.num_threads; do echo \"  --$o arg (=1)\"; done;;\n"
    "esac\n";

class StepTableTest : public testing::Test {
 protected:
  void SetUp() override {
    WriteBytes(folder_ / "colmap", kColmap38);
    std::filesystem::permissions(folder_ / "colmap", std::filesystem::perms::owner_all);
    std::filesystem::create_directories(folder_ / "photos");
    options_.colmap = folder_ / "colmap";
    options_.image_path = folder_ / "photos";
    options_.scan_paths = {"room.e57"};
    options_.output_path = folder_ / "result";
    options_.patterned = "0";
  }

  // What roomtex-align left: a model, with its report beside it and in the log.
  void AddAligned(const std::string& name, bool trusted) {
    const std::string report = trusted ? R"({"trusted": true})" : R"({"trusted": false})";
    std::filesystem::create_directories(folder_ / ("result/" + name));
    std::filesystem::create_directories(folder_ / "result/log");
    WriteBytes(folder_ / ("result/" + name + "/images.bin"), "a model");
    WriteBytes(folder_ / ("result/" + name + "/alignment.json"), report);
    WriteBytes(folder_ / "result/log/align.json", report);
  }

  void AddPhotos(const std::string& name, int count, int width) {
    for (int i = 0; i < count; ++i) {
      cv::imwrite(folder_ / ("photos/" + name + std::to_string(100 + i) + ".jpg"),
                  cv::Mat3b(40, width, cv::Vec3b(9, 9, 9)));
    }
  }

  // A scan that can be read: points without a grid. Its path.
  std::string AddScan(const std::string& name) {
    std::string points;
    for (int i = 0; i < 400; ++i) {
      points += std::to_string(0.1 * (i % 20)) + " " + std::to_string(i / 20) + " " +
                std::to_string(0.01 * (i % 7)) + "\n";
    }
    WriteBytes(folder_ / name, points);
    return folder_ / name;
  }

  Step Make(const std::string& name) {
    Chain chain(options_);
    for (const StepRow& row : StepTable()) {
      if (row.name == name) return row.make(&chain);
    }
    ADD_FAILURE() << name;
    return {};
  }
  std::string Line(const std::string& name, size_t index = 0) {
    return CommandText(Make(name).commands.at(index));
  }
  // The steps that this run has.
  std::vector<std::string> Applying() {
    Chain chain(options_);
    std::vector<std::string> names;
    for (const StepRow& row : StepTable()) {
      if (row.applies(&chain)) names.emplace_back(row.name);
    }
    return names;
  }

  TempFolder folder_;
  AutoOptions options_;
};

}  // namespace roomtex
