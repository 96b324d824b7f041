// What roomtex-texture takes, refuses and leaves out.

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
