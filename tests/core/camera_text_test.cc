// Cameras as COLMAP's programs take them.

#include "core/camera_text.h"

#include <gtest/gtest.h>

namespace roomtex {
namespace {

Camera MakeCamera() {
  Camera camera;
  camera.camera_id = 3;
  camera.model = CameraModel::kSimpleRadial;
  camera.width = 640;
  camera.height = 480;
  camera.params = {525.0 + 1.0 / 3, 320, 240, -0.1};
  return camera;
}

TEST(CameraText, ParametersReadBackToTheSameNumbers) {
  EXPECT_EQ(CamerasTextLine(MakeCamera()),
            "3 SIMPLE_RADIAL 640 480 525.33333333333337 320 240 -0.10000000000000001\n");
  EXPECT_EQ(FeatureExtractorOptions(MakeCamera()),
            "--ImageReader.single_camera 1 --ImageReader.camera_model SIMPLE_RADIAL "
            "--ImageReader.camera_params 525.33333333333337,320,240,-0.10000000000000001");
}

TEST(CameraText, HasAsManyDigitsAsAreAskedFor) {
  EXPECT_EQ(CamerasTextLine(MakeCamera(), 6), "3 SIMPLE_RADIAL 640 480 525.333 320 240 -0.1\n");
  EXPECT_EQ(FeatureExtractorOptions(MakeCamera(), 6),
            "--ImageReader.single_camera 1 --ImageReader.camera_model SIMPLE_RADIAL "
            "--ImageReader.camera_params 525.333,320,240,-0.1");
}

}  // namespace
}  // namespace roomtex
