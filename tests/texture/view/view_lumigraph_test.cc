#include "texture/view/view_lumigraph.h"

#include <cstring>
#include <fstream>

#include <gmock/gmock.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/scan_mesh.h"
#include "tests/support/temp_folder.h"
#include "tests/texture/sampling/two_walls.h"

namespace roomtex {
namespace {

// Photos a.jpg and b.jpg of two walls, from beside the scanner.
class LumigraphOfTwoWalls : public testing::Test {
 protected:
  void SetUp() override {
    SparseModel model;
    for (const auto& [name, x] : {std::pair{"a.jpg", -0.5}, std::pair{"b.jpg", 0.5}}) {
      PhotoView view = walls_.View({x, 0, 0}, name);
      walls_.Shoot(&view, 1, folder_.path(), 0);
      model.cameras[1] = view.camera;
      SparseImage image;
      image.image_id = static_cast<uint32_t>(model.images.size() + 1);
      image.camera_id = 1;
      image.name = name;
      image.cam_from_model = view.cam_from_scan;
      model.images[image.image_id] = image;
    }
    cameras_ = ViewCameras(std::move(model), folder_.path());
  }
  void WriteReport(const std::string& text) { std::ofstream(folder_ / "report.json") << text; }

  const TwoWalls walls_;
  const TempFolder folder_;
  ViewCameras cameras_;
};

TEST_F(LumigraphOfTwoWalls, DepthsAreThoseOfTheMeshAndTheNearerSurfaceIsWider) {
  const ViewLumigraph lumigraph(cameras_, {});
  const Scan scan = walls_.MakeScan(400, 400);
  ViewModel mesh;
  mesh.origin = {1, 2, 3};
  for (const Eigen::Vector3d& p : scan.points)
    mesh.points.push_back((p - mesh.origin).cast<float>());
  mesh.colors.resize(mesh.points.size());
  mesh.triangles = BuildScanMesh(scan, ScanMeshOptions());
  mesh.page_of_triangle.assign(mesh.triangles.size(), -1);
  mesh.normals = SmoothNormals(mesh);
  const Eigen::Vector3d origin = mesh.origin;
  const ViewChunks chunks(std::move(mesh));
  const std::string bytes = lumigraph.Depths(0, chunks, origin, 2);
  EXPECT_EQ(bytes, lumigraph.Depths(0, chunks, origin, 1));
  uint32_t header[4];
  ASSERT_GT(bytes.size(), sizeof header);
  std::memcpy(header, bytes.data(), sizeof header);
  const Camera pinhole = *cameras_.Pinhole(0, ViewLumigraph::kDepthSize);
  ASSERT_EQ(header[1], static_cast<uint32_t>(pinhole.width));
  ASSERT_EQ(header[2], static_cast<uint32_t>(pinhole.height));
  ASSERT_EQ(bytes.size(), 16 + 2 * static_cast<size_t>(header[1]) * header[2]);
  cv::Mat inverse;
  cv::Mat(pinhole.height, pinhole.width, CV_16F, const_cast<char*>(bytes.data()) + 16)
      .convertTo(inverse, CV_32F);
  const CameraProjection projection(pinhole);
  const auto at = [&](const Eigen::Vector3d& point) {
    const auto img = projection.ImgFromCam(cameras_.Image(0).cam_from_model * point);
    return inverse.at<float>(static_cast<int>(img->y()), static_cast<int>(img->x()));
  };
  EXPECT_NEAR(at({0, 0, -2}), 0.5, 1e-3);
  EXPECT_NEAR(at({0.3, -0.3, -2}), 0.5, 1e-3);
  EXPECT_NEAR(at({-1.5, 0.2, -4}), 0.25, 1e-3);
  // Just beside the board's edge, seen from the photo: a pixel is 5 mm there.
  EXPECT_NEAR(at({-0.403, 0, -2}), 0.5, 1e-3);
  EXPECT_LT(at({-0.43, 0, -2}), 0.3);
  // A triangle that goes on behind the camera is cut off at it: the plane 1 m below, all around.
  ViewModel floor;
  floor.points = {{-100, -1, 100}, {100, -1, 100}, {0, -1, -100}};
  floor.colors.resize(3);
  floor.triangles = {{0, 1, 2}};
  floor.page_of_triangle = {-1};
  floor.normals = SmoothNormals(floor);
  const ViewChunks below(std::move(floor));
  const std::string seen = lumigraph.Depths(0, below, Eigen::Vector3d::Zero(), 1);
  cv::Mat(pinhole.height, pinhole.width, CV_16F, const_cast<char*>(seen.data()) + 16)
      .convertTo(inverse, CV_32F);
  EXPECT_NEAR(at({0, -1, -4}), 0.25, 1e-3);
  EXPECT_NEAR(at({0, -1, -8}), 0.125, 1e-3);
  EXPECT_EQ(at({0, 1, -4}), 0);
}

// What programs that cut things out make transparent is black below, mostly.
TEST_F(LumigraphOfTwoWalls, WhatIsTransparentInAPhotoIsHiddenFromIt) {
  const cv::Mat photo = cv::imread(folder_ / "a.jpg");
  cv::Mat seen;
  cv::cvtColor(photo, seen, cv::COLOR_BGR2BGRA);
  seen.colRange(0, photo.cols / 2).setTo(cv::Scalar::all(0));
  std::vector<uchar> png;
  ASSERT_TRUE(cv::imencode(".png", seen, png));
  WriteBytes(folder_ / "a.jpg", std::string(png.begin(), png.end()));
  ViewModel wall;
  wall.points = {{-50, -50, -4}, {50, -50, -4}, {0, 50, -4}};
  wall.colors.resize(3);
  wall.triangles = {{0, 1, 2}};
  wall.page_of_triangle = {-1};
  wall.normals = SmoothNormals(wall);
  const ViewChunks chunks(std::move(wall));
  const ViewLumigraph lumigraph(cameras_, {});
  for (const int id : {0, 1}) {
    const std::string bytes = lumigraph.Depths(id, chunks, Eigen::Vector3d::Zero(), 1);
    const Camera pinhole = *cameras_.Pinhole(id, ViewLumigraph::kDepthSize);
    cv::Mat inverse;
    cv::Mat(pinhole.height, pinhole.width, CV_16F, const_cast<char*>(bytes.data()) + 16)
        .convertTo(inverse, CV_32F);
    for (const double u : {0.1, 0.3, 0.48, 0.52, 0.9}) {
      const int x = static_cast<int>(u * pinhole.width);
      const float found = inverse.at<float>(pinhole.height / 2, x);
      if (id == 0 && u < 0.5) {
        EXPECT_GT(found, 100) << u;
      } else {
        EXPECT_NEAR(found, 0.25, 1e-3) << id << " " << u;
      }
    }
  }
}

TEST_F(LumigraphOfTwoWalls, TakesThePhotosThatColouredTheModelWithTheirGains) {
  WriteReport(R"({"exposure_gain": {"b.jpg": 1.5}, "channel_gain": {"b.jpg": [1.4, 1.5, 1.6]}})");
  const ViewLumigraph lumigraph(cameras_, ReadViewTones(folder_.path()));
  const Json json = lumigraph.ToJson();
  EXPECT_EQ(json["reason"], "");
  ASSERT_EQ(json["photos"].size(), 1u);
  EXPECT_EQ(json["photos"][0]["id"], 1);
  EXPECT_NEAR(json["photos"][0]["gain"][2].get<double>(), 1.6, 1e-6);
  EXPECT_FALSE(lumigraph.Photo(0, 300));
  const auto photo = lumigraph.Photo(1, 300);
  ASSERT_TRUE(photo);
  const cv::Mat picture = cv::imdecode(
      cv::Mat(1, static_cast<int>(photo->size()), CV_8U, const_cast<char*>(photo->data())), 1);
  EXPECT_EQ(picture.cols, 300);
  // The focal length, as a share of the width, is that of this picture: the board's corner.
  const double u = json["photos"][0]["centre"][0].get<double>() -
                   json["photos"][0]["focal"][0].get<double>() * 0.9 / 2;
  const int x = static_cast<int>(std::lround(u * picture.cols)), y = picture.rows / 2;
  EXPECT_LT(picture.at<cv::Vec3b>(y, x - 4)[2], 180);  // the wall
  EXPECT_GT(picture.at<cv::Vec3b>(y, x + 4)[2], 190);  // the red board
  EXPECT_THROW(lumigraph.Photo(2, 300), UsageError);
}

TEST_F(LumigraphOfTwoWalls, WithoutAReportAllPhotosAreAsTheyAre) {
  EXPECT_EQ(ViewLumigraph(cameras_, ReadViewTones(folder_.path())).ToJson()["photos"].size(), 2u);
  WriteReport(R"({"exposure_gain": {"c.jpg": 1, "a.jpg": "much", "b.jpg": -1}})");
  const Json none = ViewLumigraph(cameras_, ReadViewTones(folder_.path())).ToJson();
  EXPECT_EQ(none["photos"].size(), 0u);
  EXPECT_THAT(none["reason"], testing::HasSubstr("coloured the model"));
  WriteReport("[");
  EXPECT_FALSE(ReadViewTones(folder_.path()).gains);
}

}  // namespace
}  // namespace roomtex
