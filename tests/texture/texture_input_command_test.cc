// What roomtex-texture takes, refuses and leaves out.

#include <gmock/gmock.h>

#include "importers/rtpi.h"
#include "importers/scan_writer.h"
#include "tests/texture/texture_command.h"

namespace roomtex {
namespace {

TEST_F(TextureCommand, DoesNotWriteOverTheScanItReads) {
  fs::create_directories(Path("own"));
  fs::copy_file(Capture() + "/scan.rtpi", Path("own/model.rtpi"));
  const CommandResult result = Texture("own", "", Path("own/model.rtpi"));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("inputs are never changed"), std::string::npos) << result.err;
  EXPECT_EQ(ReadBytes(Path("own/model.rtpi")), ReadBytes(Capture() + "/scan.rtpi"));
}

TEST_F(TextureCommand, UnalignedModelIsNotTrusted) {
  SparseModel model = ReadSparseModel(Capture() + "/truth");
  TransformModel({0.4, Eigen::Quaterniond(0.5, 0.5, 0.5, 0.5), {30, 40, 50}}, &model);
  WriteSparseModel(model, Path("unaligned"));
  const CommandResult result = RunCommandLine(
      "roomtex-texture --quiet --input_path " + Path("unaligned") + " --image_path " + Capture() +
      "/photos --scan_path " + Capture() + "/scan.rtpi --output_path " + Path("nowhere"));
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_NE(result.err.find("roomtex-align"), std::string::npos) << result.err;
  EXPECT_FALSE(ReadJson(Path("nowhere/report.json"))["trusted"]);
}

TEST_F(TextureCommand, BadInputGetsASentence) {
  const std::string photos = Capture() + "/photos", scan = Capture() + "/scan.rtpi";
  const auto expect = [](const std::string& line, int exit_code, const std::string& text) {
    const CommandResult result = RunCommandLine("roomtex-texture --quiet " + line);
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    EXPECT_NE(result.err.find(text), std::string::npos) << result.err;
  };
  const std::string model = " --input_path " + Capture() + "/truth";
  const std::string rest = " --output_path " + Path("bad");
  expect(model + " --image_path " + Path("none") + " --scan_path " + scan + rest, 3, "none");
  expect(model + " --image_path " + photos + " --scan_path " + photos + rest, 3, "is a folder");
  expect(model + " --image_path " + photos + " --scan_path " + photos + "/photo_000.jpg" + rest, 3,
         "is a JPEG photo");
  expect(" --input_path " + photos + " --image_path " + photos + " --scan_path " + scan + rest, 3,
         "no COLMAP model");
  expect(model + " --image_path " + photos + rest, 2, "--scan_path is required");
  const std::string all = model + " --image_path " + photos + " --scan_path " + scan;
  expect(all + " --output_path " + scan, 2, "inputs are never changed");
  for (const char* below : {"", "/textured"}) {
    expect(all + " --output_path " + photos + below, 2, "lies in the folder of the photos");
  }
  expect(all + rest + " --Texture.scale -1", 2, "Texture.scale must be 1 to 16");
  expect(all + rest + " --Texture.scale fine", 2, "Texture.scale");
  expect(all + rest + " --Texture.max_memory_mb 1", 2, "Texture.max_memory_mb");
  expect(all + rest + " --Occlusion.depth_tolerance 2", 2, "Occlusion.depth_tolerance");
  expect(all + rest + " --Exposure.mode guess", 2, "exif, match or none");
  expect(all + rest + " --associations_path " + Path("none.csv"), 3, "does not exist");
  expect(all + rest + " --database_path " + scan, 3, "SQLite");
}

TEST_F(TextureCommand, AnAlignedModelNeedsNoScanAndReadsItAsItWasAligned) {
  const std::string model = Aligned("aligned", true);
  const CommandResult result = TextureAligned(model, "");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(ReadBytes(Path("textured_aligned/model.ply")), ReadBytes(Path("textured/model.ply")));
  const CommandResult other = TextureAligned(model, "--azimuth counterclockwise");
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_NE(other.err.find("--azimuth counterclockwise contradicts the alignment"),
            std::string::npos)
      << other.err;
  const CommandResult mesh =
      TextureAligned(model, "--scan_path " + Capture() + "/truth/true_colors.ply");
  EXPECT_EQ(mesh.exit_code, 3);
  EXPECT_NE(mesh.err.find("is another scan"), std::string::npos) << mesh.err;
}

TEST_F(TextureCommand, DoubtsOfTheAlignmentAreThoseOfTheColours) {
  const std::string model = Aligned("doubtful", false);
  const CommandResult result = TextureAligned(model, "");
  EXPECT_EQ(result.exit_code, 4) << result.err;
  const json report = ReadJson(Path("textured_aligned/report.json"));
  EXPECT_EQ(report["trusted"], false);
  EXPECT_NE(report["reason"].get<std::string>().find("Too few points lie on the surface"),
            std::string::npos);
  EXPECT_EQ(TextureAligned(model, "--accept_untrusted 1").exit_code, 0);
  EXPECT_EQ(ReadJson(Path("textured_aligned/report.json"))["warnings"].size(), 1u);
}

TEST_F(TextureCommand, DoubtsOfTheSupplementAreThoseOfTheColours) {
  Scan triangle;
  triangle.organised = false;
  triangle.points = {{0.1, 0.1, 1}, {0.3, 0.1, 1}, {0.1, 0.3, 1}};
  triangle.num_columns = 3;
  triangle.num_rows = 1;
  triangle.intensity = {1, 2, 3};
  fs::create_directories(Path("dense"));
  WriteScan(triangle, {{0, 1, 2}}, Path("dense/supplement.ply"));
  const std::string more = "--supplement_path " + Path("dense/supplement.ply");
  const auto report = [] { return ReadJson(Path("supplemented/report.json")); };
  const CommandResult unknown = Texture("supplemented", more);
  ASSERT_EQ(unknown.exit_code, 0) << unknown.err;
  EXPECT_EQ(report()["supplement"]["num_vertices"], 3);
  const auto say = [](const std::string& command, bool trusted) {
    WriteJson(Path("dense/report.json"),
              {{"command", command},
               {"trusted", trusted},
               {"reason", trusted ? "" : "The photos stand elsewhere."}});
  };
  say("roomtex-dense", true);
  EXPECT_EQ(Texture("supplemented", more).exit_code, 0);
  say("roomtex-import", false);  // of something else
  EXPECT_EQ(Texture("supplemented", more).exit_code, 0);
  say("roomtex-dense", false);
  EXPECT_EQ(Texture("supplemented", more).exit_code, 4);
  EXPECT_EQ(report()["trusted"], false);
  EXPECT_THAT(report()["reason"].get<std::string>(),
              testing::HasSubstr("is not to be trusted: The photos stand elsewhere."));
  EXPECT_EQ(Texture("supplemented", more + " --accept_untrusted 1").exit_code, 0);
  EXPECT_THAT(report()["warnings"].dump(), testing::HasSubstr("The photos stand elsewhere."));
}

TEST_F(TextureCommand, SaysWhyTheAlignmentWasRefused) {
  fs::create_directories(Path("refused"));
  const auto refuse = [](const std::string& reason) {
    WriteJson(Path("refused/alignment.json"),
              {{"command", "roomtex-align"}, {"trusted", false}, {"reason", reason}});
    const CommandResult result = TextureAligned(Path("refused"), "");
    EXPECT_EQ(result.exit_code, 3);
    EXPECT_THAT(result.err, testing::HasSubstr("refused to align"));
    EXPECT_THAT(result.err, testing::HasSubstr("lign anew"));
    return result.err;
  };
  EXPECT_THAT(refuse("The picks lie on a line."),
              testing::HasSubstr("The picks lie on a line. Align anew"));
  refuse("");
}

// Where no photo sees, the colours of the scan's file stand, also where the model remembers which
// file that was and of stations one by one; a scan that has none stays grey.
TEST_F(TextureCommand, UnseenSamplesHaveTheScansOwnColoursAsAsked) {
  const Scan scan = ReadCaptureScan();
  std::vector<Eigen::Matrix<uint8_t, 3, 1>> own;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    own.emplace_back(static_cast<uint8_t>(1 + i % 250), 20, static_cast<uint8_t>(i / 500));
  }
  WriteColoredRtpi(Capture() + "/scan.rtpi", own, Path("own_colors.rtpi"));
  // Of every stride-th column and row.
  const auto expect_own = [&](const std::string& folder, int stride) {
    const PlyVertices model = ReadPly(Path(folder + "/model.ply"));
    size_t vertex = 0, num_unseen = 0;
    for (int row = 0; row < scan.num_rows; row += stride) {
      for (int column = 0; column < scan.num_columns; column += stride) {
        const int i = scan.Index(column, row);
        if (scan.IsMissing(i)) continue;
        ASSERT_LT(vertex, model.points.size());
        if (model.views[vertex] == 0) {
          ++num_unseen;
          for (int k = 0; k < 3; ++k) ASSERT_EQ(model.colors[vertex][k], own[i][k]) << i;
        }
        ++vertex;
      }
    }
    EXPECT_GT(num_unseen, 100u) << folder;
  };
  const std::string unseen = " --Texture.unseen scan ";
  const CommandResult given = Texture("own_given", unseen, Path("own_colors.rtpi"));
  ASSERT_EQ(given.exit_code, 0) << given.err;
  expect_own("own_given", 1);
  const PlyVertices model = ReadPly(Path("own_given/model.ply")),
                    grey = ReadPly(Path("textured/model.ply"));
  ASSERT_EQ(model.views, grey.views);
  for (size_t i = 0; i < model.views.size(); ++i) {
    if (model.views[i] > 0) {
      ASSERT_EQ(model.colors[i], grey.colors[i]);
    }
  }

