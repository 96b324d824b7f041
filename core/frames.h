#pragma once
// Every frame, unit, pixel and quaternion convention of roomtex, on one page.
//
// UNITS. Metres, radians, pixels, seconds. What differs says so in its name: _deg, _mm, _px2.
//
// FRAMES. All are right-handed.
//
//   sparse   COLMAP's reconstruction. Origin, rotation and scale are arbitrary.
//   scan     The range scan, metres. RTPI: x right, y up, z backward (thesis 5.1.1). PTX: z up,
//            the pose that the file gives applied. With surveyed stations: `enu` about the first.
//   station  One set-up of the scanner. Its origin is the point that all ranges start from. One
//            set-up without a pose: the same as `scan`.
//   cam      A camera, as in COLMAP: x right, y down, z forward.
//   img      Pixels of a photo as taken: x right, y down. As in COLMAP the CENTRE of the
//            upper-left pixel is (0.5, 0.5), and the photo covers [0, width] x [0, height].
//   enu      Local east-north-up about a place on the Earth, metres.
//
// There is no `world`: other programs give that name to any of these.
//
// TRANSFORMS are called target_from_source, points x_in_frame; a wrong product looks wrong then:
//     x_in_cam = cam_from_scan * x_in_scan
// The pose that COLMAP stores with an image (qvec, tvec) is cam_from_sparse; in an aligned model
// it is cam_from_scan.
//
// QUATERNIONS. Files have them as w x y z, as COLMAP, and so does Eigen's constructor. Eigen's
// coeffs() are x y z w: convert by the functions below, never by hand.
//
// PIXELS OF OPENCV. There the centre of the upper-left pixel is (0, 0): convert by the functions
// below.

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace roomtex {

// The position that cv::remap, cv::Mat::at and the like want for a position in `img`, and back.
inline Eigen::Vector2d OpenCvFromImg(const Eigen::Vector2d& x_in_img) {
  return x_in_img - Eigen::Vector2d(0.5, 0.5);
}
inline Eigen::Vector2d ImgFromOpenCv(const Eigen::Vector2d& x_in_opencv) {
  return x_in_opencv + Eigen::Vector2d(0.5, 0.5);
}

// glTF texture coordinate (u right, v down, (0, 0) in the upper-left corner of the image, (1, 1) in
// the lower right one) of a position in an image of width x height pixels, counted as in `img`.
inline Eigen::Vector2d GltfUvFromImg(const Eigen::Vector2d& x_in_img, int width, int height) {
  return {x_in_img.x() / width, x_in_img.y() / height};
}

// w x y z, as in files.
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
