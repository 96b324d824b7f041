#include "colmap_ext/lens_check.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "capture/simulation/simulated_room.h"

namespace roomtex {
namespace {

using testing::HasSubstr;

// A room with 16 photos, true poses and points, keypoints with 0.7 pixels of noise.
const SparseModel& TrueModel(int seed = 1) {
  static std::map<int, SparseModel> models;
  auto at = models.find(seed);
  if (at == models.end()) {
    SimulatedRoomOptions options;
    options.random_seed = seed;
    options.num_photos = 16;
    at = models.emplace(seed, SimulatedRoom(options).MakeSparseModel(2500, 0.7)).first;
  }
  return at->second;
}

// What a mapper makes of the photos that holds their cameras.
SparseModel Mapped(const SparseModel& model) { return AdjustedByPhotos(model, 0.7); }

void Scale(double factor, Camera* camera) {
  camera->params[0] *= factor;
  camera->params[1] *= factor;
}

// Largest distance of a camera from its true place after the best similarity, as a share of the
// room.
double WorstPlace(const SparseModel& model, const SparseModel& truth) {
  Eigen::Matrix3Xd from(3, truth.images.size()), to(3, truth.images.size());
  int i = 0;
  for (const auto& [id, image] : truth.images) {
    from.col(i) = model.images.at(id).cam_from_model.TargetOriginInSource();
    to.col(i++) = image.cam_from_model.TargetOriginInSource();
  }
  const Similarity fit = FitSimilarity(from, to);
  double worst = 0;
  for (i = 0; i < from.cols(); ++i) {
    worst = std::max(worst, (fit * from.col(i) - to.col(i)).norm());
  }
  const Eigen::Vector3d middle = to.rowwise().mean();
  return worst / std::sqrt((to.colwise() - middle).colwise().squaredNorm().mean());
}

TEST(LensCheck, ALensThatIsToldRightStays) {
  for (int seed = 1; seed <= 2; ++seed) {
    const LensCheck check = CheckLenses(Mapped(TrueModel(seed)), {}, RefineIntrinsics::kAuto);
    ASSERT_EQ(check.lenses.size(), 1u);
    EXPECT_FALSE(check.lenses[0].used);
    EXPECT_FALSE(check.mended);
    EXPECT_LT(check.lenses[0].deviations, 5);
    EXPECT_LT(check.lenses[0].FocalDeviations(), 4);
  }
}

// As a rolling shutter of 20 ms in a moving hand: the rows of each photo are shifted, up to 4
// pixels at the top and the bottom, another way each.
SparseModel WithShiftedRows(SparseModel model) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> shift(-4, 4);
  for (auto& [id, image] : model.images) {
    const Camera& camera = model.cameras.at(image.camera_id);
    const Eigen::Vector2d at_edge(shift(random), shift(random));
    for (Eigen::Vector2d& x : image.points2d) x += (2 * x.y() / camera.height - 1) * at_edge;
  }
  return model;
}

TEST(LensCheck, WhatDiffersFromPhotoToPhotoIsNoReasonForAnotherLens) {
  const SparseModel shifted = WithShiftedRows(TrueModel(2));
  const double f = shifted.cameras.at(1).MeanFocalLength();
  const LensCheck right = CheckLenses(Mapped(shifted), {}, RefineIntrinsics::kAuto);
  ASSERT_EQ(right.lenses.size(), 1u);
  EXPECT_FALSE(right.lenses[0].used) << right.lenses[0].deviations;
  EXPECT_LT(std::abs(right.lenses[0].found.MeanFocalLength() - f), 3 * right.lenses[0].focal_sigma);
  // A lens that is wrong is wrong in all of them.
  SparseModel wrong = shifted;
  Scale(1.03, &wrong.cameras.at(1));
  const LensCheck mended = CheckLenses(Mapped(wrong), {}, RefineIntrinsics::kAuto);
  EXPECT_TRUE(mended.lenses[0].used);
  EXPECT_LT(std::abs(mended.lenses[0].found.MeanFocalLength() - f),
            3 * mended.lenses[0].focal_sigma);
}

TEST(LensCheck, AWrongFocalLengthIsFoundAndMended) {
  const SparseModel& truth = TrueModel(2);
  const double best = WorstPlace(Mapped(truth), truth);
  for (const double factor : {0.8, 0.97, 1.01, 1.2}) {
    SparseModel wrong = truth;
    Scale(factor, &wrong.cameras.at(1));
    wrong = Mapped(wrong);
    const LensCheck check = CheckLenses(wrong, {}, RefineIntrinsics::kAuto);
    ASSERT_EQ(check.lenses.size(), 1u);
    const LensFinding& lens = check.lenses[0];
    const double f = truth.cameras.at(1).MeanFocalLength();
    ASSERT_TRUE(lens.used) << factor;
    EXPECT_LT(std::abs(lens.found.MeanFocalLength() - f), 4 * lens.focal_sigma + 0.1) << factor;
    EXPECT_GT(WorstPlace(wrong, truth), 2 * best);
    EXPECT_LT(WorstPlace(*check.mended, truth), 1.3 * best);
    EXPECT_THAT(lens.Sentence(), HasSubstr("standard deviations"));
  }
  // Told to keep it, it looks all the same.
  SparseModel wrong = truth;
  Scale(1.03, &wrong.cameras.at(1));
  const LensCheck held = CheckLenses(Mapped(wrong), {}, RefineIntrinsics::kNever);
  EXPECT_FALSE(held.mended);
  ASSERT_EQ(held.lenses.size(), 1u);
  EXPECT_TRUE(held.lenses[0].Contradicts());
  EXPECT_FALSE(held.lenses[0].used);
}

// Two halves of a model that share one photo and no point: how large one is beside the other stays
// open, but their lens does not.
SparseModel AsTwoHalves(SparseModel model) {
  const uint32_t shared = std::next(model.images.begin(), 8)->first;
  const SparseModel whole = model;
  for (auto& [id, image] : model.images) {
    std::fill(image.point3d_ids.begin(), image.point3d_ids.end(), kInvalidPoint3dId);
  }
  for (const auto& [point_id, point] : whole.points) {
    std::vector<TrackElement> first, second;
    for (const TrackElement& element : point.track) {
      if (element.image_id <= shared) first.push_back(element);
      if (element.image_id >= shared) second.push_back(element);
    }
    std::vector<TrackElement>& track = model.points.at(point_id).track;
    track = first.size() >= second.size() ? first : second;
    if (track.size() < 2) {
      model.points.erase(point_id);
      continue;
    }
    for (const TrackElement& element : track) {
      model.images.at(element.image_id).point3d_ids[element.point2d_index] = point_id;
    }
  }
  return model;
}

TEST(LensCheck, HalvesThatOnePhotoConnectsKnowTheirLens) {
  for (int seed = 1; seed <= 3; ++seed) {
    SparseModel wrong = AsTwoHalves(TrueModel(seed));
    const double f = wrong.cameras.at(1).MeanFocalLength();
    Scale(1.045, &wrong.cameras.at(1));
    const LensCheck check = CheckLenses(Mapped(wrong), {}, RefineIntrinsics::kAuto);
    ASSERT_EQ(check.lenses.size(), 1u);
    const LensFinding& lens = check.lenses[0];
    EXPECT_TRUE(lens.used) << seed;
    EXPECT_LT(lens.focal_sigma, 0.01 * f) << seed;
    EXPECT_LT(std::abs(lens.found.MeanFocalLength() - f), 4 * lens.focal_sigma + 0.1) << seed;
  }
}

// What a bundle adjustment of single photos cannot mend it can look at.
TEST(LensCheck, LensesOfRigsAndBesidePanoramasAreLookedAt) {
  SparseModel wrong = TrueModel(2);
  const double f = wrong.cameras.at(1).MeanFocalLength();
  Scale(1.01, &wrong.cameras.at(1));
  wrong = Mapped(wrong);
  SparseModel rig = wrong, beside = wrong;
  for (auto& [id, image] : rig.images) image.frame_id = id;
  Camera panorama;
  panorama.camera_id = 2;
  panorama.model = CameraModel::kEquirectangular;
  panorama.width = 2000;
  panorama.height = 1000;
  beside.cameras[2] = panorama;
  beside.images.begin()->second.camera_id = 2;
  for (const SparseModel& model : {rig, beside}) {
    const LensCheck check = CheckLenses(model, {}, RefineIntrinsics::kAuto);
    ASSERT_EQ(check.lenses.size(), 1u);
    EXPECT_TRUE(check.only_looked_at);
    EXPECT_FALSE(check.mended);
    EXPECT_FALSE(check.lenses[0].used);
    EXPECT_TRUE(check.lenses[0].Contradicts());
    EXPECT_NEAR(check.lenses[0].found.MeanFocalLength() / f, 1, 0.003);
  }
  SparseModel right = Mapped(TrueModel(2));
  EXPECT_FALSE(CheckLenses(right, {}, RefineIntrinsics::kAuto).only_looked_at);
  for (auto& [id, image] : right.images) image.frame_id = id;
  EXPECT_FALSE(CheckLenses(right, {}, RefineIntrinsics::kAuto).lenses.at(0).Contradicts());
}

TEST(LensCheck, CamerasThatWereRefinedOneByOneAreOneLens) {
  const SparseModel& truth = TrueModel(3);
  SparseModel each = truth;
  LensSet own;
  for (auto& [id, image] : each.images) {
    Camera camera = truth.cameras.at(1);
    camera.camera_id = 100 + id;
    Scale(1.2, &camera);
    own.of_image[id] = static_cast<int>(own.lenses.size());
    own.lenses.push_back({camera, camera, true});
    image.camera_id = camera.camera_id;
    each.cameras[camera.camera_id] = camera;
  }
  each.cameras.erase(1);
  const PhotoBundle mapped = AdjustPhotos(each, own, 0.7);
  ASSERT_TRUE(mapped.usable);
  const SparseModel model = WithLenses(mapped.model, mapped.lenses);
  const LensCheck check = CheckLenses(model, {}, RefineIntrinsics::kAuto);
  ASSERT_EQ(check.lenses.size(), 1u);
  const LensFinding& lens = check.lenses[0];
  EXPECT_TRUE(lens.used);
  EXPECT_EQ(lens.camera_ids.size(), 16u);
  EXPECT_LT(std::abs(lens.found.MeanFocalLength() - truth.cameras.at(1).MeanFocalLength()),
            4 * lens.focal_sigma);
  ASSERT_TRUE(check.mended);
  EXPECT_LT(WorstPlace(*check.mended, truth), 1.3 * WorstPlace(Mapped(truth), truth));
  EXPECT_LT(WorstPlace(*check.mended, truth), 0.5 * WorstPlace(model, truth));
  for (const auto& [id, camera] : check.mended->cameras) {
    EXPECT_EQ(camera.params, check.mended->cameras.begin()->second.params);
    EXPECT_EQ(check.lens_of_camera.at(id), 0);
  }
}

TEST(LensCheck, ALensThatStaysIsAsToldWhileAnotherIsMended) {
  const SparseModel& truth = TrueModel(1);
  SparseModel model = truth;
  LensLabels labels;
  for (auto& [id, image] : model.images) {
    const uint32_t camera_id = id <= 4 ? 1 : id <= 8 ? 2 : 3;
    Camera camera = truth.cameras.at(1);
    camera.camera_id = camera_id;
    if (camera_id == 3) Scale(1.03, &camera);
    image.camera_id = camera_id;
    model.cameras[camera_id] = camera;
    labels[id].text = camera_id == 3 ? "a phone" : "a camera";
  }
  const SparseModel told = model;
  const LensCheck check = CheckLenses(Mapped(model), labels, RefineIntrinsics::kAuto);
  ASSERT_EQ(check.lenses.size(), 2u);
  ASSERT_TRUE(check.mended);
  for (const LensFinding& lens : check.lenses) EXPECT_EQ(lens.used, lens.camera_ids.size() == 1);
  for (const auto& [id, image] : check.mended->images) {
    const Camera& kept = check.mended->cameras.at(image.camera_id);
    if (id <= 8) {
      EXPECT_EQ(kept.params, told.cameras.at(told.images.at(id).camera_id).params) << id;
    } else {
      EXPECT_NEAR(kept.MeanFocalLength() / truth.cameras.at(1).MeanFocalLength(), 1, 0.003);
    }
  }
}

TEST(LensCheck, AZoomedPhotoGetsACameraOfItsOwn) {
  const SparseModel& truth = TrueModel(1);
  SparseModel zoomed = truth;
  SparseImage& image = zoomed.images.at(4);
  const std::string name = image.name;
  const Camera& camera = truth.cameras.at(1);
  const Eigen::Vector2d centre(camera.params[2], camera.params[3]);
  for (Eigen::Vector2d& x : image.points2d) x = centre + 1.3 * (x - centre);
  // The mapper places it somewhere behind.
  zoomed = Mapped(zoomed);
  const LensCheck check = CheckLenses(zoomed, {}, RefineIntrinsics::kAuto);
  ASSERT_EQ(check.lenses.size(), 2u);
  const LensFinding& apart = check.lenses[1];
  EXPECT_TRUE(apart.apart);
  EXPECT_EQ(apart.photos, std::vector<std::string>{name});
  EXPECT_NEAR(apart.found.MeanFocalLength() / camera.MeanFocalLength(), 1.3, 0.01);
  ASSERT_TRUE(check.mended);
  EXPECT_EQ(check.mended->cameras.size(), 2u);
  EXPECT_NE(check.mended->images.at(4).camera_id, 1u);
  EXPECT_GT(WorstPlace(zoomed, truth), 50 * WorstPlace(Mapped(truth), truth));
  EXPECT_LT(WorstPlace(*check.mended, truth), 1.5 * WorstPlace(Mapped(truth), truth));
}

}  // namespace
}  // namespace roomtex
