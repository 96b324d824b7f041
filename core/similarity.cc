#include "core/similarity.h"

#include <cmath>
#include <fstream>
#include <optional>
#include <vector>

#include "core/error.h"
#include "core/frames.h"
#include "core/output_file.h"
#include "core/text.h"

namespace roomtex {
namespace {

using RowMajor4d = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

// InputError unless the matrix is [s R | t], the last row 0 0 0 1.
Similarity SimilarityFromMatrix(const std::string& path, const Eigen::Matrix4d& matrix) {
  const Eigen::Matrix3d scaled_rotation = matrix.topLeftCorner<3, 3>();
  Similarity similarity;
  similarity.scale = std::cbrt(scaled_rotation.determinant());
  const Eigen::Matrix3d rotation = scaled_rotation / similarity.scale;
  const double distortion =
      (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(similarity.scale > 0) || !(distortion < 1e-6) ||
      matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
    throw InputError(path, "", "holds a 4 x 4 matrix that is not a similarity",
                     "Expected scale times rotation, translation, and the last row 0 0 0 1");
  }
  similarity.rotation = Eigen::Quaterniond(rotation).normalized();
  similarity.translation = matrix.topRightCorner<3, 1>();
  return similarity;
}

}  // namespace

Rigid Rigid::operator*(const Rigid& other) const {
  return {(rotation * other.rotation).normalized(), rotation * other.translation + translation};
}

Rigid Rigid::Inverse() const {
  const Eigen::Quaterniond inverse = rotation.conjugate();
  return {inverse, inverse * -translation};
}

Eigen::Matrix<double, 3, 4> Rigid::Matrix() const {
  Eigen::Matrix<double, 3, 4> matrix;
  matrix << rotation.toRotationMatrix(), translation;
  return matrix;
}

Similarity Similarity::operator*(const Similarity& other) const {
  return {scale * other.scale, (rotation * other.rotation).normalized(), *this * other.translation};
}

Similarity Similarity::Inverse() const {
  const Eigen::Quaterniond inverse = rotation.conjugate();
  return {1.0 / scale, inverse, inverse * -translation / scale};
}

Eigen::Matrix4d Similarity::Matrix() const {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() = scale * rotation.toRotationMatrix();
  matrix.topRightCorner<3, 1>() = translation;
  return matrix;
}

Rigid CamFromScan(const Rigid& cam_from_sparse, const Similarity& scan_from_sparse) {
  const Eigen::Quaterniond rotation =
      (cam_from_sparse.rotation * scan_from_sparse.rotation.conjugate()).normalized();
  return {rotation, scan_from_sparse.scale * cam_from_sparse.translation -
                        rotation * scan_from_sparse.translation};
}

Similarity ScanFromSparse(const Rigid& cam_from_scan, const Rigid& cam_from_sparse, double scale) {
  // x_scan = R'^T (scale * (R x_sparse + t) - t'), thesis 7.1.3 with s = 1 / scale.
  const Eigen::Quaterniond scan_from_cam = cam_from_scan.rotation.conjugate();
  return {scale, (scan_from_cam * cam_from_sparse.rotation).normalized(),
          scan_from_cam * (scale * cam_from_sparse.translation - cam_from_scan.translation)};
}

Similarity FitSimilarity(const Eigen::Matrix3Xd& source, const Eigen::Matrix3Xd& target) {
  const Eigen::Matrix4d matrix = Eigen::umeyama(source, target, true);
  Similarity similarity;
  similarity.scale = std::cbrt(matrix.topLeftCorner<3, 3>().determinant());
  similarity.rotation =
      Eigen::Quaterniond(Eigen::Matrix3d(matrix.topLeftCorner<3, 3>() / similarity.scale))
          .normalized();
  similarity.translation = matrix.topRightCorner<3, 1>();
  return similarity;
}

double AngleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

double RotationAngle(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return a.angularDistance(b);
}

void WriteSimilarity(const std::string& path, const Similarity& target_from_source) {
  OutputFile file(path);
  const Eigen::Vector4d wxyz = WxyzFromQuaternion(target_from_source.rotation);
  file.stream() << Exact(target_from_source.scale);
  for (const double q : wxyz) file.stream() << ' ' << Exact(q);
  for (const double t : target_from_source.translation) file.stream() << ' ' << Exact(t);
  file.stream() << '\n';
  file.Commit();
}

void WriteSimilarityMatrix(const std::string& path, const Similarity& target_from_source) {
  OutputFile file(path);
  const Eigen::Matrix4d matrix = target_from_source.Matrix();
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      file.stream() << Exact(matrix(row, column)) << (column < 3 ? ' ' : '\n');
    }
  }
  file.Commit();
}

Similarity ReadSimilarity(const std::string& path) {
  constexpr char kExpected[] = "Expected one line: scale qw qx qy qz tx ty tz";
  RequireFile(path, kExpected);
  std::ifstream stream(path);
  std::vector<double> v;
  for (std::string word; v.size() <= 16 && stream >> word;) {
    const std::optional<double> number = ParseNumber(word);
    if (!number) {
      throw InputError(path, "value " + std::to_string(v.size() + 1),
                       Quoted(word) + " is not a finite number", kExpected);
    }
    v.push_back(*number);
  }
  if (v.size() == 16) return SimilarityFromMatrix(path, Eigen::Map<const RowMajor4d>(v.data()));
  if (v.size() != 8) {
    throw InputError(path, "", "does not hold the eight numbers of a similarity", kExpected);
  }
  const Eigen::Quaterniond rotation = QuaternionFromWxyz({v[1], v[2], v[3], v[4]});
  if (!(v[0] > 0) || !(rotation.norm() > 1e-6)) {
    throw InputError(path, "line 1", "scale or quaternion is zero or negative", kExpected);
  }
  return {v[0], rotation.normalized(), {v[5], v[6], v[7]}};
}

}  // namespace roomtex
