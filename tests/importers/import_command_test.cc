// roomtex-import as users type it.

#include <filesystem>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "importers/ply.h"
#include "importers/ptx.h"
#include "importers/rtpi.h"
#include "tests/importers/rtpi_bytes.h"
#include "tests/support/matchers.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

class ImportCommand : public testing::Test {
 protected:
  ImportCommand() {
    columns_ = MakeColumns(12, 9);
    columns_[3].erase(columns_[3].begin() + 4);
    columns_[5][2].range = -1;
    WriteBytes(folder_ / "room.rtpi", Rtpi3Header(12, 9, "", "inches") + RtpiBody(columns_, true));
  }
  CommandResult Run(const std::string& arguments) {
    return RunCommandLine("roomtex-import " + arguments);
  }
  CommandResult RunOn(const std::string& input, const std::string& arguments) {
    return Run("--input_path " + (folder_ / input) + " " + arguments);
  }
  std::string Output(const std::string& name) { return " --output_path " + (folder_ / name); }
  std::string WriteTwoScans() {
    const std::string samples = "1 2 -1 0.5\n1 2 0 0.5\n1 2.1 -1 0.5\n1 2.1 0 0.5\n";
    const std::string start = "2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n";
    WriteBytes(folder_ / "two.ptx", start + "0 0 0 1\n" + samples + start + "9 0 0 1\n" + samples);
    return "two.ptx";
  }
  RawColumns columns_;
  TempFolder folder_;
};

TEST_F(ImportCommand, CutsPanoramasIntoFaces) {
  std::filesystem::create_directory(folder_ / "panoramas");
  for (const char* name : {"a.jpg", "b.png"}) {
    cv::imwrite(folder_ / "panoramas" + "/" + name,
                cv::Mat(128, 256, CV_8UC3, cv::Scalar(40, 90, 160)));
  }
  const CommandResult result =
      RunOn("panoramas", "--quiet --Faces.around 4 --Faces.poles 1 --report_path " +
                             (folder_ / "report.json") + Output("faces"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto report = nlohmann::json::parse(ReadBytes(folder_ / "report.json"));
  EXPECT_EQ(report["num_panoramas"], 2);
  for (const char* key : {"num_columns", "num_rows", "num_samples", "num_missing", "num_triangles",
                          "byte_order", "bounds"}) {
    EXPECT_TRUE(report.contains(key) && report[key].is_null()) << key;
  }
  EXPECT_THAT(result.out, HasSubstr("panoramas.json"));
  const auto json = nlohmann::json::parse(ReadBytes(folder_ / "faces/panoramas.json"));
  ASSERT_EQ(json["panoramas"].size(), 2u);
  EXPECT_EQ(json["panoramas"][1]["name"], "b.png");
  ASSERT_EQ(json["panoramas"][1]["faces"].size(), 6u);
  for (const auto& face : json["panoramas"][1]["faces"]) {
    const cv::Mat picture = cv::imread(folder_ / ("faces/" + face["name"].get<std::string>()));
    EXPECT_EQ(picture.cols, 81);  // 256 / pi
    EXPECT_NEAR(picture.at<cv::Vec3b>(40, 40)[2], 160, 3);
  }
  EXPECT_THAT(ReadBytes(folder_ / "faces/camera_options.txt"),
              HasSubstr("--ImageReader.camera_model SIMPLE_PINHOLE"));
  cv::imwrite(folder_ / "photo.jpg", cv::Mat(200, 300, CV_8UC3, cv::Scalar(0, 0, 0)));
  const CommandResult refused = RunOn("photo.jpg", Output("other"));
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(refused.err, HasSubstr("twice as wide as high"));
  // What another run cut does not stay among the new faces; what is not ours does.
  std::filesystem::remove(folder_ / "panoramas/a.jpg");
  WriteBytes(folder_ / "faces/a/notes.txt", "mine");
  ASSERT_EQ(
      RunOn("panoramas", "--quiet --Faces.around 4 --Faces.poles 0" + Output("faces")).exit_code,
      0);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "faces/a/face_1.jpg"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "faces/a/notes.txt"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "faces/b/face_4.jpg"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "faces/b/face_5.jpg"));
  // Nor does what such a file names elsewhere.
  auto hostile = nlohmann::json::parse(ReadBytes(folder_ / "faces/panoramas.json"));
  hostile["panoramas"][0]["faces"][0]["name"] = "../photo.jpg";
  hostile["panoramas"][0]["faces"][1]["name"] = "a/notes.txt";
  WriteBytes(folder_ / "faces/panoramas.json", hostile.dump());
  ASSERT_EQ(
      RunOn("panoramas", "--quiet --Faces.around 4 --Faces.poles 0" + Output("faces")).exit_code,
      0);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "photo.jpg"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "faces/a/notes.txt"));
  EXPECT_EQ(RunOn("panoramas", Output("panoramas")).exit_code, 2);
}

