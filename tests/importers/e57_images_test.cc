#include "importers/e57_images.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "colmap_ext/sparse_model.h"
#include "core/csv.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/photo.h"
#include "importers/e57_writer.h"
#include "tests/importers/e57_bytes.h"
#include "tests/support/folders.h"
#include "tests/support/matchers.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

class E57Images : public testing::Test {
 protected:
  // A picture, each quarter of its width in another grey.
  static std::string Picture(int width, int height, const std::string& ending) {
    cv::Mat picture(height, width, CV_8UC3);
    for (int x = 0; x < width; ++x)
      picture.col(x).setTo(cv::Scalar::all(20 + 60 * (4 * x / width)));
    std::vector<uchar> bytes;
    cv::imencode(ending, picture, bytes);
    return {bytes.begin(), bytes.end()};
  }
  static std::string Float(const std::string& name, double value) {
    return Element(name, "Float", std::to_string(value));
  }
  static std::string PoseXml(const Eigen::Vector4d& wxyz, const Eigen::Vector3d& t) {
    return Element("pose", "Structure",
                   Element("rotation", "Structure",
                           Float("w", wxyz[0]) + Float("x", wxyz[1]) + Float("y", wxyz[2]) +
                               Float("z", wxyz[3])) +
                       Element("translation", "Structure",
                               Float("x", t[0]) + Float("y", t[1]) + Float("z", t[2])));
  }
  std::string Blob(const std::string& name, const std::string& bytes) {
    return Element(name, "Blob", "",
                   "fileOffset=\"" + std::to_string(file_.AddBlob(bytes)) + "\" length=\"" +
                       std::to_string(bytes.size()) + "\"");
  }
  void Add(const std::string& name, const std::string& kind, int width, int height,
           const std::string& pose, const std::string& more = "", bool png = true) {
    std::string picture = Picture(width, height, png ? ".png" : ".jpg");
    if (!png) {
      WriteBytes(folder_ / "picture.jpg", picture);
      ExposureData exposure;
      exposure.exposure_time = 0.02;
      WriteExposureData(folder_ / "picture.jpg", exposure);
      picture = ReadBytes(folder_ / "picture.jpg");
    }
    pictures_.push_back(picture);
    const std::string blob = Blob(png ? "pngImage" : "jpegImage", picture);
    images_ +=
        Element("vectorChild", "Structure",
                Element("name", "String", name) + pose +
                    Element(kind + "Representation", "Structure",
                            blob + Element("imageWidth", "Integer", std::to_string(width)) +
                                Element("imageHeight", "Integer", std::to_string(height)) + more));
  }
  static std::string Pinhole(double focal, double pixel, double cx, double cy) {
    return Float("focalLength", focal) + Float("pixelWidth", pixel) +
           Float("pixelHeight", pixel / 2) + Float("principalPointX", cx) +
           Float("principalPointY", cy);
  }
  E57Photos Extract(const E57ImageOptions& options = {}) {
    WriteBytes(folder_ / "site.e57", file_.Finish(E57Xml("", images_)));
    Progress quiet(true);
    return ExtractE57Images(folder_ / "site.e57", folder_ / "photos", options, &quiet);
  }
  SparseModel Model() { return ReadSparseModel(folder_ / "photos/sparse"); }
  static Eigen::Vector2d Project(const SparseModel& model, const std::string& name,
                                 const Eigen::Vector3d& x_in_scan) {
    const SparseImage& image = *model.FindImage(name);
    return *CameraProjection(model.cameras.at(image.camera_id))
                .ImgFromCam(image.cam_from_model * x_in_scan);
  }

  TempFolder folder_;
  E57Bytes file_;
  std::string images_;
  std::vector<std::string> pictures_;
};

const Eigen::Vector4d kUnturned(1, 0, 0, 0);

