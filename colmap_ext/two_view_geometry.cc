#include "colmap_ext/two_view_geometry.h"

#include <cmath>
#include <limits>
#include <numeric>

#include <Eigen/Dense>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include "colmap_ext/triangulation.h"
#include "core/decompositions.h"

namespace roomtex {
namespace {

using Matrix9d = Eigen::Matrix<double, 9, 9>;
using Vector9d = Eigen::Matrix<double, 9, 1>;

// Moves points to mean 0 and mean distance sqrt(2) (Hartley 1997).
Eigen::Matrix3d HartleyNormalisation(const std::vector<RayMatch>& matches,
                                     const std::vector<int>& indices, Ray RayMatch::*side) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const int i : indices) mean += (matches[i].*side).x;
  mean /= static_cast<double>(indices.size());
  double distance = 0;
  for (const int i : indices) distance += ((matches[i].*side).x - mean).norm();
  distance /= static_cast<double>(indices.size());
  const double scale = distance > 1e-12 ? std::sqrt(2.0) / distance : 1.0;
  Eigen::Matrix3d normalised_from_ray;
  normalised_from_ray << scale, 0, -scale * mean.x(), 0, scale, -scale * mean.y(), 0, 0, 1;
  return normalised_from_ray;
}

// Row-major matrix of the right singular vector of least singular value; `gap` is how much larger
// the next singular value is (squared, relative to the largest).
Eigen::Matrix3d NullMatrix(const Matrix9d& normal, double* gap) {
  const SymmetricEigen of_normal(normal);
  const Vector9d f = of_normal.vectors.col(0);
  *gap = of_normal.values[1] / of_normal.values[8];
  Eigen::Matrix3d matrix;
  matrix << f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8];
  return matrix;
}

std::vector<Eigen::Matrix3d> AsModels(const std::optional<Eigen::Matrix3d>& model) {
  if (!model) return {};
  return {*model};
}

}  // namespace

double EpipolarError2(const Eigen::Matrix3d& right_f_left, const RayMatch& match) {
  const Eigen::Vector3d line_in_right = right_f_left * match.left.Direction();
  const Eigen::Vector3d line_in_left = right_f_left.transpose() * match.right.Direction();
  const double value = match.right.Direction().dot(line_in_right);
  const double slope2 =
      (match.left.ray_from_img.transpose() * line_in_left.head<2>()).squaredNorm() +
      (match.right.ray_from_img.transpose() * line_in_right.head<2>()).squaredNorm();
  return value * value / slope2;
}

double HomographyError2(const Eigen::Matrix3d& right_from_left, const RayMatch& match) {
  const Eigen::Vector3d y = right_from_left * match.left.Direction();
  if (!(y.z() > 1e-12)) return std::numeric_limits<double>::infinity();
  const Eigen::Vector2d predicted = y.hnormalized();
  Eigen::Matrix2d right_from_left_ray;  // derivative of the transfer
  for (int k = 0; k < 2; ++k) {
    right_from_left_ray.col(k) =
        (right_from_left.block<2, 1>(0, k) - predicted * right_from_left(2, k)) / y.z();
  }
  const Eigen::Matrix2d left_noise =
      match.right.img_from_ray * right_from_left_ray * match.left.ray_from_img;
  const Eigen::Matrix2d covariance =  // for keypoint noise of 1 px
      Eigen::Matrix2d::Identity() + left_noise * left_noise.transpose();
  const Eigen::Vector2d error = match.right.PixelError(predicted);
  return error.dot(covariance.inverse() * error);
}