TEST_F(ImportCommand, WritesEveryFormatAndTheReport) {
  const CommandResult result = RunOn(
      "room.rtpi", "--quiet --report_path " + (folder_ / "report.json") + Output("a.ply") +
                       Output("a.pcd") + Output("a.png") + Output("a.rtpi") + Output("a.ptx"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, IsEmpty());
  EXPECT_THAT(result.out, HasSubstr("12 columns x 9 rows, 106 samples, 2 missing"));
  const auto report = nlohmann::json::parse(ReadBytes(folder_ / "report.json"));
  EXPECT_EQ(report["command"], "roomtex-import");
  EXPECT_EQ(report["num_columns"], 12);
  EXPECT_EQ(report["num_rows"], 9);
  EXPECT_EQ(report["num_samples"], 106);
  EXPECT_EQ(report["num_missing"], 2);
  EXPECT_EQ(report["byte_order"], "big");
  const Scan mesh = ReadPly(folder_ / "a.ply", {});
  EXPECT_EQ(report["num_triangles"], mesh.triangles.size());
  const Bounds bounds = FindBounds(mesh);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(report["bounds"]["min"][i].get<double>(), bounds.min[i], 1e-6);
    EXPECT_NEAR(report["bounds"]["max"][i].get<double>(), bounds.max[i], 1e-6);
  }
  const cv::Mat image = cv::imread(folder_ / "a.png", cv::IMREAD_UNCHANGED);
  EXPECT_EQ(image.type(), CV_8UC1);
  ASSERT_EQ(image.cols, 12);
  ASSERT_EQ(image.rows, 9);
  EXPECT_EQ(image.at<uchar>(8, 0), 0);     // intensity 0, the smallest
  EXPECT_EQ(image.at<uchar>(0, 11), 255);  // and the largest
  EXPECT_EQ(image.at<uchar>(4, 3), 0);     // missing
}

// Points in the order of the file with their colours, by way of a PLY.
struct ColoredPoints {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::vector<float>> rgb;
};

TEST_F(ImportCommand, ColoursOfTheScanGoWhereTheFormatHoldsThem) {
  // A grid of 3 columns x 2 rows, one sample missing; and the points alone.
  const std::string samples =
      "1 2 -1 0.5 255 0 7\n1 2 1 0.25 1 2 3\n1.5 2 -1 0.5 9 99 199\n0 0 0 0.5 0 0 0\n"
      "2 2 -1 1 0 0 0\n2 2 1 0 128 64 32\n";
  WriteBytes(folder_ / "grid.ptx",
             "3\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 "
             "0\n0 0 0 1\n" +
                 samples);
  WriteBytes(folder_ / "points.pts",
             "5\n1 2 -1 0.5 255 0 7\n1 2 1 0.25 1 2 3\n1.5 2 -1 0.5 9 99 199\n2 2 -1 1 0 0 "
             "0\n2 2 1 0 128 64 32\n");
  const auto read = [&](const std::string& file) {
    ColoredPoints result;
    EXPECT_EQ(RunOn(file, "--quiet" + Output("again.ply")).exit_code, 0) << file;
    PlyVertexValues values;
    values.names = {"red", "green", "blue", "intensity"};
    PlyOptions options;
    options.clouds = true;
    result.points = ReadPly(folder_ / "again.ply", options, nullptr, &values).points;
    result.rgb = values.values;
    return result;
  };
  for (const std::string input : {"grid.ptx", "points.pts"}) {
    const ColoredPoints truth = read(input);
    ASSERT_EQ(truth.points.size(), 5u);
    ASSERT_EQ(truth.rgb[1].size(), 5u) << input;
    EXPECT_EQ(truth.rgb[0][0] + truth.rgb[1][0] + truth.rgb[2][0],
              input == "grid.ptx" ? 1 + 2 + 3 : 255 + 7);
    for (const std::string extension : {"ptx", "e57", "pcd", "ply", "las", "xyz", "pts", "csv"}) {
      if (extension == "ptx" && input != "grid.ptx") continue;
      ASSERT_EQ(RunOn(input, "--quiet" + Output("copy." + extension)).exit_code, 0) << extension;
      const ColoredPoints copy = read("copy." + extension);
      ASSERT_EQ(copy.points.size(), truth.points.size()) << extension;
      for (size_t i = 0; i < truth.points.size(); ++i) {
        EXPECT_LT((copy.points[i] - truth.points[i]).norm(), 1e-4) << extension;
      }
      for (int k = 0; k < 3; ++k) EXPECT_EQ(copy.rgb[k], truth.rgb[k]) << extension;
      // LAS has whole numbers from 0 to 65535.
      const float largest = extension == "las" ? 65535 : 1;
      ASSERT_EQ(copy.rgb[3].size(), truth.rgb[3].size());
      for (size_t i = 0; i < truth.rgb[3].size(); ++i) {
        EXPECT_NEAR(copy.rgb[3][i] / largest, truth.rgb[3][i], 1e-5) << extension;
      }
    }
  }
}