TEST_F(E57Images, PicturesComeOutAsTheyWentIn) {
  Add("a/../b c.jpg", "visualReference", 700, 500, "", "", false);
  Add("A/../B c", "visualReference", 8, 6, "");
  Add("", "cylindrical", 8, 6, PoseXml(kUnturned, {0, 0, 0}));
  const E57Photos photos = Extract();
  ASSERT_THAT(photos.photos, SizeIs(3));
  EXPECT_EQ(photos.photos[0].file, "a_.._b_c.jpg");
  EXPECT_EQ(photos.photos[1].file, "A_.._B_c_2.png");
  EXPECT_EQ(photos.photos[2].file, "image.png");
  EXPECT_EQ(photos.photos[2].kind, "cylindrical");
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(ReadBytes(folder_ / ("photos/" + photos.photos[i].file)), pictures_[i]);
    EXPECT_FALSE(photos.photos[i].posed);
  }
  EXPECT_THAT(photos.notes, SizeIs(3));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "photos/sparse"));
}

TEST_F(E57Images, WhereAMaskShowsNothingThePhotoIsTransparent) {
  const auto mask = [this](int width, int height, int masked_columns) {
    cv::Mat1b shown(height, width, uchar{1});
    shown.colRange(0, masked_columns).setTo(0);
    std::vector<uchar> bytes;
    cv::imencode(".png", shown, bytes);
    return Blob("imageMask", {bytes.begin(), bytes.end()});
  };
  Add("part", "pinhole", 80, 60, PoseXml(kUnturned, {0, 0, 0}),
      Pinhole(0.02, 0.0005, 40, 30) + mask(80, 60, 30), false);
  Add("all", "visualReference", 80, 60, "", mask(80, 60, 0), false);
  Add("other", "visualReference", 80, 60, "", mask(8, 6, 2), false);
  Add("around", "spherical", 200, 100, PoseXml(kUnturned, {0, 0, 0}), mask(200, 100, 100), false);
  E57ImageOptions options;
  options.cut_panoramas = true;
  options.faces.around = 4;
  const E57Photos photos = Extract(options);
  ASSERT_THAT(photos.photos, SizeIs(4));
  EXPECT_EQ(photos.photos[0].file, "part.png");
  const cv::Mat picture = cv::imread(folder_ / "photos/part.png", cv::IMREAD_UNCHANGED);
  ASSERT_EQ(picture.type(), CV_8UC4);
  EXPECT_EQ(picture.at<cv::Vec4b>(7, 29)[3], 0);
  EXPECT_EQ(picture.at<cv::Vec4b>(7, 30)[3], 255);
  EXPECT_NEAR(picture.at<cv::Vec4b>(7, 70)[1], 200, 4);
  EXPECT_NEAR(ReadExposureData(folder_ / "photos/part.png").exposure_time.value_or(0), 0.02, 1e-6);
  EXPECT_EQ(Model().images.size(), 5u);
  // Nothing is masked, or the mask is none: byte by byte.
  for (const int i : {1, 2}) {
    EXPECT_EQ(ReadBytes(folder_ / ("photos/" + photos.photos[i].file)), pictures_[i]);
  }
  EXPECT_THAT(photos.notes, testing::Contains("other.jpg has a mask that does not fit it, which is "
                                              "left out"));
  // Faces: the first looks at the middle, the third at the seam.
  const cv::Mat face = cv::imread(folder_ / "photos/around/face_1.png", cv::IMREAD_UNCHANGED);
  ASSERT_EQ(face.type(), CV_8UC4);
  EXPECT_EQ(face.at<cv::Vec4b>(face.rows / 2, face.cols / 4)[3], 0);
  EXPECT_EQ(face.at<cv::Vec4b>(face.rows / 2, 3 * face.cols / 4)[3], 255);
}

// A name of 100 bytes and more ends between two letters; what is no UTF-8 is none.
TEST_F(E57Images, NamesAreCutBetweenLetters) {
  std::string umlauts;
  for (int i = 0; i < 60; ++i) umlauts += "\xC3\xA4";
  Add("x" + umlauts, "visualReference", 8, 6, "");
  Add("l\xE4 m", "visualReference", 8, 6, "");
  const E57Photos photos = Extract();
  ASSERT_THAT(photos.photos, SizeIs(2));
  EXPECT_EQ(photos.photos[0].file, "x" + umlauts.substr(0, 98) + ".png");
  EXPECT_EQ(photos.photos[1].file, "l__m.png");
}

