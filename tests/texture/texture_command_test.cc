// roomtex-texture as a user calls it, on a simulated capture with true poses: files and colours.

#include "tests/texture/texture_command.h"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "importers/scan_writer.h"
#include "texture/output/evidence.h"
#include "texture/sampling/blend.h"

namespace roomtex {
namespace {

TEST_F(TextureCommand, WritesTheFilesAndTheReportOfTheContract) {
  ASSERT_EQ(result_.exit_code, 0) << result_.err;
  EXPECT_EQ(result_.err, "");
  const json report = ReadJson(Path("textured/report.json"));
  const Scan scan = ReadCaptureScan();
  EXPECT_EQ(report["num_vertices"], scan.points.size() - scan.NumMissing());
  EXPECT_GT(report["coverage"], 0.5);
  EXPECT_GT(report["views_mean"], 1.0);
  EXPECT_EQ(report["exposure_gain"].size(), 12u);
  EXPECT_LT(report["disagreement"]["after"], report["disagreement"]["before"]);
  EXPECT_TRUE(report["trusted"]);
  EXPECT_GT(report.at("exif_scatter_ev"), 0);
  const cv::Mat texture = cv::imread(Path("textured/texture.png"));
  EXPECT_EQ(texture.cols, 500);
  EXPECT_EQ(texture.rows, 190);
}

TEST_F(TextureCommand, VerticesAreTheMeasuredSamplesInGridOrder) {
  ASSERT_EQ(result_.exit_code, 0) << result_.err;
  const PlyVertices model = ReadPly(Path("textured/model.ply"));
  const Scan scan = ReadCaptureScan();
  size_t vertex = 0;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (scan.IsMissing(static_cast<int>(i))) continue;
    ASSERT_LT(vertex, model.points.size());
    ASSERT_LT((model.points[vertex].cast<double>() - scan.points[i]).norm(), 1e-6);
    ++vertex;
  }
  EXPECT_EQ(vertex, model.points.size());
  size_t num_colored = 0;
  for (int views : model.views) num_colored += views > 0;
  EXPECT_EQ(ReadJson(Path("textured/report.json"))["num_colored"], num_colored);
}

TEST_F(TextureCommand, EvidenceIsThatOfTheVerticesAndOfTheReport) {
  ASSERT_EQ(result_.exit_code, 0) << result_.err;
  const PlyVertices model = ReadPly(Path("textured/model.ply"));
  const Evidence evidence = ReadEvidence(Path("textured/evidence.ply"));
  ASSERT_EQ(evidence.points.size(), model.points.size());
  double sum = 0, num_pairs = 0;
  for (size_t i = 0; i < model.points.size(); ++i) {
    ASSERT_EQ(evidence.points[i].cast<float>(), model.points[i]);
    ASSERT_EQ(evidence.views[i], model.views[i]);
    if (model.views[i] < 2) continue;
    ASSERT_TRUE(std::isfinite(evidence.disagreement[i]));
    const int kept = std::min(model.views[i], BlendOptions().max_views);
    sum += evidence.disagreement[i] * kept * (kept - 1) / 2;
    num_pairs += kept * (kept - 1) / 2;
  }
  // The report looks at a part of the vertices.
  const double reported = ReadJson(Path("textured/report.json"))["disagreement"]["after"];
  EXPECT_NEAR(sum / num_pairs, reported, 0.05 * reported);
}

TEST_F(TextureCommand, APhotoThatShowsSomethingElseIsNamedAndGivesNoColour) {
  fs::copy(Capture() + "/photos", Path("foreign"));
  const auto overwrite = fs::copy_options::overwrite_existing;
  fs::copy_file(Path("foreign/photo_009.jpg"), Path("foreign/photo_003.jpg"), overwrite);
  const auto run = [](const std::string& output, const std::string& more) {
    return RunCommandLine("roomtex-texture --quiet --Texture.scale 1 --input_path " + Capture() +
                          "/truth --image_path " + Path("foreign") + " --scan_path " + Capture() +
                          "/scan.rtpi --output_path " + Path(output) + more);
  };
  const CommandResult result = run("without_foreign", "");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json report = ReadJson(Path("without_foreign/report.json"));
  ASSERT_EQ(report["photos_left_out"].size(), 1u);
  EXPECT_EQ(report["photos_left_out"][0]["name"], "photo_003.jpg");
  EXPECT_FALSE(report["exposure_gain"].contains("photo_003.jpg"));
  for (const auto& [name, photo] : report["photo_agreement"].items()) {
    EXPECT_GT(photo["correlation"], 0.9) << name;
  }
  ASSERT_EQ(report["photo_sharpness"].size(), report["photo_agreement"].size());
  for (const auto& [name, photo] : report["photo_sharpness"].items()) {
    EXPECT_GT(photo["sharpness"], 0.85) << name;
    EXPECT_EQ(photo["weight"], 1) << name;
    EXPECT_GT(photo["num_samples"], 0) << name;
  }
  const PlyVertices truth = ReadPly(Capture() + "/truth/true_colors.ply");
  ASSERT_EQ(run("with_foreign", " --Blend.min_agreement 0").exit_code, 0);
  EXPECT_GT(Psnr(ReadPly(Path("without_foreign/model.ply")), truth),
            Psnr(ReadPly(Path("with_foreign/model.ply")), truth) + 1);
  const CommandResult strict = run("strict", " --strict 1");
  EXPECT_EQ(strict.exit_code, 3);
  EXPECT_NE(strict.err.find("photo_003.jpg"), std::string::npos) << strict.err;
}

// In a cloud that does not show where its scanner stood a photo may look at the backs of things:
// one that contradicts the others is named only.
TEST_F(TextureCommand, WithoutShadowsAPhotoThatShowsSomethingElseStays) {
  fs::copy(Capture() + "/photos", Path("foreign_of_cloud"));
  fs::copy_file(Path("foreign_of_cloud/photo_009.jpg"), Path("foreign_of_cloud/photo_003.jpg"),
                fs::copy_options::overwrite_existing);
  for (const bool is_known : {true, false}) {
    Scan cloud = ReadCaptureScan();
    cloud.up = Eigen::Vector3d::UnitZ();               // about it the angles show no grid
    cloud.scan_from_station.translation = {50, 0, 0};  // the station has to be found
    for (size_t i = 0; !is_known && i < cloud.points.size(); ++i) {
      if (i % 5 != 0) cloud.points[i] = Scan::MissingPoint();  // so few points do not show it
    }
    WriteScan(cloud, {}, Path("foreign_cloud.ply"));
    const CommandResult result =
        RunCommandLine("roomtex-texture --quiet --Texture.scale 1 --input_path " + Capture() +
                       "/truth --image_path " + Path("foreign_of_cloud") + " --scan_path " +
                       Path("foreign_cloud.ply") + " --output_path " + Path("of_foreign_cloud"));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const json report = ReadJson(Path("of_foreign_cloud/report.json"));
    EXPECT_EQ(report["photos_left_out"].size(), is_known ? 1u : 0u);
    EXPECT_EQ(report["exposure_gain"].contains("photo_003.jpg"), !is_known);
    const std::string warnings = report["warnings"].dump();
    const size_t at = warnings.find("is not what the others show at the same places");
    EXPECT_EQ(at != std::string::npos, !is_known) << warnings;
    EXPECT_EQ(warnings.find("photo_003.jpg", std::min(at, warnings.size())) != std::string::npos,
              !is_known)
        << warnings;
  }
}

// As two projectors that throw one pattern fold a room: half of the photos stand together where
// they would be if the room was turned by half a circle.
TEST_F(TextureCommand, AGroupOfPhotosInTheWrongPlaceIsNotTrusted) {
  SparseModel model = ReadSparseModel(Capture() + "/truth");
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const auto& [id, image] : model.images) {
    middle +=
        image.cam_from_model.TargetOriginInSource() / static_cast<double>(model.images.size());
  }
  Rigid half_circle;
  half_circle.rotation = Eigen::AngleAxisd(std::acos(-1.0), Eigen::Vector3d::UnitY());
  half_circle.translation = middle - half_circle.rotation * middle;
  for (auto& [id, image] : model.images) {
    if (image.name >= "photo_006.jpg") image.cam_from_model = image.cam_from_model * half_circle;
  }
  WriteSparseModel(model, Path("folded"));
  const CommandResult result =
      RunCommandLine("roomtex-texture --quiet --Texture.scale 1 --input_path " + Path("folded") +
                     " --image_path " + Capture() + "/photos --scan_path " + Capture() +
                     "/scan.rtpi --Blend.min_agreement 0 --output_path " + Path("of_folded"));
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_NE(result.err.find("contradict each other where"), std::string::npos) << result.err;
  const json report = ReadJson(Path("of_folded/report.json")),
             right = ReadJson(Path("textured/report.json"));
  EXPECT_FALSE(report["trusted"]);
  EXPECT_GT(report["divided_photos"]["share_of_unlike"], 0.3);
  EXPECT_GT(right["divided_photos"]["num_samples"], 1000);
  EXPECT_LT(right["divided_photos"]["share_of_unlike"], 0.1);
}

