#pragma once
// Perspective pictures cut out of panoramas: for programs that know no panoramas (COLMAP 3.8), and
// for comparisons that want a picture plane.

#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>

#include "core/camera_model.h"

namespace roomtex {

class OptionFields;

struct FaceOptions {
  int around = 8;                 // faces along the horizon, evenly turned
  bool poles = false;             // also one straight up and one straight down
  double field_of_view_deg = 90;  // of a face, across; faces overlap where it is wider than a step
  int size = 0;  // pixels of a side; 0 = a pixel in the middle as fine as on the panorama's horizon

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// face_from_panorama of every face: along the horizon from left to right, the first one in the
// middle of the panorama; then up and down.
std::vector<Eigen::Quaterniond> FaceRotations(const FaceOptions& options);

// The camera of all faces of a panorama (SIMPLE_PINHOLE, principal point in the middle).
Camera FaceCamera(const Camera& panorama, const FaceOptions& options);

// 8-bit BGR, by Lanczos' kernel over 8 x 8 pixels; where the panorama is much finer than the face
// (towards its poles), by the mean of 2 x 2 of these. panorama: of any size; its borders continue
// each other.
cv::Mat CutFace(const cv::Mat& panorama, const Camera& face,
                const Eigen::Quaterniond& face_from_panorama);

}  // namespace roomtex
