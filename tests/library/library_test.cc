// docs/examples/ as a user would build it, on a small simulated capture. Label `e2e`.

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "capture/simulation/capture_writer.h"
#include "capture/simulation/simulated_room.h"
#include "colmap_ext/sparse_model.h"
#include "core/command_line.h"
#include "tests/library/installed_library.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

// With COLMAP's model of it, made from the truth without running COLMAP.
void WriteCaptureAndModel(const std::string& folder) {
  SimulatedRoomOptions options;
  options.num_photos = 10;
  options.photo_width = 720;
  options.photo_height = 480;
  options.scan_columns = 700;
  options.scan_rows = 350;
  const SimulatedRoom room(options);
  Progress progress(/*quiet=*/true);
  WriteCapture(room, folder, &progress);
  WriteSparseModel(room.MakeSparseModel(2500, 0.5), folder + "/sparse");
}

TEST(Library, ExampleBuildsAgainstTheInstalledPackageAndColoursAScan) {
  const TempFolder folder;
  const CommandResult installed = InstallLibraries(folder / "prefix");
  ASSERT_EQ(installed.exit_code, 0) << installed.err;
  const CommandResult built = BuildProject("docs/examples", folder / "prefix", folder / "example");
  ASSERT_EQ(built.exit_code, 0) << built.out << built.err;
  EXPECT_EQ((built.out + built.err).find("warning"), std::string::npos) << built.out << built.err;

  const std::string capture = folder / "capture";
  WriteCaptureAndModel(capture);
  const CommandResult colored =
      RunProgram((folder / "example/color_scan ") + capture + "/scan.rtpi " + capture + "/sparse " +
                 capture + "/picks.csv " + capture + "/photos " + (folder / "colored.ply"));
  ASSERT_EQ(colored.exit_code, 0) << colored.err;

  const CommandResult evaluated =
      RunCommandLine("roomtex-evaluate --quiet --truth_path " + capture + "/truth --ply_path " +
                     (folder / "colored.ply") + " --report_path " + (folder / "evaluated.json"));
  ASSERT_EQ(evaluated.exit_code, 0) << evaluated.err;
  const auto color = nlohmann::json::parse(ReadBytes(folder / "evaluated.json"))["color"];
  EXPECT_GT(color["coverage"], 0.5);
  EXPECT_GT(color["psnr_db"], 20.0);
}

TEST(Library, WhoAsksForAnotherVersionIsRefused) {
  const TempFolder folder;
  ASSERT_EQ(InstallLibraries(folder / "prefix").exit_code, 0);
  WriteBytes(folder / "CMakeLists.txt",
             "cmake_minimum_required(VERSION 3.22)\nproject(p LANGUAGES CXX)\n"
             "find_package(roomtex 99.0 REQUIRED)\n");
  const CommandResult result =
      RunProgram("cmake -S " + folder.path() + " -B " + (folder / "build") +
                 " -DCMAKE_PREFIX_PATH=" + (folder / "prefix"));
  EXPECT_NE(result.exit_code, 0);
  EXPECT_NE(result.err.find("version: " + std::string(Version())), std::string::npos) << result.err;
}

}  // namespace
}  // namespace roomtex
