#include "colmap_ext/lens_check.h"

#include <cmath>

#include <gmock/gmock.h>

#include "capture/simulation/simulated_room.h"
#include "core/frames.h"

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

LensSet HeldLenses(const SparseModel& model) {
  LensSet lenses;
  std::map<uint32_t, int> index;
  for (const auto& [id, camera] : model.cameras) {
    index[id] = static_cast<int>(lenses.lenses.size());
    lenses.lenses.push_back({camera, camera, false});
  }
  for (const auto& [id, image] : model.images) lenses.of_image[id] = index.at(image.camera_id);
  return lenses;
}

// What a mapper makes of the photos that holds their cameras.
SparseModel Mapped(const SparseModel& model) {
  const PhotoBundle bundle = AdjustPhotos(model, HeldLenses(model), 0.7);
  EXPECT_TRUE(bundle.usable);
  return bundle.model;
}

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
  for (int seed = 1; seed <= 3; ++seed) {
    const LensCheck check = CheckLenses(Mapped(TrueModel(seed)), {}, RefineIntrinsics::kAuto);
    ASSERT_EQ(check.lenses.size(), 1u);
    std::printf("right: %.2f +- %.2f  %.1f dev used %d\n", check.lenses[0].found.MeanFocalLength(), check.lenses[0].focal_sigma, check.lenses[0].deviations, check.lenses[0].used);
    EXPECT_FALSE(check.lenses[0].used);
    EXPECT_FALSE(check.mended);
    EXPECT_LT(check.lenses[0].deviations, 5);
    EXPECT_LT(check.lenses[0].FocalDeviations(), 4);
  }
}

TEST(LensCheck, AWrongFocalLengthIsFoundAndMended) {
  for (const double factor : {0.8, 0.97, 0.99, 1.003, 1.01, 1.03, 1.2}) {
    const SparseModel& truth = TrueModel(2);
    SparseModel wrong = truth;
    Scale(factor, &wrong.cameras.at(1));
    wrong = Mapped(wrong);
    const LensCheck check = CheckLenses(wrong, {}, RefineIntrinsics::kAuto);
    ASSERT_EQ(check.lenses.size(), 1u);
    const LensFinding& lens = check.lenses[0];
    const double f = truth.cameras.at(1).MeanFocalLength();
    std::printf("%g: %.2f true %.2f +- %.2f  %.1f dev used %d\n", factor, lens.found.MeanFocalLength(), f, lens.focal_sigma, lens.deviations, lens.used);
    ASSERT_TRUE(lens.used) << factor;
    EXPECT_LT(std::abs(lens.found.MeanFocalLength() - f), 4 * lens.focal_sigma + 0.1) << factor;
    const double before = WorstPlace(wrong, truth), after = WorstPlace(*check.mended, truth), best = WorstPlace(Mapped(truth), truth);
    std::printf("   before %.5f after %.5f best %.5f\n", before, after, best);
    EXPECT_LT(after, std::max(1.3 * best, 0.5 * before));
  }
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
  std::printf("%.2f true %.2f +- %.2f  %.1f dev used %d\n", lens.found.MeanFocalLength(), truth.cameras.at(1).MeanFocalLength(), lens.focal_sigma, lens.deviations, lens.used);
  EXPECT_TRUE(lens.used);
  ASSERT_TRUE(check.mended);
  std::printf("   before %.5f after %.5f best %.5f\n", WorstPlace(model, truth), WorstPlace(*check.mended, truth), WorstPlace(Mapped(truth), truth));
}

TEST(LensCheck, AZoomedPhotoGetsACameraOfItsOwn) {
  const SparseModel& truth = TrueModel(1);
  SparseModel zoomed = truth;
  SparseImage& image = zoomed.images.at(4);
  const Camera& camera = truth.cameras.at(1);
  const Eigen::Vector2d centre(camera.params[2], camera.params[3]);
  for (Eigen::Vector2d& x : image.points2d) x = centre + 1.3 * (x - centre);
  // The mapper places it somewhere behind.
  zoomed = Mapped(zoomed);
  const LensCheck check = CheckLenses(zoomed, {}, RefineIntrinsics::kAuto);
  for (const LensFinding& lens : check.lenses) std::printf("%zu photos %.2f +- %.2f  %.1f dev used %d %s\n", lens.photos.size(), lens.found.MeanFocalLength(), lens.focal_sigma, lens.deviations, lens.used, lens.Sentence().c_str());
  ASSERT_EQ(check.lenses.size(), 2u);
  ASSERT_TRUE(check.mended);
  std::printf("   before %.5f after %.5f best %.5f\n", WorstPlace(zoomed, truth), WorstPlace(*check.mended, truth), WorstPlace(Mapped(truth), truth));
}

}  // namespace
}  // namespace roomtex
