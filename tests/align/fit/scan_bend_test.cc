#include "align/fit/scan_bend.h"

#include <gmock/gmock.h>

#include "align/fit/bent_model.h"
#include "core/decompositions.h"
#include "core/frames.h"
#include "tests/align/surface/surface_room.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

// A full turn of samples on a sphere of 3 m, `up` up, columns running counter-clockwise or not.
Scan BallScan(const Eigen::Vector3d& up, bool counter_clockwise) {
  Scan scan;
  scan.num_columns = 200;
  scan.num_rows = 50;
  scan.up = up;
  scan.scan_from_station = {Eigen::Quaterniond::Identity(), {10, -20, 5}};
  const Eigen::Vector3d x_axis = up.unitOrthogonal(), y_axis = up.cross(x_axis);
  for (int row = 0; row < scan.num_rows; ++row) {
    const double elevation = RadFromDeg(70 - 140.0 * row / scan.num_rows);
    for (int column = 0; column < scan.num_columns; ++column) {
      const double turn = 2 * kPi * (column + 0.5) / scan.num_columns;
      const double azimuth = counter_clockwise ? turn : -turn;
      scan.points.push_back(
          scan.Station() +
          3 * (std::cos(elevation) * (std::cos(azimuth) * x_axis + std::sin(azimuth) * y_axis) +
               std::sin(elevation) * up));
    }
  }
  scan.intensity.assign(scan.points.size(), 1);
  return scan;
}

ScanBend SomeBend(const Scan& scan) {
  ScanBend bend(scan);
  for (int k = 0; k < ScanBend::kNumCoefficients; ++k) {
    bend.coefficients[k] = 0.002 * std::sin(3.0 * k + 1);
  }
  return bend;
}

