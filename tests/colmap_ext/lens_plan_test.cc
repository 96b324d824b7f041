#include "colmap_ext/lens_plan.h"

#include <fstream>

#include <gmock/gmock.h>

#include "colmap_ext/mapper_verdict.h"
#include "core/result_names.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

Camera PlannedCamera(uint32_t id, double focal_length) {
  Camera camera;
  camera.camera_id = id;
  camera.model = CameraModel::kSimpleRadial;
  camera.width = 640;
  camera.height = 480;
  camera.params = {focal_length, 320, 240, 0};
  return camera;
}

SparseModel ModelOf(const LensPlan& plan) {
  SparseModel model;
  model.cameras = plan.cameras();
  for (const auto& [id, image] : plan.images()) {
    SparseImage& mapped = model.images[id];
    mapped.image_id = id;
    mapped.camera_id = image.camera_id;
    mapped.name = image.name;
  }
  return model;
}

TEST(LensPlan, CamerasToldTheSameAreOneAndComeBackAsTheyWere) {
  std::map<uint32_t, Camera> cameras;
  std::map<uint32_t, DatabaseImage> images;
  for (uint32_t id = 1; id <= 4; ++id) {
    cameras[id] = PlannedCamera(id, id == 4 ? 900 : 768);
    images[id] = {id, id, "photo_" + std::to_string(id) + ".jpg"};
  }
  const LensPlan plan(cameras, images, {});
  EXPECT_FALSE(plan.IsAsInDatabase());
  EXPECT_TRUE(LensPlan(cameras, images).IsAsInDatabase());
  EXPECT_EQ(plan.cameras().size(), 2u);
  EXPECT_EQ(plan.images().at(3).camera_id, 1u);
  EXPECT_EQ(plan.images().at(4).camera_id, 4u);
  SparseModel model = ModelOf(plan);
  model.cameras.at(1).params[0] = 800;
  plan.Restore(&model);
  ASSERT_EQ(model.cameras.size(), 4u);
  for (uint32_t id = 1; id <= 4; ++id) {
    EXPECT_EQ(model.images.at(id).camera_id, id);
    EXPECT_EQ(model.cameras.at(id).camera_id, id);
    EXPECT_EQ(model.cameras.at(id).params[0], id == 4 ? 900 : 800);
  }
}

TEST(LensLabel, LensesOfATelephoneDifferByWhatTheyAreOnFilm) {
  const LensLabel wide{"phone at 6.86 mm", 6.86, 24}, ultra{"phone at 2.22 mm", 2.22, 14};
  EXPECT_NEAR(ultra.TimesLongerThan(wide), 14.0 / 24, 1e-9);
  // One sensor: equivalents are rounded, millimetres are not.
  const LensLabel zoomed{"phone at 7.50 mm", 7.5, 26};
  EXPECT_NEAR(zoomed.TimesLongerThan(wide), 7.5 / 6.86, 1e-9);
  EXPECT_NEAR((LensLabel{"", 9, 0}.TimesLongerThan(wide)), 9 / 6.86, 1e-9);
}

TEST(LensPlan, PhotosOfOneCameraThatWereZoomedAreDivided) {
  const std::map<uint32_t, Camera> cameras = {{1, PlannedCamera(1, 500)}};
  std::map<uint32_t, DatabaseImage> images;
  LensLabels labels;
  for (uint32_t id = 1; id <= 5; ++id) {
    images[id] = {id, 1, "photo_" + std::to_string(id) + ".jpg"};
    if (id < 5)
      labels[id] = {id == 2 ? "phone at 6.00 mm" : "phone at 4.00 mm", id == 2 ? 6.0 : 4.0};
  }
  const LensPlan plan(cameras, images, labels);
  ASSERT_EQ(plan.cameras().size(), 2u);
  EXPECT_EQ(plan.images().at(5).camera_id, 1u);  // without EXIF: with most
  const uint32_t zoomed = plan.images().at(2).camera_id;
  EXPECT_NE(zoomed, 1u);
  EXPECT_DOUBLE_EQ(plan.cameras().at(zoomed).params[0], 750);
  EXPECT_FALSE(plan.cameras().at(zoomed).has_prior_focal_length);
  EXPECT_THAT(plan.notes(), ElementsAre(HasSubstr("phone at 6.00 mm of 1 of its photos")));
  SparseModel model = ModelOf(plan);
  plan.Restore(&model);
  EXPECT_EQ(model.images.at(2).camera_id, zoomed);
  EXPECT_EQ(model.images.at(1).camera_id, 1u);
}

TEST(LensPlan, PhotosAreToldACameraOfTheirOwn) {
  const std::map<uint32_t, Camera> cameras = {{1, PlannedCamera(1, 768)}};
  std::map<uint32_t, DatabaseImage> images;
  for (uint32_t id = 1; id <= 3; ++id) images[id] = {id, 1, "photo_" + std::to_string(id)};
  LensPlan plan(cameras, images);
  plan.Tell({2, 3}, PlannedCamera(77, 500));
  EXPECT_FALSE(plan.IsAsInDatabase());
  EXPECT_EQ(plan.images().at(1).camera_id, 1u);
  EXPECT_EQ(plan.images().at(3).camera_id, 2u);
  EXPECT_EQ(plan.cameras().at(2).params[0], 500);
  SparseModel model = ModelOf(plan);
  plan.Restore(&model);
  EXPECT_EQ(model.images.at(1).camera_id, 1u);
  EXPECT_EQ(model.images.at(3).camera_id, 2u);
  EXPECT_EQ(model.cameras.at(2).params[0], 500);
  plan.Tell({1}, PlannedCamera(5, 400));
  EXPECT_EQ(plan.cameras().count(1), 0u);  // nobody's any more
}

TEST(MapperVerdict, IsReadBesideItsOwnModelOnly) {
  const TempFolder folder;
  SparseModel model;
  model.images[1].image_id = 1;
  model.points[7];
  std::ofstream(folder / kMapperReportName)
      << R"({"num_reg_images": 1, "num_points": 1, "refined_intrinsics": true, "reasons": [
             {"about": "motion", "reason": "planar-ambiguous"},
             {"about": "calibration", "reason": "bent"}, 5, {"about": 3}]})";
  const MapperVerdict verdict = ReadMapperVerdict(folder.path(), model);
  EXPECT_TRUE(verdict.refined);
  EXPECT_THAT(verdict.motion, ElementsAre("planar-ambiguous"));
  EXPECT_THAT(verdict.calibration, ElementsAre("bent"));
  EXPECT_TRUE(verdict.photos.empty());
  model.points[8];
  EXPECT_TRUE(ReadMapperVerdict(folder.path(), model).motion.empty());
  std::ofstream(folder / kMapperReportName) << "no JSON";
  EXPECT_FALSE(ReadMapperVerdict(folder.path(), model).refined);
}

}  // namespace
}  // namespace roomtex