TEST_F(TextureCommand, WhoStoodBeforeTheWallIsNamedAndGivesNoColour) {
  SimulatedRoomOptions options = RoomOptions();
  options.strangers = 0.5;
  Progress progress(true);
  WriteCapture(SimulatedRoom(options), Path("visited"), &progress);
  const auto run = [](const std::string& output, const std::string& more) {
    const CommandResult result = RunCommandLine(
        "roomtex-texture --quiet --Texture.scale 1 --input_path " + Path("visited/truth") +
        " --image_path " + Path("visited/photos") + " --scan_path " + Path("visited/scan.rtpi") +
        " --output_path " + Path(output) + more);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return ReadJson(Path(output + "/report.json"));
  };
  const json with = run("left_out", ""), without = run("kept", " --Blend.leave_out_moving 0");
  EXPECT_NE(with["warnings"].dump().find("photo_001.jpg"), std::string::npos) << with["warnings"];
  for (const auto& [name, photo] : with["photo_agreement"].items()) {
    const bool visited = name.find_first_of("13579", 8) == 8;  // every other photo: photo_001.jpg
    EXPECT_EQ(photo["moving"] > 0, visited) << name << " " << photo["moving"];
    EXPECT_LT(photo["moving"], 0.25) << name;
    EXPECT_EQ(without["photo_agreement"][name]["moving"], 0);
  }
  EXPECT_GT(with["num_colored"], 0.99 * without["num_colored"].get<double>());
  // Who is left out is no photo that sees the wall, and differs from none.
  EXPECT_LT(with["views_mean"], without["views_mean"]);
  EXPECT_LT(with["disagreement"]["after"], 0.8 * without["disagreement"]["after"].get<double>());
  const PlyVertices truth = ReadPly(Path("visited/truth/true_colors.ply"));
  EXPECT_GT(Psnr(ReadPly(Path("left_out/model.ply")), truth),
            Psnr(ReadPly(Path("kept/model.ply")), truth) + 0.7);
}

