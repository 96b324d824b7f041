#pragma once
// Decompositions of Eigen, compiled here once: each costs every file that uses one two to ten
// seconds of the compiler.

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace roomtex {

// The shortest rotation that turns direction `from` into direction `to`, neither of length 0; one
// of the half turns that do so where they are opposite.
Eigen::Quaterniond RotationBetween(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

// Of a symmetric matrix: eigenvalues in ascending order, and unit eigenvectors as columns. (3 x 3
// ones are cheap to compile in place, and quicker so.)
struct SymmetricEigen {
  explicit SymmetricEigen(const Eigen::MatrixXd& symmetric);

  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};

// The right singular vectors of a, n x n for its n columns, as columns by descending singular
// value; those of value 0 last, also where a has fewer rows than columns.
Eigen::MatrixXd RightSingularVectors(const Eigen::MatrixXd& a);

// The x of A x = b for a symmetric A that is positive or negative semidefinite, by the pivoted
// decomposition L D L^T.
Eigen::Vector3d SolveSymmetric(const Eigen::Matrix3d& A, const Eigen::Vector3d& b);
Eigen::Matrix<double, 6, 1> SolveSymmetric(const Eigen::Matrix<double, 6, 6>& A,
                                           const Eigen::Matrix<double, 6, 1>& b);
Eigen::VectorXd SolveSymmetric(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);

}  // namespace roomtex
