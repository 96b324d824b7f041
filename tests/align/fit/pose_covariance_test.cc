#include "align/fit/pose_covariance.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <gmock/gmock.h>

#include "tests/align/surface/surface_room.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

struct Adjusted {
  PlaneBundle bundle;
  PoseCovariances covariances;
};

Adjusted Adjust(const SurfaceRoom& room, const SparseModel& model,
                const PlaneBundleOptions& options = {}) {
  const PlaneBundleInput input = room.Input(model);
  Adjusted adjusted{AdjustToSurface(input, options), {}};
  EXPECT_TRUE(adjusted.bundle.usable) << adjusted.bundle.reason;
  adjusted.covariances = FindCovariances(input, adjusted.bundle, options).poses;
  return adjusted;
}

Adjusted Adjust(const Reconstruction& one, const PlaneBundleOptions& options = {}) {
  return Adjust(one.room, one.model, options);
}

// e^T C^-1 e of a position that is off by e has the mean 3. What is common to half a metre of
// surface is assumed (1 mm) rather than there in this room, so that less is expected; never more.
TEST(PoseCovariance, SaysHowFarThePosesAreOff) {
  double position = 0, rotation = 0;
  int count = 0, num_far = 0;
  for (int seed = 0; seed < 3; ++seed) {
    const Reconstruction& one = StraightRoom(seed);
    const Adjusted adjusted = Adjust(one);
    for (int photo = 0; photo < one.room.room.NumPhotos(); ++photo) {
      const SparseImage* image = adjusted.bundle.model.FindImage(one.room.room.PhotoName(photo));
      const auto& covariance = adjusted.covariances.at(image->image_id);
      const Rigid truth = one.room.room.CamFromScan(photo);
      const Eigen::Vector3d offset =
          image->cam_from_model.TargetOriginInSource() - truth.TargetOriginInSource();
      const Eigen::AngleAxisd turn(image->cam_from_model.rotation * truth.rotation.conjugate());
      const Eigen::Vector3d w = turn.angle() * turn.axis();
      const Eigen::Matrix3d of_position = covariance.block<3, 3>(3, 3);
      const Eigen::Matrix3d of_rotation = covariance.block<3, 3>(0, 0);
      const double deviations2 = offset.dot(of_position.llt().solve(offset));
      position += deviations2;
      rotation += w.dot(of_rotation.llt().solve(w));
      num_far += deviations2 > 16;
      ++count;
    }
  }
  EXPECT_GT(position / count, 0.4);
  EXPECT_LT(position / count, 3.5);
  EXPECT_GT(rotation / count, 0.4);
  EXPECT_LT(rotation / count, 3.5);
  EXPECT_EQ(num_far, 0);
}

// Every three photos are one frame of a rig, whose shape is known.
TEST(PoseCovariance, PhotosOfOneFrameMoveAsOneAndAreHeldBetter) {
  const Reconstruction& one = StraightRoom(1);
  const Adjusted alone = Adjust(one);
  SparseModel rigged = one.model;
  const SimulatedRoom& room = one.room.room;
  std::vector<Rigid> true_from_first;
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    const int first = photo - photo % 3;
    true_from_first.push_back(room.CamFromScan(photo) * room.CamFromScan(first).Inverse());
    SparseImage& image = rigged.images.at(rigged.FindImage(room.PhotoName(photo))->image_id);
    image.frame_id = first / 3;
    image.cam_from_model =
        true_from_first.back() * rigged.FindImage(room.PhotoName(first))->cam_from_model;
  }
  const Adjusted adjusted = Adjust(one.room, rigged);
  double sigma_alone = 0, sigma_rigged = 0, deviations2 = 0;
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    const SparseModel& model = adjusted.bundle.model;
    const SparseImage* image = model.FindImage(room.PhotoName(photo));
    const SparseImage* first = model.FindImage(room.PhotoName(photo - photo % 3));
    EXPECT_THAT(image->cam_from_model * first->cam_from_model.Inverse(),
                IsNearRigid(true_from_first[photo], 1e-9, 1e-9));
    const auto& covariance = adjusted.covariances.at(image->image_id);
    const Eigen::Matrix3d of_position = covariance.block<3, 3>(3, 3);
    sigma_rigged += std::sqrt(of_position.trace());
    sigma_alone += std::sqrt(alone.covariances.at(image->image_id).block<3, 3>(3, 3).trace());
    const Eigen::Vector3d offset = image->cam_from_model.TargetOriginInSource() -
                                   room.CamFromScan(photo).TargetOriginInSource();
    deviations2 += offset.dot(of_position.llt().solve(offset)) / room.NumPhotos();
  }
  EXPECT_LT(sigma_rigged, 0.9 * sigma_alone);
  EXPECT_LT(deviations2, 4);
  EXPECT_LT(PoseErrorsOf(room, adjusted.bundle.model).position.median, 0.0015);
}

