#include "core/three_point_pose.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

#include "core/frames.h"
#include "core/random_stream.h"

namespace roomtex {
namespace {

Eigen::Vector3d RandomVector(RandomStream* random) {
  const double x = random->Gaussian(), y = random->Gaussian();
  return {x, y, random->Gaussian()};
}

struct Sample {
  std::array<Eigen::Vector3d, 3> points, rays;
  Rigid truth;  // cam_from_target
};

// Points 0.5 to 12 m away within `spread` degrees of the optical axis.
Sample RandomSample(double spread_deg, RandomStream* random) {
  Sample sample;
  sample.truth.rotation = Eigen::Quaterniond(
      Eigen::AngleAxisd(random->Uniform(0, M_PI), RandomVector(random).normalized()));
  sample.truth.translation = 3 * RandomVector(random);
  for (int i = 0; i < 3; ++i) {
    const double lean = RadFromDeg(random->Uniform(0, spread_deg)),
                 around = random->Uniform(0, 2 * M_PI);
    const Eigen::Vector3d ray(std::sin(lean) * std::cos(around), std::sin(lean) * std::sin(around),
                              std::cos(lean));
    sample.points[i] = sample.truth.Inverse() * (random->Uniform(0.5, 12) * ray);
    sample.rays[i] = random->Uniform(0.1, 9) * ray;
  }
  return sample;
}

double WorstAngle(const Rigid& pose, const Sample& sample) {
  double worst = 0;
  for (int i = 0; i < 3; ++i) {
    worst = std::max(worst, AngleBetween(pose * sample.points[i], sample.rays[i]));
  }
  return worst;
}

TEST(ThreePointPose, TheTruePoseIsAmongThem) {
  RandomStream random(3);
  int num_found = 0;
  constexpr int kNum = 20000;
  for (int k = 0; k < kNum; ++k) {
    const Sample sample = RandomSample(45, &random);
    const std::vector<Rigid> poses = SolveThreePointPose(sample.points, sample.rays);
    ASSERT_LE(poses.size(), 4u);
    for (const Rigid& pose : poses) ASSERT_LT(WorstAngle(pose, sample), 1e-6);
    num_found += std::any_of(poses.begin(), poses.end(), [&](const Rigid& pose) {
      return RotationAngle(pose.rotation, sample.truth.rotation) < 1e-5 &&
             (pose.TargetOriginInSource() - sample.truth.TargetOriginInSource()).norm() < 1e-4;
    });
  }
  EXPECT_GE(num_found, kNum - kNum / 1000);
}

TEST(ThreePointPose, RaysBehindTheCameraAsAPanoramaHasThem) {
  RandomStream random(4);
  int num_found = 0;
  for (int k = 0; k < 2000; ++k) {
    const Sample sample = RandomSample(180, &random);
    for (const Rigid& pose : SolveThreePointPose(sample.points, sample.rays)) {
      if (RotationAngle(pose.rotation, sample.truth.rotation) > 1e-5) continue;
      ++num_found;
      break;
    }
  }
  EXPECT_GE(num_found, 1990);
}

// Of a regular tetrahedron the quartic is a cubic.
TEST(ThreePointPose, FromTheTipOfARegularTetrahedron) {
  Sample sample;
  for (int i = 0; i < 3; ++i) {
    sample.points[i] = std::sqrt(0.5) * Eigen::Vector3d::Unit(i);
    sample.rays[i] = sample.points[i] - std::sqrt(0.5) * Eigen::Vector3d::Ones();
  }
  const std::vector<Rigid> poses = SolveThreePointPose(sample.points, sample.rays);
  EXPECT_TRUE(std::any_of(poses.begin(), poses.end(), [&](const Rigid& pose) {
    return RotationAngle(pose.rotation, sample.truth.rotation) < 1e-6;
  }));
}

TEST(ThreePointPose, AsManyAsOpenCvFinds) {
  RandomStream random(5);
  int num_missed = 0, num_theirs = 0;
  for (int k = 0; k < 3000; ++k) {
    const Sample sample = RandomSample(40, &random);
    std::vector<cv::Point3d> points;
    std::vector<cv::Point2d> planes;
    for (int i = 0; i < 3; ++i) {
      points.emplace_back(sample.points[i].x(), sample.points[i].y(), sample.points[i].z());
      const Eigen::Vector2d plane = sample.rays[i].hnormalized();
      planes.emplace_back(plane.x(), plane.y());
    }
    std::vector<cv::Mat> turns, moves;
    cv::solveP3P(points, planes, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), turns, moves,
                 cv::SOLVEPNP_AP3P);
    const std::vector<Rigid> ours = SolveThreePointPose(sample.points, sample.rays);
    for (size_t i = 0; i < moves.size(); ++i) {
      const Eigen::Vector3d axis(turns[i].at<double>(0), turns[i].at<double>(1),
                                 turns[i].at<double>(2));
      if (!axis.allFinite() || axis.norm() == 0) continue;
      Rigid theirs;
      theirs.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(axis.norm(), axis.normalized()));
      theirs.translation = {moves[i].at<double>(0), moves[i].at<double>(1), moves[i].at<double>(2)};
      // Of what it finds some are no solutions.
      if (!(WorstAngle(theirs, sample) < 1e-6)) continue;
      ++num_theirs;
      num_missed += std::none_of(ours.begin(), ours.end(), [&](const Rigid& pose) {
        return RotationAngle(pose.rotation, theirs.rotation) < 1e-4;
      });
    }
  }
  EXPECT_GT(num_theirs, 3000);
  EXPECT_LE(num_missed, num_theirs / 500);
}

TEST(ThreePointPose, NoneWherePointsOrRaysTellNone) {
  const std::array<Eigen::Vector3d, 3> rays = {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0.2, 0, 1),
                                               Eigen::Vector3d(0, 0.2, 1)};
  const std::array<Eigen::Vector3d, 3> points = {
      Eigen::Vector3d(0, 0, 3), Eigen::Vector3d(0.6, 0, 3), Eigen::Vector3d(0, 0.6, 3)};
  EXPECT_FALSE(SolveThreePointPose(points, rays).empty());
  EXPECT_TRUE(SolveThreePointPose({points[0], points[1], 2 * points[1] - points[0]}, rays).empty());
  EXPECT_TRUE(SolveThreePointPose({points[0], points[0], points[2]}, rays).empty());
  EXPECT_TRUE(SolveThreePointPose(points, {rays[0], rays[0], rays[2]}).empty());
  EXPECT_TRUE(SolveThreePointPose(points, {rays[0], Eigen::Vector3d::Zero(), rays[2]}).empty());
  const Eigen::Vector3d missing = Eigen::Vector3d::Constant(NAN);
  EXPECT_TRUE(SolveThreePointPose({points[0], missing, points[2]}, rays).empty());
}

}  // namespace
}  // namespace roomtex
