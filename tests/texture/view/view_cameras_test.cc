#include "texture/view/view_cameras.h"

#include <cstring>
#include <memory>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

Camera Distorted() {
  Camera camera;
  camera.camera_id = 1;
  camera.model = CameraModel::kOpenCv;
  camera.width = 1936;
  camera.height = 1288;
  camera.params = {1520, 1530, 950, 660, -0.12, 0.06, 0.001, -0.002};
  return camera;
}
Camera Fisheye() {
  Camera camera = Distorted();
  camera.model = CameraModel::kOpenCvFisheye;
  camera.params = {700, 700, 968, 644, -0.02, 0.005, 0, 0};
  return camera;
}

Camera Panorama() {
  Camera camera = Distorted();
  camera.model = CameraModel::kEquirectangular;
  camera.width = 3000;
  camera.height = 1500;
  camera.params = {3000, 1500};
  return camera;
}

TEST(PhotoLattice, StraightLinesBetweenItsNodesAreGoodToATenthOfAPixel) {
  for (const Camera& camera : {Distorted(), Fisheye(), Panorama()}) {
    const PhotoLattice lattice = MakePhotoLattice(camera);
    ASSERT_EQ(lattice.directions.size(), static_cast<size_t>(lattice.columns * lattice.rows));
    const CameraProjection projection(camera);
    double farthest = 0;
    int num_cells = 0;
    for (int row = 0; row + 1 < lattice.rows; ++row) {
      for (int column = 0; column + 1 < lattice.columns; ++column) {
        // The middle of the diagonal, as a graphics card draws the two triangles.
        const Eigen::Vector3f& a = lattice.directions[row * lattice.columns + column + 1];
        const Eigen::Vector3f& b = lattice.directions[(row + 1) * lattice.columns + column];
        if (a.isZero() || b.isZero()) continue;
        const Eigen::Vector2d expected((column + 0.5) * camera.width / (lattice.columns - 1),
                                       (row + 0.5) * camera.height / (lattice.rows - 1));
        const auto error = projection.ImgError((a + b).cast<double>(), expected);
        ASSERT_TRUE(error);
        farthest = std::max(farthest, error->norm());
        ++num_cells;
      }
    }
    EXPECT_LT(farthest, 0.1);
    EXPECT_GT(num_cells, 2000);
  }
}

TEST(PhotoLattice, NodesAreTheRaysOfTheirPixels) {
  const Camera camera = Distorted();
  const PhotoLattice lattice = MakePhotoLattice(camera);
  const CameraProjection projection(camera);
  const auto corner = projection.ImgFromCam(lattice.directions.back().cast<double>());
  ASSERT_TRUE(corner);
  EXPECT_NEAR(corner->x(), camera.width, 1e-3);
  EXPECT_NEAR(corner->y(), camera.height, 1e-3);
  for (const Eigen::Vector3f& direction : lattice.directions)
    EXPECT_NEAR(direction.norm(), 1, 1e-5);
}

class ViewCamerasOfTwo : public testing::Test {
 protected:
  void SetUp() override {
    SparseModel model;
    model.cameras[1] = Distorted();
    for (const uint32_t id : {7u, 3u}) {
      SparseImage image;
      image.image_id = id;
      image.camera_id = 1;
      image.name = id == 7 ? "a.jpg" : "b.jpg";
      image.cam_from_model.rotation =
          Eigen::Quaterniond(Eigen::AngleAxisd(0.3 * id, Eigen::Vector3d(1, 2, 3).normalized()));
      image.cam_from_model.translation = {0.1, 0.2, 0.3 * id};
      model.images[id] = image;
    }
    SparsePoint near, far;
    near.x_in_model = {100.5, 200.25, 300.125};
    near.color = {10, 20, 30};
    far.x_in_model = {1e7, 0, 0};
    model.points[1] = near;
    model.points[2] = far;
    cv::imwrite(folder_ / "a.jpg", cv::Mat(644, 968, CV_8UC3, cv::Scalar(50, 100, 200)));
    cameras_ = ViewCameras(std::move(model), folder_.path());
  }
  const TempFolder folder_;
  ViewCameras cameras_;
};

TEST_F(ViewCamerasOfTwo, AreListedByName) {
  const Json list = cameras_.ToJson();
  ASSERT_EQ(list.size(), 2u);
  EXPECT_EQ(list[0]["name"], "a.jpg");
  EXPECT_EQ(list[0]["photo"], true);
  EXPECT_EQ(list[1]["photo"], false);  // its file is not there
  const SparseImage& image = *cameras_.model().FindImage("a.jpg");
  const Eigen::Vector3d centre = image.cam_from_model.TargetOriginInSource();
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(list[0]["center"][k].get<double>(), centre[k], 1e-12);
  EXPECT_LT(list[0]["corners"][0][0].get<double>(), 0);  // upper left: x right, y down
  EXPECT_LT(list[0]["corners"][0][1].get<double>(), 0);
  EXPECT_GT(list[0]["corners"][2][0].get<double>(), 0);
}

TEST_F(ViewCamerasOfTwo, PhotosComeInTheSizeAskedFor) {
  const auto bytes = cameras_.Photo(0, 200);
  ASSERT_TRUE(bytes);
  const cv::Mat photo = cv::imdecode(
      cv::Mat(1, static_cast<int>(bytes->size()), CV_8U, const_cast<char*>(bytes->data())), 1);
  EXPECT_EQ(photo.cols, 200);
  EXPECT_EQ(photo.rows, 133);
  EXPECT_NEAR(photo.at<cv::Vec3b>(60, 100)[2], 200, 4);
  EXPECT_EQ(cameras_.Photo(0, 200), bytes);  // kept
  ASSERT_EQ(cameras_.left_out().size(), 1u);
  EXPECT_NE(cameras_.left_out()[0].reason.find("There is no photo"), std::string::npos);
  EXPECT_FALSE(cameras_.Photo(1, 200));
  EXPECT_THROW(cameras_.Photo(2, 200), UsageError);
  EXPECT_THROW(cameras_.Photo(-1, 200), UsageError);
}

// A page asks for all of a list at once.
TEST_F(ViewCamerasOfTwo, WhoAsksWhileAPhotoIsMadeWaitsForIt) {
  constexpr int kAsking = 6;
  std::vector<std::shared_ptr<const std::string>> answers(kAsking);
  std::vector<std::thread> threads;
  for (auto& answer : answers) {
    threads.emplace_back([this, &answer] { answer = cameras_.PinholePhoto(0, 400, nullptr); });
  }
  for (std::thread& thread : threads) thread.join();
  ASSERT_TRUE(answers[0]);
  for (const auto& answer : answers) EXPECT_EQ(answer, answers[0]);
}

TEST_F(ViewCamerasOfTwo, APhotoOfAnotherShapeIsRefused) {
  cv::imwrite(folder_ / "a.jpg", cv::Mat(900, 900, CV_8UC3, cv::Scalar(0)));
  EXPECT_INPUT_ERROR(cameras_.Photo(0, 300), "900 x 900");
}

TEST_F(ViewCamerasOfTwo, PointsAreRelativeToTheOriginAndStraysAreLeftOut) {
  const std::string bytes = cameras_.EncodePoints({100, 200, 300});
  ASSERT_EQ(bytes.size(), 16u);
  float position[3];
  std::memcpy(position, bytes.data(), 12);
  EXPECT_EQ(position[0], 0.5f);
  EXPECT_EQ(position[1], 0.25f);
  EXPECT_EQ(position[2], 0.125f);
  EXPECT_EQ(static_cast<uint8_t>(bytes[13]), 20);
}

}  // namespace
}  // namespace roomtex