TEST(ScanBend, StraighteningUndoesBending) {
  const Scan scan = BallScan(Eigen::Vector3d::UnitZ(), true);
  const ScanBend bend = SomeBend(scan);
  double farthest = 0;
  for (const Eigen::Vector3d& x : scan.points) {
    farthest = std::max(farthest, (bend.Bend(x) - x).norm());
    EXPECT_LT((bend.Bend(bend.Straighten(x)) - x).norm(), 1e-9);
  }
  EXPECT_GT(farthest, 0.02);
  EXPECT_EQ(bend.Bend(scan.Station()), scan.Station());
  const ScanBend none;
  EXPECT_TRUE(none.IsNone());
  EXPECT_EQ(none.Bend({1, 2, 3}), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(none.Straighten({1, 2, 3}), Eigen::Vector3d(1, 2, 3));
}

TEST(ScanBend, BasisIsItsDerivative) {
  const Scan scan = BallScan(Eigen::Vector3d(0.2, 1, -0.3).normalized(), false);
  for (const int i : {0, 1234, 5678, 9999}) {
    const Eigen::Vector3d x = scan.points[i];
    const auto basis = ScanBend(scan).Basis(x);
    for (int k = 0; k < ScanBend::kNumCoefficients; ++k) {
      constexpr double kStep = 1e-6;
      ScanBend more(scan), less(scan);
      more.coefficients[k] = kStep;
      less.coefficients[k] = -kStep;
      EXPECT_THAT(Eigen::Vector3d((more.Bend(x) - less.Bend(x)) / (2 * kStep)),
                  IsNearMatrix(Eigen::Vector3d(basis.col(k)), 1e-7))
          << k;
    }
  }
}

TEST(ScanBend, RangeFunctionsAreOrthonormalOnTheSphere) {
  const Scan scan = BallScan(Eigen::Vector3d::UnitZ(), true);
  const ScanBend bend(scan);
  // Equal areas: equal steps of azimuth and of height.
  Eigen::Matrix<double, ScanBend::kNumRange, ScanBend::kNumRange> products;
  products.setZero();
  constexpr int kSteps = 200;
  for (int i = 0; i < kSteps; ++i) {
    for (int k = 0; k < kSteps; ++k) {
      const double azimuth = 2 * kPi * i / kSteps, z = 2 * (k + 0.5) / kSteps - 1;
      const double radius = std::sqrt(1 - z * z);
      const Eigen::Vector3d u(radius * std::cos(azimuth), radius * std::sin(azimuth), z);
      const auto basis = bend.Basis(scan.Station() + u);
      const Eigen::Matrix<double, ScanBend::kNumRange, 1> values =
          basis.leftCols<ScanBend::kNumRange>().transpose() * u;
      products += values * values.transpose() / (kSteps * kSteps);
    }
  }
  EXPECT_THAT(
      products,
      IsNearMatrix(Eigen::MatrixXd::Identity(ScanBend::kNumRange, ScanBend::kNumRange), 2e-3));
}

TEST(ScanBend, TheDriftGrowsFromTheFirstColumnOn) {
  for (const bool counter_clockwise : {true, false}) {
    const Scan scan = BallScan(Eigen::Vector3d::UnitY(), counter_clockwise);
    ScanBend bend(scan);
    bend.coefficients[ScanBend::kNumRange] = 0.001;
    const int row = 25;
    double before = -1;
    for (int column = 2; column < 198; ++column) {
      const double drift = bend.At(scan.points[scan.Index(column, row)])[1];
      EXPECT_GT(drift, before) << column;
      before = drift;
    }
  }
}

std::optional<BendFit> Fit(const SurfaceRoom& room, const SparseModel& model, double min_bend) {
  const std::vector<bool> used(room.picks.size(), true);
  return FitScanBend(model, FindSurfacePoints(model, 3, 0.7), {room.scan}, *room.patches,
                     room.picks, used, 1.5, Similarity(), min_bend);
}

// Two cameras of one frame at the station, looking ahead and aside. first: which has the lower
// number, 0 or 1.
SparseModel RigModel(const Scan& scan, int first) {
  SparseModel model;
  Camera& camera = model.cameras[1];
  camera.camera_id = 1;
  camera.model = CameraModel::kPinhole;
  camera.width = camera.height = 400;
  camera.params = {220, 220, 200, 200};
  for (int side = 0; side < 2; ++side) {
    SparseImage image;
    image.image_id = side == first ? 1 : 2;
    image.camera_id = 1;
    image.frame_id = 7;
    image.name = side == 0 ? "ahead" : "aside";
    image.cam_from_model.rotation =
        Eigen::AngleAxisd(side == 0 ? 0 : RadFromDeg(70), Eigen::Vector3d::UnitY()) *
        RotationBetween(Eigen::Vector3d(1, 0.3, 0), Eigen::Vector3d::UnitZ());
    const Eigen::Vector3d centre = scan.Station() + Eigen::Vector3d(0.3, 0.2 * side, 0.1);
    image.cam_from_model.translation = -(image.cam_from_model.rotation * centre);
    const CameraProjection projection(camera);
    for (size_t i = 0; i < scan.points.size(); i += 37) {
      const auto x_in_img = projection.ImgFromCam(image.cam_from_model * scan.points[i]);
      if (!x_in_img || !projection.InImage(*x_in_img)) continue;
      model.points[i].x_in_model = scan.points[i];
      image.points2d.push_back(*x_in_img);
      image.point3d_ids.push_back(i);
    }
    model.images[image.image_id] = image;
  }
  return model;
}

TEST(BendModel, AFrameOfARigGoesWhereAllItsPhotosFit) {
  const Scan scan = BallScan(Eigen::Vector3d::UnitZ(), true);
  const ScanBend bend = SomeBend(scan);
  const SparseModel straight = RigModel(scan, 0);
  ASSERT_GT(straight.FindImage("ahead")->point3d_ids.size(), 20u);
  ASSERT_GT(straight.FindImage("aside")->point3d_ids.size(), 20u);
  const SparseModel bent = BendModel(straight, bend), other = BendModel(RigModel(scan, 1), bend);
  const auto pose = [](const SparseModel& model, const std::string& name) {
    return model.FindImage(name)->cam_from_model;
  };
  const auto beside = [&](const SparseModel& model) {
    return (pose(model, "aside") * pose(model, "ahead").Inverse()).translation;
  };
  EXPECT_THAT(beside(bent), IsNearMatrix(Eigen::Vector3d(beside(straight)), 1e-9));
  for (const char* name : {"ahead", "aside"}) {
    const Eigen::Vector3d centre = pose(bent, name).TargetOriginInSource();
    EXPECT_GT((centre - pose(straight, name).TargetOriginInSource()).norm(), 1e-3);
    // Whichever of them has the lower number.
    EXPECT_LT((centre - pose(other, name).TargetOriginInSource()).norm(), 1e-5);
  }
}

TEST(FitScanBend, AStraightScanStaysStraight) {
  for (int seed = 0; seed < 4; ++seed) {
    const SurfaceRoom& room = StraightRoom(seed).room;
    const SparseModel& model = StraightRoom(seed).model;
    const auto fit = Fit(room, model, 0);
    ASSERT_TRUE(fit.has_value());
    EXPECT_LT(fit->bend_rms, 0.0009) << seed;
    EXPECT_FALSE(Fit(room, model, 0.001).has_value());
  }
}

TEST(FitScanBend, FindsTheBendAndTheTrueSimilarity) {
  for (int seed = 0; seed < 3; ++seed) {
    const SurfaceRoom room(SmallRoom(seed, 0.01, 0));
    const SparseModel model = Reconstructed(room.true_model);
    const auto fit = Fit(room, model, 0.001);
    ASSERT_TRUE(fit.has_value());
    SparseModel placed = model;
    TransformModel(fit->scan_from_sparse, &placed);
    // A tenth of what the bend moves the similarity that follows the walls.
    EXPECT_LT(PoseErrorsOf(room.room, placed).position.median, 0.0025) << seed;
    double sum = 0, sum_before = 0;
    int count = 0;
    for (size_t i = 0; i < room.scan.points.size(); i += 7) {
      if (room.scan.IsMissing(i) || room.true_scan.IsMissing(i)) continue;
      sum += (fit->bend.Bend(room.true_scan.points[i]) - room.scan.points[i]).squaredNorm();
      sum_before += (room.true_scan.points[i] - room.scan.points[i]).squaredNorm();
      ++count;
    }
    EXPECT_GT(std::sqrt(sum_before / count), 0.009);
    EXPECT_LT(std::sqrt(sum / count), 0.0035);  // with 2 mm of range noise
    EXPECT_LT(fit->rms_bent, fit->rms_straight);
    EXPECT_GT(fit->num_points, 1000);
  }
}

TEST(FitScanBend, NeedsOneScanWithAGrid) {
  const SurfaceRoom room(SmallRoom(0, 0.01, 0), 1000);
  const std::vector<bool> used(room.picks.size(), true);
  const auto points = FindSurfacePoints(room.true_model, 3, 0.7);
  Scan mesh = room.scan;
  mesh.organised = false;
  for (const std::vector<Scan>& scans :
       {std::vector<Scan>{room.scan, room.scan}, std::vector<Scan>{mesh}}) {
    EXPECT_FALSE(FitScanBend(room.true_model, points, scans, *room.patches, room.picks, used, 1.5,
                             Similarity(), 0)
                     .has_value());
  }
  EXPECT_FALSE(FitScanBend(room.true_model, {}, {room.scan}, *room.patches, room.picks, used, 1.5,
                           Similarity(), 0)
                   .has_value());
}

// Noise bends a sparse model, too (here by 1.6 to 2.4 mm, which FitScanBend takes for the scan's);
// but that goes away when its poses are adjusted to a straight scan.
TEST(ScanBend, IsBelievedOnlyWhereAStraightScanContradictsThePhotos) {
  struct Case {
    int seed;
    double bend, noise_px;
  };
  for (const Case& c :
       {Case{9, 0, 1.5}, Case{13, 0, 1.5}, Case{0, 0.005, 0.7}, Case{1, 0.005, 0.7}}) {
    SimulatedRoomOptions room = CaseOptions(c.seed);
    room.bend = c.bend;
    SimulatedCase one = MakeCase(room, 8);
    one.model = Reconstructed(one.room->MakeSparseModel(2000, c.noise_px));
    const Alignment alignment = AlignCase(one);
    ASSERT_TRUE(alignment.adjusted()) << c.seed;
    EXPECT_EQ(alignment.adjustment.bend.has_value(), c.bend > 0) << c.seed;
  }
}

}  // namespace
}  // namespace roomtex
