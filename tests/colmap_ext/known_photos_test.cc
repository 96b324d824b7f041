#include "colmap_ext/known_photos.h"

#include <gmock/gmock.h>

#include "core/error.h"
#include "tests/colmap_ext/sparse_model_maker.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using testing::ElementsAre;
using testing::SizeIs;

std::map<uint32_t, DatabaseImage> Images(const std::map<uint32_t, std::string>& names) {
  std::map<uint32_t, DatabaseImage> images;
  for (const auto& [id, name] : names) images[id] = {id, 3, name};
  return images;
}

SparseModel TwoPhotos() {
  SparseModel known;
  known.cameras[1] = MakeSparseModel().cameras.at(3);
  known.images[1] = {1, 1, "hall_1.jpg", Rigid(), {}, {}};
  known.images[2] = {2, 1, "hall_2.jpg", Rigid(), {}, {}};
  return known;
}

TEST(KnownPhotos, AreFoundByNameAlsoInAFolderOfTheirs) {
  const std::map<uint32_t, Camera> cameras = {{3, MakeSparseModel().cameras.at(3)}};
  const KnownPhotos found = FindKnownPhotos(
      "known", TwoPhotos(),
      Images({{7, "scanner/hall_1.jpg"}, {8, "mine/a_hall_1.jpg"}, {9, "b.jpg"}}), cameras);
  ASSERT_THAT(found.cam_from_scan, SizeIs(1));
  EXPECT_EQ(found.cam_from_scan.begin()->first, 7u);
  EXPECT_THAT(found.unmatched, ElementsAre("hall_2.jpg"));
  // Two photos of that name: nobody knows which.
  EXPECT_THAT(FindKnownPhotos("known", TwoPhotos(),
                              Images({{7, "a/hall_1.jpg"}, {8, "b/hall_1.jpg"}, {9, "hall_2.jpg"}}),
                              cameras)
                  .cam_from_scan,
              SizeIs(1));
}

TEST(KnownPhotos, PanoramasAreToBeCut) {
  SparseModel known = TwoPhotos();
  known.cameras.at(1).model = CameraModel::kEquirectangular;
  EXPECT_INPUT_ERROR(FindKnownPhotos("known", known, Images({{7, "hall_1.jpg"}}), {}),
                     "hall_1.jpg: is a panorama");
}

class KnownFitTest : public testing::Test {
 protected:
  // Of the model in another frame and size.
  KnownFitTest() : model_(MakeSparseModel()) {
    truth_ = {2.5, Eigen::Quaterniond(0.3, 0.8, -0.2, 0.4).normalized(), {10, -20, 3}};
    for (const auto& [id, image] : model_.images) {
      if (image.points2d.empty()) continue;  // sees nothing
      known_.cam_from_scan[id] = CamFromScan(image.cam_from_model, truth_);
    }
  }
  SparseModel model_;
  Similarity truth_;
  KnownPhotos known_;
};

TEST_F(KnownFitTest, FindsTheSimilarityExactly) {
  const KnownFit fit = FitToKnown(model_, known_);
  ASSERT_EQ(fit.kind, KnownFit::Kind::kPlaced);
  EXPECT_NEAR(fit.scan_from_sparse.scale, truth_.scale, 1e-9);
  EXPECT_LT(RotationAngle(fit.scan_from_sparse.rotation, truth_.rotation), 1e-7);
  EXPECT_LT((fit.scan_from_sparse.translation - truth_.translation).norm(), 1e-6);
  EXPECT_LT(fit.position_rms, 1e-6);
  EXPECT_THAT(fit.agreeing, SizeIs(known_.cam_from_scan.size()));
}

TEST_F(KnownFitTest, TwoAreEnoughAndOneIsNot) {
  known_.cam_from_scan.erase(known_.cam_from_scan.begin());
  EXPECT_EQ(FitToKnown(model_, known_).kind, KnownFit::Kind::kPlaced);
  while (known_.cam_from_scan.size() > 1) known_.cam_from_scan.erase(known_.cam_from_scan.begin());
  EXPECT_EQ(FitToKnown(model_, known_).kind, KnownFit::Kind::kTooFew);
}

TEST_F(KnownFitTest, PhotosOfOneStandpointLeaveTheScaleOpen) {
  for (auto& [id, image] : model_.images) {
    image.cam_from_model.translation = image.cam_from_model.rotation * Eigen::Vector3d(1, 2, 3);
    if (known_.cam_from_scan.count(id) > 0) {
      known_.cam_from_scan.at(id) = CamFromScan(image.cam_from_model, truth_);
    }
  }
  EXPECT_EQ(FitToKnown(model_, known_).kind, KnownFit::Kind::kOnePlace);
}

}  // namespace
}  // namespace roomtex