// The standard: x right, y up, looks along -z.
TEST_F(E57Images, PinholePicturesSeeWhatTheStandardSays) {
  Add("front", "pinhole", 80, 60, PoseXml(kUnturned, {0, 0, 0}), Pinhole(0.02, 0.0005, 40, 29.5));
  // Turned by 90 degrees about z and moved.
  const double h = std::sqrt(0.5);
  Add("side", "pinhole", 80, 60, PoseXml({h, 0, 0, h}, {10, 20, 30}),
      Pinhole(0.02, 0.0005, 40, 29.5));
  Add("other", "pinhole", 80, 60, PoseXml(kUnturned, {0, 0, 0}), Pinhole(0.02, 0.001, 40, 29.5));
  Add("no pose", "pinhole", 80, 60, "", Pinhole(0.02, 0.0005, 40, 29.5));
  Add("no focus", "pinhole", 80, 60, PoseXml(kUnturned, {0, 0, 0}), Pinhole(0, 0, 0, 0));
  const E57Photos photos = Extract();
  EXPECT_THAT(photos.posed, SizeIs(3));
  EXPECT_THAT(photos.notes, ElementsAre(HasSubstr("no_pose.png is not in the model: it has no"),
                                        HasSubstr("no_focus.png is not in the model: its cam")));
  const SparseModel model = Model();
  EXPECT_THAT(model.cameras, SizeIs(2));  // front and side share one
  const Camera& camera = model.cameras.at(1);
  EXPECT_EQ(camera.model, CameraModel::kPinhole);
  EXPECT_THAT(camera.params,
              ElementsAre(testing::DoubleNear(40, 1e-9), testing::DoubleNear(80, 1e-9), 40,
                          30));  // 29.5 = (60 - 1) / 2: from the pixel's centre
  EXPECT_THAT(Project(model, "front.png", {0.5, 0.25, -2}),
              IsNearMatrix(Eigen::Vector2d(40 + 40 * 0.25, 30 - 80 * 0.125), 1e-9));
  // x of the camera is y of the file now.
  EXPECT_THAT(Project(model, "side.png", {10 - 0.25, 20 + 0.5, 30 - 2}),
              IsNearMatrix(Eigen::Vector2d(40 + 40 * 0.25, 30 - 80 * 0.125), 1e-4));
}

TEST_F(E57Images, ACameraSaidForAnotherSizeIsScaled) {
  Add("a", "pinhole", 80, 60, PoseXml(kUnturned, {0, 0, 0}),
      Pinhole(0.02, 0.0005, 20, 15) + Element("imageWidth", "Integer", "40"));
  images_.replace(images_.find(">80<"), 4, ">40<");
  images_.replace(images_.find(">60<"), 4, ">30<");
  Extract();
  const Camera camera = Model().cameras.at(1);
  EXPECT_EQ(camera.width, 80);
  EXPECT_NEAR(camera.params[0], 80, 1e-9);
  EXPECT_NEAR(camera.params[2], 40, 1e-9);
}

// The standard: the middle looks along x, azimuths grow to the left, z is up.
TEST_F(E57Images, PanoramasSeeWhatTheStandardSays) {
  Add("all around", "spherical", 128, 64, PoseXml(kUnturned, {1, 2, 3}));
  Add("strip", "spherical", 128, 32, PoseXml(kUnturned, {1, 2, 3}));
  // Twice as wide as high, and half of the sphere all the same.
  Add("half", "spherical", 128, 64, PoseXml(kUnturned, {1, 2, 3}),
      Float("pixelWidth", kPi / 128) + Float("pixelHeight", kPi / 128));
  const E57Photos photos = Extract();
  EXPECT_THAT(photos.notes, ElementsAre(HasSubstr("strip.png is not in the model: it is no pan"),
                                        HasSubstr("half.png is not in the model: it is no pan")));
  const SparseModel model = Model();
  EXPECT_EQ(model.cameras.at(1).model, CameraModel::kEquirectangular);
  const std::string name = "all_around.png";
  EXPECT_THAT(Project(model, name, {6, 2, 3}), IsNearMatrix(Eigen::Vector2d(64, 32), 1e-9));
  EXPECT_THAT(Project(model, name, {1, 7, 3}), IsNearMatrix(Eigen::Vector2d(32, 32), 1e-9));
  EXPECT_THAT(Project(model, name, {1, -7, 3}), IsNearMatrix(Eigen::Vector2d(96, 32), 1e-9));
  EXPECT_THAT(Project(model, name, {2, 2, 4}), IsNearMatrix(Eigen::Vector2d(64, 16), 1e-9));
}