std::optional<Eigen::Matrix3d> FitFundamental(const std::vector<RayMatch>& matches,
                                              const std::vector<int>& indices) {
  if (indices.size() < 8) return std::nullopt;
  const Eigen::Matrix3d left = HartleyNormalisation(matches, indices, &RayMatch::left);
  const Eigen::Matrix3d right = HartleyNormalisation(matches, indices, &RayMatch::right);
  Matrix9d normal = Matrix9d::Zero();
  for (const int i : indices) {
    const Eigen::Vector3d x = left * matches[i].left.Direction();
    const Eigen::Vector3d y = right * matches[i].right.Direction();
    Vector9d row;
    row << y.x() * x, y.y() * x, y.z() * x;
    normal.selfadjointView<Eigen::Lower>().rankUpdate(row);
  }
  double gap = 0;
  const Eigen::Matrix3d full = NullMatrix(normal, &gap);
  Eigen::JacobiSVD<Eigen::Matrix3d> svd(full, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d values = svd.singularValues();
  values[2] = 0;
  const Eigen::Matrix3d rank2 = svd.matrixU() * values.asDiagonal() * svd.matrixV().transpose();
  const Eigen::Matrix3d f = right.transpose() * rank2 * left;
  if (!f.allFinite() || !(f.norm() > 0)) return std::nullopt;
  return Eigen::Matrix3d(f / f.norm());
}

std::optional<Eigen::Matrix3d> FitHomography(const std::vector<RayMatch>& matches,
                                             const std::vector<int>& indices) {
  if (indices.size() < 4) return std::nullopt;
  const Eigen::Matrix3d left = HartleyNormalisation(matches, indices, &RayMatch::left);
  const Eigen::Matrix3d right = HartleyNormalisation(matches, indices, &RayMatch::right);
  Matrix9d normal = Matrix9d::Zero();
  for (const int i : indices) {
    const Eigen::Vector3d x = left * matches[i].left.Direction();
    const Eigen::Vector3d y = right * matches[i].right.Direction();
    Vector9d row;
    row << x, Eigen::Vector3d::Zero(), -y.x() * x;
    normal.selfadjointView<Eigen::Lower>().rankUpdate(row);
    row << Eigen::Vector3d::Zero(), x, -y.y() * x;
    normal.selfadjointView<Eigen::Lower>().rankUpdate(row);
  }
  double gap = 0;
  const Eigen::Matrix3d normalised = NullMatrix(normal, &gap);
  if (!(gap > 1e-14)) return std::nullopt;  // collinear points
  Eigen::Matrix3d h = right.inverse() * normalised * left;
  if (!h.allFinite() || !(std::abs(h.determinant()) > 1e-12 * std::pow(h.norm(), 3))) {
    return std::nullopt;
  }
  h /= h.norm();
  int num_in_front = 0;
  for (const int i : indices) {
    const bool in_front = matches[i].right.Direction().dot(h * matches[i].left.Direction()) > 0;
    num_in_front += in_front ? 1 : -1;
  }
  if (num_in_front < 0) h = -h;
  return h;
}

std::optional<Eigen::Matrix3d> FitRotation(const std::vector<RayMatch>& matches,
                                           const std::vector<int>& indices) {
  if (indices.size() < 2) return std::nullopt;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const int i : indices) {
    sum += matches[i].right.Direction().normalized() *
           matches[i].left.Direction().normalized().transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0) signs[2] = -1;
  return Eigen::Matrix3d(svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose());
}

std::vector<Eigen::Matrix3d> FitEssential(const std::vector<RayMatch>& matches,
                                          const std::vector<int>& five) {
  std::vector<cv::Point2d> left, right;
  for (const int i : five) {
    left.emplace_back(matches[i].left.x.x(), matches[i].left.x.y());
    right.emplace_back(matches[i].right.x.x(), matches[i].right.x.y());
  }
  std::vector<Eigen::Matrix3d> essentials;
  cv::Mat stacked;  // 3 rows per solution
  try {
    stacked = cv::findEssentialMat(left, right, cv::Mat::eye(3, 3, CV_64F));
  } catch (const cv::Exception&) {
    return essentials;
  }
  for (int row = 0; row + 3 <= stacked.rows; row += 3) {
    Eigen::Matrix3d essential;
    cv::cv2eigen(stacked.rowRange(row, row + 3), essential);
    if (essential.allFinite() && essential.norm() > 0) {
      essentials.push_back(essential / essential.norm());
    }
  }
  return essentials;
}

RansacResult EstimateFundamental(const std::vector<RayMatch>& matches,
                                 const RansacOptions& options) {
  const auto fit = [&](const std::vector<int>& sample) {
    return AsModels(FitFundamental(matches, sample));
  };
  return RunRansac(static_cast<int>(matches.size()), 8, options, fit, fit,
                   [&](const Eigen::Matrix3d& f, int i) { return EpipolarError2(f, matches[i]); });
}

