#pragma once
// Rigid motions and similarities between frames (names: frames.h).

#include <string>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace roomtex {

// x_in_target = rotation * x_in_source + translation. The pose of an image in COLMAP is such a
// Rigid: cam_from_sparse.
struct Rigid {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // unit length
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& x_in_source) const {
    return rotation * x_in_source + translation;
  }
  // (c_from_b * b_from_a) = c_from_a
  Rigid operator*(const Rigid& other) const;
  Rigid Inverse() const;
  // 3 x 4 matrix [R|t].
  Eigen::Matrix<double, 3, 4> Matrix() const;
  // The origin of the target frame, in the source frame; of a pose cam_from_scan: the camera's
  // centre.
  Eigen::Vector3d TargetOriginInSource() const { return rotation.conjugate() * -translation; }
};

// x_in_target = scale * (rotation * x_in_source) + translation, scale > 0.
struct Similarity {
  double scale = 1.0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // unit length
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& x_in_source) const {
    return scale * (rotation * x_in_source) + translation;
  }
  Similarity operator*(const Similarity& other) const;
  Similarity Inverse() const;
  Eigen::Matrix4d Matrix() const;
};

// Pose of a camera after its sparse model was moved by scan_from_sparse (thesis 7.1.3): the camera
// sees the same directions, its frame is measured in metres.
Rigid CamFromScan(const Rigid& cam_from_sparse, const Similarity& scan_from_sparse);

// The similarity that takes the camera pose cam_from_sparse to cam_from_scan, for a given scale
// (scan metres per sparse unit).
Similarity ScanFromSparse(const Rigid& cam_from_scan, const Rigid& cam_from_sparse, double scale);

// Least-squares similarity with target_i ~ S * source_i (Umeyama 1991). Columns are points; at
// least three, not collinear.
Similarity FitSimilarity(const Eigen::Matrix3Xd& source, const Eigen::Matrix3Xd& target);

// Angle between two directions of any length, radians in [0, pi]; exact for small ones, too.
double AngleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b);
// Angle of the rotation between two, radians in [0, pi].
double RotationAngle(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b);

// One line "scale qw qx qy qz tx ty tz": what `colmap model_transformer --transform_path` reads
// from COLMAP 3.9 on.
void WriteSimilarity(const std::string& path, const Similarity& target_from_source);
// Four lines, the 4 x 4 matrix: what COLMAP up to 3.8 reads there. (Given the other file it does
// not complain, but moves the model to a wrong place.)
void WriteSimilarityMatrix(const std::string& path, const Similarity& target_from_source);
// Either of the two. Throws InputError.
Similarity ReadSimilarity(const std::string& path);

}  // namespace roomtex