TEST_F(E57Images, PanoramasAreCutIntoFacesOnRequest) {
  Add("all", "spherical", 256, 128, PoseXml(kUnturned, {0, 0, 0}));
  E57ImageOptions options;
  options.cut_panoramas = true;
  options.faces.around = 4;
  options.faces.poles = true;
  EXPECT_THAT(Extract(options).posed, SizeIs(6));
  const SparseModel model = Model();
  ASSERT_THAT(model.cameras, SizeIs(1));
  const Camera& camera = model.cameras.at(1);
  EXPECT_EQ(camera.model, CameraModel::kSimplePinhole);
  // The first face looks along x, the second to the right of it.
  EXPECT_THAT(Project(model, "all/face_1.jpg", {5, 0, 0}),
              IsNearMatrix(Eigen::Vector2d(camera.width / 2.0, camera.height / 2.0), 1e-9));
  EXPECT_THAT(Project(model, "all/face_2.jpg", {0, -5, 0}),
              IsNearMatrix(Eigen::Vector2d(camera.width / 2.0, camera.height / 2.0), 1e-9));
  // To the right of the middle is the third quarter, on its right the fourth.
  const cv::Mat picture = ReadPhoto(folder_ / "photos/all/face_2.jpg");
  EXPECT_NEAR(picture.at<cv::Vec3b>(camera.height / 2, 3)[0], 140, 4);
  EXPECT_NEAR(picture.at<cv::Vec3b>(camera.height / 2, camera.width - 4)[0], 200, 4);
}

TEST_F(E57Images, BrokenPicturesGetASentence) {
  Add("a", "visualReference", 30, 20, "");
  const std::string good = file_.Finish(E57Xml("", images_));
  Progress quiet(true);
  const auto extract = [&](size_t at, const std::string& bytes) {
    std::string changed = good;
    changed.replace(at, bytes.size(), bytes);
    WriteBytes(folder_ / "b.e57", E57Bytes::Mended(changed));
    ExtractE57Images(folder_ / "b.e57", folder_ / "photos", {}, &quiet);
  };
  EXPECT_INPUT_ERROR(extract(48, "\1"), "byte 48: begins with 1");
  EXPECT_INPUT_ERROR(extract(56, Bytes(uint64_t{5})), "byte 48: begins with 0 and 5 bytes");
  const std::string length = "length=\"" + std::to_string(pictures_[0].size()) + "\"";
  const auto with_length = [&](const std::string& text) {
    std::string xml = E57Xml("", images_);
    xml.replace(xml.find(length), length.size(), text);
    E57Bytes file;
    file.AddBlob(pictures_[0]);
    WriteBytes(folder_ / "c.e57", file.Finish(xml));
    ExtractE57Images(folder_ / "c.e57", folder_ / "photos", {}, &quiet);
  };
  EXPECT_INPUT_ERROR(with_length("length=\"-1\""), "says a picture of -1 bytes");
  EXPECT_INPUT_ERROR(with_length("length=\"99999999999\""), "expected a blob (0) of 99999999999");
  EXPECT_INPUT_ERROR(with_length("length=\"9223372036854775807\""), "expected a blob");
}