  const std::string aligned = Aligned("own_aligned", true, Path("own_colors.rtpi"));
  ASSERT_EQ(TextureAligned(aligned, unseen).exit_code, 0);
  expect_own("textured_aligned", 1);

  fs::copy(Path("own_colors.rtpi"), Path("own_again.rtpi"));
  WriteBytes(Path("own_poses.txt"),
             "own_colors.rtpi 1 0 0 0 0 0 0\nown_again.rtpi 1 0 0 0 0 0 0\n");
  const CommandResult stations =
      Texture("own_stations",
              unseen + "--max_samples 100000 --scan_path " + Path("own_again.rtpi") +
                  " --scan_poses " + Path("own_poses.txt"),
              Path("own_colors.rtpi"));
  ASSERT_EQ(stations.exit_code, 0) << stations.err;
  EXPECT_EQ(ReadJson(Path("own_stations/report.json"))["sample_stride"], 2);
  expect_own("own_stations", 2);
  expect_own("own_stations/station_1", 1);

  ASSERT_EQ(Texture("own_none", unseen).exit_code, 0);
  EXPECT_EQ(ReadBytes(Path("own_none/model.ply")), ReadBytes(Path("textured/model.ply")));
  EXPECT_THAT(ReadJson(Path("own_none/report.json"))["warnings"].dump(),
              testing::HasSubstr("has no colours of its own"));
}