TEST_F(ImportCommand, GreyOfTheColoursIsTheIntensityWhereThereIsNone) {
  WriteBytes(folder_ / "a.ply",
             "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
             "property float z\nproperty float red\nproperty float green\nproperty float blue\n"
             "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
             "0 0 0 1 0 0\n1 0 0 0 1 0\n0 1 0 0 0 0.2\n3 0 1 2\n");
  WriteBytes(folder_ / "b.obj", "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 0.2\nf 1 2 3\n");
  // 0xff0000, 0x00ff00 and 0x000033
  WriteBytes(folder_ / "c.pcd",
             "FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 3\nHEIGHT 1\n"
             "POINTS 3\nDATA ascii\n0 0 1 16711680\n1 0 1 65280\n0 1 1 51\n");
  for (const char* name : {"a.ply", "b.obj", "c.pcd"}) {
    ASSERT_EQ(RunOn(name, "--quiet" + Output("out.ply")).exit_code, 0) << name;
    PlyVertexValues values;
    values.names = {"intensity", "red", "green", "blue"};
    PlyOptions options;
    options.clouds = true;
    ReadPly(folder_ / "out.ply", options, nullptr, &values);
    ASSERT_EQ(values.values[1].size(), 3u) << name;
    EXPECT_THAT(values.values[1], testing::ElementsAre(255, 0, 0));
    EXPECT_THAT(values.values[2], testing::ElementsAre(0, 255, 0));
    EXPECT_THAT(values.values[3], testing::ElementsAre(0, 0, 51));
    const float* const grey = values.values[0].data();
    EXPECT_NEAR(grey[0] / grey[1], 0.299 / 0.587, 1e-3) << name;
    EXPECT_NEAR(grey[2] / grey[1], 0.2 * 0.114 / 0.587, 1e-3) << name;
  }
}

TEST_F(ImportCommand, RtpiToRtpiKeepsEverySample) {
  ASSERT_EQ(RunOn("room.rtpi", Output("copy.rtpi")).exit_code, 0);
  const std::string body = RtpiBody(columns_, true), copy = ReadBytes(folder_ / "copy.rtpi");
  EXPECT_THAT(copy, StartsWith("RTPI_version_3.0\n"));
  EXPECT_EQ(copy.substr(copy.size() - body.size()), body);
  WriteBytes(folder_ / "old.rtpi", "RTPIv2 12 9\n" + RtpiBody(columns_, false));
  ASSERT_EQ(RunOn("old.rtpi", "--units feet --max_range 30.48" + Output("new.rtpi")).exit_code, 0);
  const RtpiFile file = ReadRtpi(folder_ / "new.rtpi");
  EXPECT_EQ(file.header.version, 3);
  EXPECT_EQ(file.header.units, "feet");
  EXPECT_NEAR(*file.header.max_range, 100, 1e-9);
  const std::string bytes = ReadBytes(folder_ / "new.rtpi"), old_body = RtpiBody(columns_, false);
  EXPECT_EQ(bytes.substr(bytes.size() - old_body.size()), old_body);
}

TEST_F(ImportCommand, AzimuthMirrorsTheRoom) {
  ASSERT_EQ(RunOn("room.rtpi", Output("a.ply")).exit_code, 0);
  ASSERT_EQ(RunOn("room.rtpi", "--azimuth counterclockwise" + Output("b.ply")).exit_code, 0);
  const Scan a = ReadPly(folder_ / "a.ply", {}), b = ReadPly(folder_ / "b.ply", {});
  ASSERT_EQ(a.points.size(), b.points.size());
  for (size_t i = 0; i < a.points.size(); ++i) {
    EXPECT_THAT(
        b.points[i],
        IsNearMatrix(Eigen::Vector3d(a.points[i].cwiseProduct(Eigen::Vector3d(-1, 1, 1))), 0));
  }
}

TEST_F(ImportCommand, SeveralScansGoIntoOneMeshOnePtxAndNumberedClouds) {
  const CommandResult result =
      RunOn(WriteTwoScans(), Output("all.ply") + Output("all.ptx") + Output("all.pcd") +
                                 " --report_path " + (folder_ / "r.json"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("all_2.pcd"));
  EXPECT_EQ(ReadPtx(folder_ / "all.ptx", {}).size(), 2u);
  EXPECT_EQ(ReadPly(folder_ / "all.ply", {}).points.size(), 8u);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "all_1.pcd"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "all.pcd"));
  const auto report = nlohmann::json::parse(ReadBytes(folder_ / "r.json"));
  EXPECT_EQ(report["scans"].size(), 2u);
  EXPECT_EQ(report["num_samples"], 8);
}