TEST(PoseCovariance, LeavesOutThePhotoThatIsFixed) {
  const Reconstruction& one = StraightRoom();
  PlaneBundleOptions options;
  options.fix_clicked_view = true;
  const Adjusted adjusted = Adjust(one, options);
  EXPECT_EQ(adjusted.covariances.size(), one.model.images.size() - 1);
  const uint32_t clicked = one.model.FindImage(one.room.picks[0].image_name)->image_id;
  EXPECT_EQ(adjusted.covariances.count(clicked), 0u);
}

// Twice the noise of everything: four times the covariance.
TEST(PoseCovariance, GrowsWithTheSquareOfTheNoise) {
  const Reconstruction& one = StraightRoom();
  Adjusted adjusted = Adjust(one);
  PlaneBundleInput input = one.room.Input(one.model);
  input.pick_sigma_px *= 2;
  adjusted.bundle.sigma_px *= 2;
  for (SurfaceConstraint& c : adjusted.bundle.constraints) c.sigma *= 2;
  // Residuals are smaller against the doubled noise, so that none counts less as an outlier.
  const PoseCovariances doubled = FindCovariances(input, adjusted.bundle, {}).poses;
  ASSERT_EQ(adjusted.covariances.size(), one.model.images.size());
  for (const auto& [id, covariance] : adjusted.covariances) {
    EXPECT_NEAR(doubled.at(id).trace() / covariance.trace(), 4, 0.4) << id;
  }
}

// Of many photos the matrix cannot hold the motions of their rows: each photo's own stands for
// them.
TEST(PoseCovariance, OfManyPhotosKnowsThatTheirRowsMove) {
  const Reconstruction& one = StraightRoom();
  PlaneBundleInput input = one.room.Input(one.model);
  for (const auto& [id, image] : one.model.images) input.row_motions[id] = RowMotion();
  const PlaneBundle bundle = AdjustToSurface(input, {});
  const size_t num_photos = one.model.images.size();
  const PoseCovariances exact = FindCovariances(input, bundle, {}, 2 * num_photos).poses,
                        of_many = FindCovariances(input, bundle, {}, num_photos).poses;
  input.row_motions.clear();
  const PoseCovariances still = FindCovariances(input, bundle, {}).poses;
  ASSERT_EQ(of_many.size(), num_photos);
  std::vector<double> positions, rotations, still_positions;
  for (const auto& [id, covariance] : exact) {
    const auto ratio = [&](const PoseCovariances& other, int corner) {
      return std::sqrt(other.at(id).block<3, 3>(corner, corner).trace() /
                       covariance.block<3, 3>(corner, corner).trace());
    };
    positions.push_back(ratio(of_many, 3));
    rotations.push_back(ratio(of_many, 0));
    still_positions.push_back(ratio(still, 3));
  }
  EXPECT_LT(SpreadOf(still_positions).median, 0.75);
  for (const std::vector<double>& ratios : {positions, rotations}) {
    EXPECT_GT(*std::min_element(ratios.begin(), ratios.end()), 0.95);
    EXPECT_LT(SpreadOf(ratios).median, 1.3);
  }
}

// More photos than are taken together: in groups, which know less each and nothing that is not so.
TEST(PoseCovariance, OfGroupsOfPhotosSaysMoreThanOfAllAndNeverLess) {
  const Reconstruction& one = StraightRoom();
  const PlaneBundleInput input = one.room.Input(one.model);
  PlaneBundleOptions options;
  options.refine_intrinsics = true;
  const PlaneBundle bundle = AdjustToSurface(input, options);
  const size_t num_photos = one.model.images.size();
  const BundleCovariances together = FindCovariances(input, bundle, options, num_photos),
                          in_groups = FindCovariances(input, bundle, options, num_photos / 2);
  ASSERT_EQ(together.poses.size(), num_photos);
  ASSERT_EQ(in_groups.poses.size(), num_photos);
  const auto more = [](const Eigen::MatrixXd& than, const Eigen::MatrixXd& other) {
    const Eigen::MatrixXd root = than.llt().matrixL();
    const Eigen::MatrixXd half = root.triangularView<Eigen::Lower>().solve(other);
    const Eigen::MatrixXd ratio =
        root.triangularView<Eigen::Lower>().solve(Eigen::MatrixXd(half.transpose()));
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(ratio).eigenvalues();
  };
  std::vector<double> largest;
  for (const auto& [id, covariance] : together.poses) {
    const Eigen::VectorXd ratios = more(covariance, in_groups.poses.at(id));
    EXPECT_GT(ratios.minCoeff(), 0.99) << id;
    largest.push_back(std::sqrt(ratios.maxCoeff()));
  }
  EXPECT_LT(SpreadOf(largest).median, 4);
  ASSERT_EQ(in_groups.cameras.size(), together.cameras.size());
  for (const auto& [id, covariance] : together.cameras) {
    EXPECT_GT(more(covariance, in_groups.cameras.at(id)).minCoeff(), 0.99) << id;
  }
}

TEST(PoseCovariance, IsEmptyForABundleThatIsNotUsed) {
  const Reconstruction& one = StraightRoom();
  EXPECT_TRUE(FindCovariances(one.room.Input(one.model), PlaneBundle(), {}).poses.empty());
}

}  // namespace
}  // namespace roomtex