TEST_F(TextureCommand, EvidenceIsLeftOutAsAsked) {
  ASSERT_EQ(Texture("bare", "--output_evidence 0").exit_code, 0);
  EXPECT_TRUE(fs::exists(Path("bare/model.ply")));
  EXPECT_FALSE(fs::exists(Path("bare/evidence.ply")));
}

TEST_F(TextureCommand, ColoursAreTheTrueOnes) {
  ASSERT_EQ(result_.exit_code, 0) << result_.err;
  const PlyVertices truth = ReadPly(Capture() + "/truth/true_colors.ply");
  const double psnr = Psnr(ReadPly(Path("textured/model.ply")), truth);
  EXPECT_GT(psnr, 24.5);  // 25.3 measured: a photo pixel is 4 mm wide, the texture has 1.5 mm
  // Exposures differ by up to an EV either way: without unification the colours are far off.
  ASSERT_EQ(Texture("plain", "--Exposure.mode none").exit_code, 0);
  EXPECT_GT(psnr, Psnr(ReadPly(Path("plain/model.ply")), truth) + 3);
  EXPECT_TRUE(ReadJson(Path("plain/report.json")).at("exif_scatter_ev").is_null());
  // EXIF alone, as in the thesis, does nearly as well as matching.
  ASSERT_EQ(Texture("exif", "--Exposure.mode exif").exit_code, 0);
  EXPECT_GT(Psnr(ReadPly(Path("exif/model.ply")), truth), psnr - 1.5);
}

TEST_F(TextureCommand, UnseenSamplesAreGreyOrBlackAsAsked) {
  ASSERT_EQ(Texture("black", "--Texture.unseen black").exit_code, 0);
  const PlyVertices grey = ReadPly(Path("textured/model.ply"));
  const PlyVertices black = ReadPly(Path("black/model.ply"));
  ASSERT_EQ(grey.points.size(), black.points.size());
  size_t num_unseen = 0;
  for (size_t i = 0; i < grey.points.size(); ++i) {
    ASSERT_EQ(grey.views[i], black.views[i]);
    if (grey.views[i] > 0) continue;
    ++num_unseen;
    ASSERT_EQ(black.colors[i].maxCoeff(), 0);
    ASSERT_EQ(grey.colors[i].minCoeff(), grey.colors[i].maxCoeff());
  }
  EXPECT_GT(num_unseen, 100u);
}

