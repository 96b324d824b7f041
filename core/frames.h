#pragma once
// Every frame, unit, pixel and quaternion convention of roomtex, on one page.
//
// Units     metres, radians, pixels, seconds. A name says anything else: `_deg`, `_mm`, `_px2`.
//
// Frames    `sparse`   COLMAP's reconstruction: right-handed, arbitrary origin, rotation and scale.
//           `scan`     the range scan: right-handed, metres. RTPI: x right, y up, z backward
//                      (thesis 5.1.1); PTX: z up, the file's own pose already applied. With
//                      surveyed stations: the `enu` frame about the first of them.
//           `station`  one scanner set-up, its origin in the scanner; the scan frame if there is
//           one only. `cam`      x right, y down, z forward, as COLMAP. `img`      pixels of the
//           photo as taken, x right, y down. The CENTRE of the upper-left pixel
//                      is (0.5, 0.5), as COLMAP; the image covers [0, width] x [0, height].
//           `enu`      local east-north-up, metres.
//           There is no `world`: every file that says "world" means one of these.
//
// Transforms read `target_from_source`, points `x_in_frame`:  x_in_cam = cam_from_scan * x_in_scan.
// COLMAP's image pose (qvec, tvec) is `cam_from_sparse`, and `cam_from_scan` in an aligned model.
//
// Quaternions in files are w x y z (COLMAP); Eigen's constructor takes w x y z too, but Eigen's
// coeffs() are x y z w: only the functions below touch the difference.
//
// Images of OpenCV count the centre of the upper-left pixel as (0, 0): the functions below convert.

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace roomtex {

// Position for cv::remap, cv::Mat::at and friends, of a position in `img`.
inline Eigen::Vector2d OpenCvFromImg(const Eigen::Vector2d& x_in_img) {
  return x_in_img - Eigen::Vector2d(0.5, 0.5);
}
inline Eigen::Vector2d ImgFromOpenCv(const Eigen::Vector2d& x_in_opencv) {
  return x_in_opencv + Eigen::Vector2d(0.5, 0.5);
}

// glTF texture coordinate (origin at the upper-left corner of the image, v down) of a position in
// an image of width x height pixels that follows the `img` convention.
inline Eigen::Vector2d GltfUvFromImg(const Eigen::Vector2d& x_in_img, int width, int height) {
  return {x_in_img.x() / width, x_in_img.y() / height};
}

inline Eigen::Quaterniond QuaternionFromWxyz(const Eigen::Vector4d& wxyz) {
  return {wxyz[0], wxyz[1], wxyz[2], wxyz[3]};
}
inline Eigen::Vector4d WxyzFromQuaternion(const Eigen::Quaterniond& q) {
  return {q.w(), q.x(), q.y(), q.z()};
}

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double RadFromDeg(double deg) { return deg * kPi / 180.0; }
inline constexpr double DegFromRad(double rad) { return rad * 180.0 / kPi; }

}  // namespace roomtex
