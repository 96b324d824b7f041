#include "align/fit/ray_similarity.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "core/decompositions.h"
#include "core/frames.h"
#include "core/twist.h"

namespace roomtex {
namespace {

using Vector9d = Eigen::Matrix<double, 9, 1>;
using Matrix9d = Eigen::Matrix<double, 9, 9>;

constexpr int kNumStarts = 96;          // neighbours are some 40 degrees apart
constexpr double kSameRotation = 1e-3;  // radians; two minima are the same one
// Share of the points that a minimum may have behind their cameras: a wrong pick among good ones.
constexpr double kMaxBehind = 0.2;
// Of the four numbers (translation, scale), the least that the rays fix as a share of the best.
constexpr double kLeastCondition = 1e-10;

// All over SO(3), about equally dense: a spiral over the quaternions' sphere (Alexa 2022,
// "Super-Fibonacci Spirals: Fast, Low-Discrepancy Sampling of SO(3)").
Eigen::Quaterniond StartRotation(int index) {
  const double phi = std::sqrt(2.0), psi = 1.533751168755204288118041;
  const double s = index + 0.5, t = s / kNumStarts;
  const double alpha = 2 * kPi * s / phi, beta = 2 * kPi * s / psi;
  const double r = std::sqrt(t), q = std::sqrt(1 - t);
  return Eigen::Quaterniond(q * std::cos(beta), r * std::sin(alpha), r * std::cos(alpha),
                            q * std::sin(beta))
      .normalized();
}

// cost(R) = vec(R)^T form vec(R), (translation, scale) = follow * vec(R); points and origins about
// their middle and of unit size.
struct Form {
  Matrix9d form = Matrix9d::Zero();
  Eigen::Matrix<double, 4, 9> follow = Eigen::Matrix<double, 4, 9>::Zero();
  Eigen::Vector3d middle_of_points, middle_of_origins;
  double size_of_points = 0, size_of_origins = 0;