RansacResult EstimateEssential(const std::vector<RayMatch>& matches, const RansacOptions& options) {
  // Eight points or more by least squares help in a volume and harm nothing on a plane: a worse
  // model is not taken.
  const auto refine = [&](const std::vector<int>& inliers) {
    std::vector<Eigen::Matrix3d> models = AsModels(FitFundamental(matches, inliers));
    for (Eigen::Matrix3d& model : models) model = EssentialFromFundamental(model);
    return models;
  };
  return RunRansac(
      static_cast<int>(matches.size()), 5, options,
      [&](const std::vector<int>& sample) { return FitEssential(matches, sample); }, refine,
      [&](const Eigen::Matrix3d& e, int i) { return EpipolarError2(e, matches[i]); });
}

RansacResult EstimateHomography(const std::vector<RayMatch>& matches, const std::vector<int>& among,
                                const RansacOptions& options) {
  std::vector<RayMatch> chosen;
  chosen.reserve(among.size());
  for (const int i : among) chosen.push_back(matches[i]);
  const auto fit = [&](const std::vector<int>& sample) {
    return AsModels(FitHomography(chosen, sample));
  };
  RansacResult result =
      RunRansac(static_cast<int>(chosen.size()), 4, options, fit, fit,
                [&](const Eigen::Matrix3d& h, int i) { return HomographyError2(h, chosen[i]); });
  for (int& i : result.inliers) i = among[i];
  return result;
}

RansacResult EstimateRotation(const std::vector<RayMatch>& matches, const RansacOptions& options) {
  const auto fit = [&](const std::vector<int>& sample) {
    return AsModels(FitRotation(matches, sample));
  };
  return RunRansac(
      static_cast<int>(matches.size()), 2, options, fit, fit,
      [&](const Eigen::Matrix3d& r, int i) { return HomographyError2(r, matches[i]); });
}

Eigen::Matrix3d EssentialFromFundamental(const Eigen::Matrix3d& right_f_left) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(right_f_left,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  return svd.matrixU() * Eigen::Vector3d(1, 1, 0).asDiagonal() * svd.matrixV().transpose();
}

Eigen::Matrix3d EssentialFromPose(const Rigid& right_from_left) {
  const Eigen::Vector3d& t = right_from_left.translation;
  Eigen::Matrix3d cross;
  cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  return cross * right_from_left.rotation.toRotationMatrix();
}

std::vector<Rigid> PosesFromEssential(const Eigen::Matrix3d& right_e_left) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(right_e_left,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU(), v = svd.matrixV();
  if (u.determinant() < 0) u.col(2) = -u.col(2);
  if (v.determinant() < 0) v.col(2) = -v.col(2);
  Eigen::Matrix3d w;
  w << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  std::vector<Rigid> poses;
  // Thesis 3.2.2: [U W V^T | +-u3] and [U W^T V^T | +-u3].
  for (const Eigen::Matrix3d& turn : {Eigen::Matrix3d(w), Eigen::Matrix3d(w.transpose())}) {
    for (const double sign : {1.0, -1.0}) {
      Rigid pose;
      pose.rotation = Eigen::Quaterniond(Eigen::Matrix3d(u * turn * v.transpose())).normalized();
      pose.translation = sign * u.col(2);
      poses.push_back(pose);
    }
  }
  return poses;
}

std::vector<Rigid> PosesFromHomography(const Eigen::Matrix3d& right_from_left) {
  cv::Mat h;
  cv::eigen2cv(right_from_left, h);
  std::vector<cv::Mat> rotations, translations, normals;
  cv::decomposeHomographyMat(h, cv::Mat::eye(3, 3, CV_64F), rotations, translations, normals);
  std::vector<Rigid> poses;
  for (size_t i = 0; i < rotations.size(); ++i) {
    Eigen::Matrix3d rotation;
    Eigen::Vector3d translation;
    cv::cv2eigen(rotations[i], rotation);
    cv::cv2eigen(translations[i], translation);
    if (!rotation.allFinite() || !(translation.norm() > 1e-9)) continue;
    poses.push_back({Eigen::Quaterniond(rotation).normalized(), translation.normalized()});
  }
  return poses;
}

int CountInFront(const Rigid& right_from_left, const std::vector<RayMatch>& matches,
                 const std::vector<int>& indices) {
  int count = 0;
  for (const int i : indices) {
    const auto point = TriangulatePair(right_from_left, matches[i].left.x, matches[i].right.x);
    if (point && ProjectPoint(right_from_left, *point)) ++count;
  }
  return count;
}

}  // namespace roomtex