TEST_F(E57Images, TheCommandWritesThemBesideTheScan) {
  Add("front", "pinhole", 80, 60, PoseXml(kUnturned, {0, 0, 0}), Pinhole(0.02, 0.0005, 40, 30));
  WriteBytes(folder_ / "site.e57", file_.Finish(E57Xml("", images_)));
  const CommandResult result = RunCommandLine(
      "roomtex-import --quiet --input_path " + (folder_ / "site.e57") + " --images_path " +
      (folder_ / "photos") + " --report_path " + (folder_ / "report.json"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("1 photos, 1 with a pose"));
  EXPECT_THAT(ReadBytes(folder_ / "report.json"), HasSubstr("\"front.png\""));
  EXPECT_THAT(Model().images, SizeIs(1));
  // The same once more; but never over a picture of somebody else.
  const std::string again = "roomtex-import --quiet --input_path " + (folder_ / "site.e57") +
                            " --images_path " + (folder_ / "photos");
  EXPECT_EQ(RunCommandLine(again).exit_code, 0);
  WriteBytes(folder_ / "photos/front.png", "mine");
  EXPECT_THAT(RunCommandLine(again).err, HasSubstr("is another picture"));
  EXPECT_EQ(ReadBytes(folder_ / "photos/front.png"), "mine");
  WriteBytes(folder_ / "walls.e57", E57OfWalls({"a"}));
  const CommandResult none =
      RunCommandLine("roomtex-import --input_path " + (folder_ / "walls.e57") + " --images_path " +
                     (folder_ / "photos"));
  EXPECT_EQ(none.exit_code, 3);
  EXPECT_THAT(none.err, HasSubstr("holds no photos"));
  // Nothing is asked to be written: it says what the scan is.
  EXPECT_THAT(RunCommandLine("roomtex-import --input_path " + (folder_ / "walls.e57")).out,
              HasSubstr("walls.e57: E57, "));
}

TEST_F(E57Images, PicksFollowFromThePosesOfThePhotos) {
  Scan scan;  // a wall, and a board in front of its left half
  scan.organised = false;
  scan.up = Eigen::Vector3d::UnitZ();
  for (double y = -4; y < 4; y += 0.02) {
    for (double z = -3; z < 3; z += 0.02) {
      scan.points.emplace_back(4, y, z);
      if (y > 0.3) scan.points.emplace_back(2, 0.5 * y, 0.5 * z);
    }
  }
  scan.intensity.assign(scan.points.size(), 1.0f);
  scan.num_columns = static_cast<int>(scan.points.size());
  scan.num_rows = 1;
  Camera camera;
  camera.model = CameraModel::kPinhole;
  camera.width = 400;
  camera.height = 300;
  camera.params = {200, 200, 200, 150};
  Eigen::Matrix3d along_x;
  along_x << 0, -1, 0,  //
      0, 0, -1,         //
      1, 0, 0;
  const Rigid cam_from_scan{Eigen::Quaterniond(along_x), Eigen::Vector3d::Zero()};
  E57Writer writer(folder_ / "site.e57");
  writer.AddScan(scan, nullptr);
  writer.AddPhoto({"front", Picture(400, 300, ".jpg"), camera, cam_from_scan});
  writer.Commit();
  const CommandResult result =
      RunCommandLine("roomtex-import --quiet --input_path " + (folder_ / "site.e57") +
                     " --images_path " + (folder_ / "photos") + " --E57.picks 1");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  CsvReader picks(folder_ / "photos/picks.csv", "", "");
  ASSERT_TRUE(picks.Next());
  EXPECT_EQ(picks.line(), "image_name,x,y,scan_x,scan_y,scan_z");
  const SparseModel model = Model();
  int count = 0, num_on_board = 0;
  for (; picks.Next(); ++count) {
    const std::vector<std::string> fields = *picks.Fields();
    const auto number = [&](size_t i) { return std::stod(fields[i]); };
    const Eigen::Vector3d x_in_scan(number(3), number(4), number(5));
    EXPECT_THAT(Project(model, fields[0], x_in_scan),
                IsNearMatrix(Eigen::Vector2d(number(1), number(2)), 1e-3));
    EXPECT_NEAR(x_in_scan.x(), number(1) < 180 ? 2 : 4, 1e-5);
    num_on_board += x_in_scan.x() < 3;
  }
  EXPECT_EQ(count, 9);
  EXPECT_EQ(num_on_board, 3);
}

}  // namespace
}  // namespace roomtex