  bool IsUsable() const { return size_of_points > 0 && size_of_origins > 0; }
};

double SizeOf(const Eigen::Matrix3Xd& points, const Eigen::Vector3d& middle) {
  return std::sqrt((points.colwise() - middle).squaredNorm() / static_cast<double>(points.cols()));
}

Form MakeForm(const RaysToScan& rays) {
  Form form;
  form.middle_of_points = rays.x_in_scan.rowwise().mean();
  form.middle_of_origins = rays.origins.rowwise().mean();
  form.size_of_points = SizeOf(rays.x_in_scan, form.middle_of_points);
  form.size_of_origins = SizeOf(rays.origins, form.middle_of_origins);
  if (!form.IsUsable()) return form;
  Matrix9d aa = Matrix9d::Zero();
  Eigen::Matrix<double, 4, 9> ba = Eigen::Matrix<double, 4, 9>::Zero();
  Eigen::Matrix4d bb = Eigen::Matrix4d::Zero();
  for (Eigen::Index i = 0; i < rays.x_in_scan.cols(); ++i) {
    const Eigen::Vector3d p = (rays.x_in_scan.col(i) - form.middle_of_points) / form.size_of_points;
    const Eigen::Vector3d o = (rays.origins.col(i) - form.middle_of_origins) / form.size_of_origins;
    const Eigen::Vector3d d = rays.directions.col(i);
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - d * d.transpose();
    Eigen::Matrix<double, 3, 9> a;  // of vec(R), column by column
    a << p.x() * across, p.y() * across, p.z() * across;
    Eigen::Matrix<double, 3, 4> b;
    b << across, -across * o;
    aa += a.transpose() * a;
    ba += b.transpose() * a;
    bb += b.transpose() * b;
  }
  const SymmetricEigen of_origin(bb);
  if (!(of_origin.values[0] > kLeastCondition * of_origin.values[3])) {
    form.size_of_origins = 0;  // the rays meet in one place
    return form;
  }
  form.follow = -bb.inverse() * ba;
  form.form = aa + ba.transpose() * form.follow;
  return form;
}

Vector9d VectorOf(const Eigen::Matrix3d& matrix) {
  return Eigen::Map<const Vector9d>(matrix.data());
}

// The minimum that the descent from a rotation ends in (Levenberg-Marquardt on three unknowns).
Eigen::Quaterniond Descend(const Matrix9d& form, Eigen::Quaterniond rotation, double* cost) {
  double damping = 1e-3;
  Eigen::Matrix3d matrix = rotation.toRotationMatrix();
  *cost = VectorOf(matrix).dot(form * VectorOf(matrix));
  for (int step = 0; step < 60; ++step) {
    Eigen::Matrix<double, 9, 3> jacobian;  // d vec(exp(w) R) / dw
    for (int k = 0; k < 3; ++k) {
      jacobian.col(k) = VectorOf(CrossMatrix(Eigen::Vector3d::Unit(k)) * matrix);
    }
    const Eigen::Matrix<double, 9, 3> weighed = form * jacobian;
    const Eigen::Vector3d gradient = weighed.transpose() * VectorOf(matrix);
    Eigen::Matrix3d normal = jacobian.transpose() * weighed;
    normal.diagonal().array() += damping * (1e-12 + normal.trace());
    const Eigen::Vector3d turn = -SolveSymmetric(normal, gradient);
    if (!turn.allFinite()) break;
    const Eigen::Quaterniond next = (RotationFromVector(turn) * rotation).normalized();
    const Eigen::Matrix3d next_matrix = next.toRotationMatrix();
    const double next_cost = VectorOf(next_matrix).dot(form * VectorOf(next_matrix));
    if (next_cost > *cost) {
      damping *= 8;
      if (damping > 1e6) break;
      continue;
    }
    rotation = next;
    matrix = next_matrix;
    *cost = next_cost;
    damping = std::max(1e-9, damping / 4);
    if (turn.norm() < 1e-10) break;
  }
  return rotation;
}

// None if the scale is not positive, or too many of the points are behind their cameras.
bool SimilarityOf(const RaysToScan& rays, const Form& form, const Eigen::Quaterniond& rotation,
                  Similarity* scan_from_sparse) {
  const Eigen::Vector4d follow = form.follow * VectorOf(rotation.toRotationMatrix());
  // R p + t = s o + depth d in the form's units; s in metres per unit of the sparse model.
  const double scale = follow[3] * form.size_of_points / form.size_of_origins;
  if (!(scale > 0)) return false;
  const Eigen::Vector3d shift = form.size_of_points * follow.head<3>() +
                                scale * form.middle_of_origins - rotation * form.middle_of_points;
  int num_behind = 0;
  for (Eigen::Index i = 0; i < rays.x_in_scan.cols(); ++i) {
    const Eigen::Vector3d from_origin =
        rotation * rays.x_in_scan.col(i) + shift - scale * rays.origins.col(i);
    num_behind += !(rays.directions.col(i).dot(from_origin) > 0);
  }
  if (num_behind > kMaxBehind * static_cast<double>(rays.x_in_scan.cols())) return false;
  *scan_from_sparse = {scale, rotation.conjugate(), -(rotation.conjugate() * shift)};
  return true;
}

}  // namespace

std::vector<Similarity> SolveRaySimilarities(const RaysToScan& rays) {
  const Form form = MakeForm(rays);
  if (rays.x_in_scan.cols() < 4 || !form.IsUsable()) return {};
  struct Minimum {
    double cost;
    Eigen::Quaterniond rotation;
  };
  std::vector<Minimum> minima;
  for (int i = 0; i < kNumStarts; ++i) {
    Minimum minimum;
    minimum.rotation = Descend(form.form, StartRotation(i), &minimum.cost);
    const bool known = std::any_of(minima.begin(), minima.end(), [&](const Minimum& other) {
      return RotationAngle(other.rotation, minimum.rotation) < kSameRotation;
    });
    if (!known) minima.push_back(minimum);
  }
  std::stable_sort(minima.begin(), minima.end(),
                   [](const Minimum& a, const Minimum& b) { return a.cost < b.cost; });
  std::vector<Similarity> similarities;
  for (const Minimum& minimum : minima) {
    Similarity scan_from_sparse;
    if (SimilarityOf(rays, form, minimum.rotation, &scan_from_sparse)) {
      similarities.push_back(scan_from_sparse);
    }
  }
  return similarities;
}

}  // namespace roomtex