TEST_F(TextureCommand, GivesTheSameBytesOnOneThreadAndOnThree) {
  ASSERT_EQ(Texture("one", "--num_threads 1 --Mesh.max_triangles 9000").exit_code, 0);
  ASSERT_EQ(Texture("three", "--num_threads 3 --Mesh.max_triangles 9000").exit_code, 0);
  for (const char* name :
       {"model.ply", "model.glb", "model_web.glb", "texture.png", "model.rtpi"}) {
    EXPECT_EQ(ReadBytes(Path("one/") + name), ReadBytes(Path("three/") + name)) << name;
  }
}

// The true colours between the samples: the same room, scanned more finely.
double TexturePsnr(const cv::Mat3b& texture, SimulatedRoomOptions room) {
  room.scan_columns = texture.cols;
  room.scan_rows = texture.rows;
  room.missing_samples = false;
  const std::vector<Eigen::Vector3f> truth = SimulatedRoom(room).TrueColors();
  const auto& linear = LinearFromSrgbByte();
  double cross = 0, square = 0, error = 0, count = 0;
  for (const bool measure : {false, true}) {
    for (size_t i = 0; i < truth.size(); ++i) {
      const cv::Vec3b& c =
          texture(static_cast<int>(i) / texture.cols, static_cast<int>(i) % texture.cols);
      if (c[0] + c[1] + c[2] == 0) continue;
      for (int k = 0; k < 3; ++k) {
        const double have = linear[c[2 - k]], want = truth[i][k];
        if (measure) {
          const double light = std::min(1.0, cross / square * have);
          error += std::pow(SrgbFromLinear(light) - SrgbFromLinear(want), 2);
          ++count;
        } else {
          cross += have * want;
          square += have * have;
        }
      }
    }
  }
  return -10 * std::log10(error / count);
}

TEST_F(TextureCommand, ALargerScaleShowsTheRoomBetweenTheSamples) {
  ASSERT_EQ(Texture("coarse", "--Texture.unseen black").exit_code, 0);
  const CommandResult result = Texture("fine", "--Texture.scale 3 --Texture.unseen black");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const cv::Mat3b coarse = cv::imread(Path("coarse/texture.png"));
  const cv::Mat3b fine = cv::imread(Path("fine/texture.png"));
  ASSERT_EQ(fine.size(), cv::Size(1500, 570));
  EXPECT_EQ(ReadJson(Path("fine/report.json"))["texture_scale"], 3);
  cv::Mat3b enlarged;
  cv::resize(coarse, enlarged, fine.size(), 0, 0, cv::INTER_NEAREST);
  const double psnr = TexturePsnr(fine, RoomOptions());
  EXPECT_GT(psnr, 23.5);
  EXPECT_GT(psnr, TexturePsnr(enlarged, RoomOptions()) + 3);
  // The vertices are the same ones.
  EXPECT_EQ(ReadBytes(Path("fine/model.ply")), ReadBytes(Path("coarse/model.ply")));
}