TEST_F(TextureCommand, NamesFilesOfAnEarlierRunThatItDoesNotWrite) {
  ASSERT_EQ(Texture("older", "--output_obj 1").exit_code, 0);
  ASSERT_EQ(Texture("older", "--output_web 0 --output_evidence 0").exit_code, 0);
  const std::string warnings = ReadJson(Path("older/report.json"))["warnings"].dump();
  for (const char* name :
       {"evidence.ply", "model_web.glb", "model.obj", "model.mtl", "model_0.png"}) {
    EXPECT_THAT(warnings, testing::HasSubstr(name));
  }
  for (const char* name : {"model.ply", "texture.png", "model.rtpi", "report.json"}) {
    EXPECT_THAT(warnings, testing::Not(testing::HasSubstr(name)));
  }
}

// One photo is gone, one ends before its picture does; the others colour.
TEST_F(TextureCommand, LeavesOutPhotosThatCannotBeUsed) {
  const std::string photos = Path("some_photos");
  fs::copy(Capture() + "/photos", photos);
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(photos)) {
    names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  fs::remove(photos + "/" + names[2]);
  const std::string bytes = ReadBytes(photos + "/" + names[5]);
  WriteBytes(photos + "/" + names[5], bytes.substr(0, bytes.size() / 2));
  const auto run = [&](const std::string& more) {
    return RunCommandLine("roomtex-texture --quiet --Texture.scale 1 --input_path " + Capture() +
                          "/truth --image_path " + photos + " --scan_path " + Capture() +
                          "/scan.rtpi --output_path " + Path("some") + more);
  };
  const CommandResult strict = run(" --strict 1");
  EXPECT_EQ(strict.exit_code, 3);
  EXPECT_NE(strict.err.find(names[2]), std::string::npos) << strict.err;
  EXPECT_FALSE(fs::exists(Path("some/model.ply")));
  const CommandResult result = run("");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json report = ReadJson(Path("some/report.json"));
  ASSERT_EQ(report["photos_left_out"].size(), 2u);
  EXPECT_EQ(report["photos_left_out"][0]["name"], names[2]);
  EXPECT_EQ(report["photos_left_out"][1]["name"], names[5]);
  EXPECT_EQ(report["num_photos"], 10);
  EXPECT_EQ(ReadJson(Path("textured/report.json"))["photos_left_out"].size(), 0u);
}

}  // namespace
}  // namespace roomtex
