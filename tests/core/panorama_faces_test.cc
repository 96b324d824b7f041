#include "core/panorama_faces.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/frames.h"
#include "core/similarity.h"

namespace roomtex {
namespace {

// Smooth over the whole sphere, poles and seam included.
Eigen::Vector3d ColorOf(const Eigen::Vector3d& ray) {
  return 128 + (90 * (3 * ray.array() + Eigen::Array3d(0.3, 1, 2)).sin());
}

cv::Mat MakePanorama(const Camera& camera) {
  const CameraProjection projection(camera);
  cv::Mat3b picture(camera.height, camera.width);
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const Eigen::Vector3d color = ColorOf(*projection.RayFromImg({x + 0.5, y + 0.5}));
      for (int k = 0; k < 3; ++k) picture(y, x)[k] = cv::saturate_cast<uchar>(color[k]);
    }
  }
  return picture;
}

TEST(PanoramaFaces, ShowWhatThePanoramaShowsAlsoOverTheSeamAndThePoles) {
  Camera panorama{1, CameraModel::kEquirectangular, 1024, 512, {1024, 512}};
  const cv::Mat picture = MakePanorama(panorama);
  FaceOptions options;
  options.around = 4;
  options.poles = true;
  const Camera face = FaceCamera(panorama, options);
  EXPECT_EQ(face.width, 326);  // 1024 / pi
  EXPECT_EQ(face.Problems().size(), 0u);
  const CameraProjection projection(face);
  const auto rotations = FaceRotations(options);
  ASSERT_EQ(rotations.size(), 6u);
  for (const Eigen::Quaterniond& rotation : rotations) {
    const cv::Mat3b cut = CutFace(picture, face, rotation);
    double worst = 0;
    for (int y = 0; y < cut.rows; y += 3) {
      for (int x = 0; x < cut.cols; x += 3) {
        const Eigen::Vector3d expected = ColorOf(
            (rotation.conjugate() * *projection.RayFromImg({x + 0.5, y + 0.5})).normalized());
        for (int k = 0; k < 3; ++k) worst = std::max(worst, std::abs(cut(y, x)[k] - expected[k]));
      }
    }
    EXPECT_LT(worst, 4) << rotation.coeffs().transpose();
  }
}

TEST(PanoramaFaces, GoFromLeftToRightThenUpAndDown) {
  FaceOptions options;
  options.poles = true;
  const auto rotations = FaceRotations(options);
  ASSERT_EQ(rotations.size(), 10u);
  const auto axis = [&](int k) {
    return Eigen::Vector3d(rotations[k].conjugate() * Eigen::Vector3d::UnitZ());
  };
  EXPECT_LT(AngleBetween(axis(0), Eigen::Vector3d::UnitZ()), 1e-9);
  EXPECT_LT(AngleBetween(axis(2), Eigen::Vector3d::UnitX()), 1e-9);
  EXPECT_LT(AngleBetween(axis(8), -Eigen::Vector3d::UnitY()), 1e-9);
  EXPECT_LT(AngleBetween(axis(9), Eigen::Vector3d::UnitY()), 1e-9);
}

TEST(PanoramaFaces, OptionsOutOfBoundsAreNamed) {
  FaceOptions options;
  EXPECT_TRUE(options.Problems().empty());
  options.size = 20;
  options.around = 2;
  options.field_of_view_deg = 170;
  EXPECT_EQ(options.Problems().size(), 3u);
}

}  // namespace
}  // namespace roomtex