TEST_F(TextureCommand, IsEvaluatedBetweenTheSamples) {
  ASSERT_EQ(Texture("evaluated", "--Texture.scale 2 --Texture.unseen black").exit_code, 0);
  const CommandResult result = RunCommandLine(
      "roomtex-evaluate-texture --quiet --texture_path " + Path("evaluated/texture.png") +
      " --seed 5 --scan_columns 500 --report_path " + Path("evaluation.json"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json said = json::parse(result.out), report = ReadJson(Path("evaluation.json"));
  for (const char* name : {"scale", "gain", "psnr_db", "share_wrong"}) {
    EXPECT_EQ(report.at(name), said.at(name)) << name;
  }
  EXPECT_EQ(report["scale"], 2);
  EXPECT_GT(report["psnr_db"], 21);  // 22.0 measured
}

TEST_F(TextureCommand, ChoosesTheScaleByThePhotosAndTheMemory) {
  // auto, or 0 where a number is wanted.
  ASSERT_EQ(Texture("auto", "--Texture.scale 0").exit_code, 0);
  const json report = ReadJson(Path("auto/report.json"));
  const int scale = report["texture_scale"];
  EXPECT_EQ(scale, std::min(4.0, std::ceil(report["pixels_per_sample"].get<double>())));
  EXPECT_GT(scale, 1);
  EXPECT_EQ(cv::imread(Path("auto/texture.png")).cols, 500 * scale);
}

TEST_F(TextureCommand, DebugPicturesAddUpToTheResult) {
  const CommandResult result =
      Texture("plain_blend", "--Blend.detail 0 --Texture.unseen black --debug_path '" +
                                 Path("what was seen") + "'");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::string folder = Path("what was seen/");
  const std::string legend = ReadBytes(folder + "README.txt");
  const auto& linear = LinearFromSrgbByte();
  cv::Mat3f sum(190, 500, cv::Vec3f(0, 0, 0));
  for (int photo = 0; photo < 12; ++photo) {
    char stem[64];
    std::snprintf(stem, sizeof stem, "%03d_photo_%03d", photo, photo);
    EXPECT_NE(legend.find(stem), std::string::npos);
    const cv::Mat depth = cv::imread(folder + stem + "_depth_mm.png", cv::IMREAD_UNCHANGED);
    ASSERT_EQ(depth.type(), CV_16U);
    double farthest;
    cv::minMaxLoc(depth, nullptr, &farthest);
    EXPECT_TRUE(farthest > 1500 && farthest < 7000) << farthest;  // the room is 5 by 4 metres
    EXPECT_EQ(cv::imread(folder + stem + "_boundary.jpg").size(), depth.size());
    EXPECT_EQ(cv::imread(folder + stem + "_depth.jpg").size(), depth.size());
    const cv::Mat3b part = cv::imread(folder + stem + "_contribution.png");
    const cv::Mat3b sight = cv::imread(folder + stem + "_sight.png");
    ASSERT_EQ(part.size(), sum.size());
    ASSERT_EQ(sight.size(), sum.size());
    for (int i = 0; i < 500 * 190; ++i) {
      const cv::Vec3b c = part(i / 500, i % 500), seen = sight(i / 500, i % 500);
      for (int k = 0; k < 3; ++k) sum(i / 500, i % 500)[k] += linear[c[k]];
      // What is hidden, turned away or outside the photo gives nothing.
      if (seen[0] == seen[1] && seen[1] == seen[2]) {
        ASSERT_EQ(c, cv::Vec3b(0, 0, 0));
      }
    }
  }
  const cv::Mat3b blend = cv::imread(Path("plain_blend/texture.png"));
  double error = 0;
  for (int i = 0; i < 500 * 190; ++i) {
    for (int k = 0; k < 3; ++k) {
      error += std::abs(sum(i / 500, i % 500)[k] - linear[blend(i / 500, i % 500)[k]]);
    }
  }
  EXPECT_LT(error / (3 * 500 * 190), 0.003);  // twelve times half a grey level
  for (const char* name : {"significance.png", "num_photos.png", "disagreement.png"}) {
    EXPECT_EQ(cv::imread(folder + name).size(), sum.size()) << name;
  }
}

// A patterned and a plain photo of each pose: colour comes from the plain ones only.
TEST_F(TextureCommand, ColoursComeFromThePlainTwins) {
  fs::create_directories(Path("pairs"));
  std::ofstream associations(Path("associations.csv"));
  associations << "patterned_image,plain_image,offset_px,brightness_ratio\n";
  for (const auto& entry : fs::directory_iterator(Capture() + "/photos")) {
    const std::string name = entry.path().filename().string();
    cv::Mat green(720, 1080, CV_8UC3, cv::Scalar(0, 255, 0));
    cv::imwrite(Path("pairs/") + name, green);
    fs::copy_file(entry.path(), Path("pairs/plain_") + name);
    associations << name << ",plain_" << name << ",0.1,1.5\n";
  }
  associations.close();
  const CommandResult result = RunCommandLine(
      "roomtex-texture --quiet --input_path " + Capture() + "/truth --image_path " + Path("pairs") +
      " --scan_path " + Capture() + "/scan.rtpi --associations_path " + Path("associations.csv") +
      " --output_path " + Path("twins"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(ReadPly(Path("twins/model.ply")).colors, ReadPly(Path("textured/model.ply")).colors);
}

}  // namespace
}  // namespace roomtex