TEST_F(ImportCommand, AMeshDoesNotBecomeAGrid) {
  ASSERT_EQ(RunOn("room.rtpi", Output("a.ply")).exit_code, 0);
  ASSERT_EQ(RunOn("a.ply", Output("b.ply")).exit_code, 0);
  EXPECT_EQ(ReadBytes(folder_ / "a.ply"), ReadBytes(folder_ / "b.ply"));
  const CommandResult result = RunOn("a.ply", Output("c.ply") + Output("c.pcd"));
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.err, HasSubstr("mesh without a grid"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "c.ply"));
}

TEST_F(ImportCommand, WrongUsageIsToldBeforeTheInputIsRead) {
  const std::pair<std::string, const char*> cases[] = {
      {Output("a.stl"), ".ply, .pcd, .png, .rtpi, .ptx"},
      {Output("a"), "unknown extension"},
      {Output("a.ply") + Output("a.ply"), "is given twice"},
      {Output("a.ply") + " --Mesh.max_edge_ratio 0.5", "--Mesh.max_edge_ratio"},
      {Output("a.ply") + " --max_range -1", "--max_range"},
      {Output("a.ply") + " --azimuth left", "--azimuth"},
      {Output("a.ply") + " --units miles", "--units"},
      {Output("a.ply") + " --colour 1", "--colour"}};
  for (const auto& [arguments, text] : cases) {
    const CommandResult result = RunOn("no_such_file.rtpi", arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments;
    EXPECT_THAT(result.err, HasSubstr(text));
    EXPECT_THAT(result.out, IsEmpty());
  }
}

TEST_F(ImportCommand, NamesNoFileThatDoesNotAppear) {
  const CommandResult result = RunOn("room.rtpi", "--report_path /sys/r.json" + Output("a.ply"));
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_EQ(result.out, "");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "a.ply"));
}

TEST_F(ImportCommand, TheInputIsNeverOverwritten) {
  const std::string before = ReadBytes(folder_ / "room.rtpi");
  std::filesystem::create_symlink(folder_ / "room.rtpi", folder_ / "link.rtpi");
  for (const std::string name : {"room.rtpi", "./room.rtpi", "link.rtpi"}) {
    const CommandResult result = RunOn("room.rtpi", Output(name));
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.err, HasSubstr("is the input"));
  }
  EXPECT_EQ(ReadBytes(folder_ / "room.rtpi"), before);
}

TEST_F(ImportCommand, UnusableFilesExitWith3AndOneSentence) {
  WriteBytes(folder_ / "cut.rtpi", ReadBytes(folder_ / "room.rtpi").substr(0, 1000));
  WriteBytes(folder_ / "empty.rtpi", "");
  const std::pair<std::string, std::string> cases[] = {{"cut.rtpi", "column 5 has 9 samples"},
                                                       {"empty.rtpi", "is empty"},
                                                       {"none.rtpi", "does not exist"},
                                                       {".", "holds no photos"}};
  for (const auto& [name, text] : cases) {
    const CommandResult result = RunOn(name, "--quiet" + Output("out.ply"));
    EXPECT_EQ(result.exit_code, 3) << name;
    EXPECT_THAT(result.err, HasSubstr(text));
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out.ply"));
  }
  const CommandResult result = RunOn("room.rtpi", "--quiet" + Output("no/folder/out.ply"));
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.err, HasSubstr("cannot be written"));
}

TEST_F(ImportCommand, AssumptionsAreWarnings) {
  WriteBytes(folder_ / "old.rtpi", "RTPIv2 12 9\n" + RtpiBody(columns_, false));
  const CommandResult result =
      RunOn("old.rtpi", Output("a.png") + " --report_path " + (folder_ / "r.json"));
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.err, HasSubstr("metres assumed"));
  EXPECT_EQ(nlohmann::json::parse(ReadBytes(folder_ / "r.json"))["warnings"].size(), 1u);
}

TEST_F(ImportCommand, HelpBeginsWithAnExample) {
  const CommandResult result = Run("--help");
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.out, StartsWith("Example:\n  roomtex-import --input_path room.rtpi"));
  for (const char* option : {"--azimuth", "--units", "--max_range", "--Mesh.max_edge_ratio"}) {
    EXPECT_THAT(result.out, HasSubstr(option));
  }
}

}  // namespace
}  // namespace roomtex
