#pragma once
// A simulated furnished room with the features and matches of its photos: made once per process.

#include <string>

#include <gtest/gtest.h>

#include "tests/e2e/colmap_steps.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {

struct FurnishedCapture {
  static constexpr int kNumPhotos = 14;
  // Fewer features than COLMAP makes of itself hold it as well: half of the time for the matches.
  // Half of these do not: poses are off by 8 mm instead of 1.
  static constexpr const char* kFeatures = "--SiftExtraction.max_num_features 2048 ";

  // A test whose capture could not be made has failed. Nobody changes what lies there.
  static const FurnishedCapture& Get() {
    static FurnishedCapture* one = nullptr;
    static TempFolder folder;
    if (one == nullptr) {
      one = new FurnishedCapture{folder / "capture", folder / "database.db"};
      one->Make();
    }
    return *one;
  }

  std::string capture;   // the folder of roomtex-simulate
  std::string database;  // of all its photos, every pair matched

 private:
  void Make() const {
    const CommandResult simulated =
        RunCommandLine("roomtex-simulate --quiet --output_path " + capture + " --num_photos " +
                       std::to_string(kNumPhotos) +
                       " --photo_width 960 --photo_height 640 --scan_columns 1000 --scan_rows 380");
    ASSERT_EQ(simulated.exit_code, 0) << simulated.err;
    ExtractAndMatch(database, capture + "/photos",
                    kFeatures + ReadBytes(capture + "/camera_options.txt"));
  }
};

}  // namespace roomtex
