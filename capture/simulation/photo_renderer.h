#pragma once
// Photos of the simulated room. Frames: `room`, `cam`, `img`.

#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "capture/simulation/rolling_shutter.h"
#include "capture/simulation/room_scene.h"
#include "core/camera_model.h"

namespace roomtex {

class ProjectedLight;

struct PhotoSettings {
  double exposure_ev = 0;
  double gloss = 0;    // see SimulatedRoomOptions
  double blur_px = 0;  // Gaussian sigma
  // How the camera's own motion moves what it shows while it is exposed, pixels.
  Eigen::Vector2d motion_px = Eigen::Vector2d::Zero();
  double noise = 0;         // grey levels of 255, standard deviation
  uint64_t noise_seed = 0;  // one per photo
  // See camera_faults.h.
  std::string response = "srgb";
  double vignetting = 0;
  Eigen::Vector3f white_balance = Eigen::Vector3f::Ones();  // factors on red, green, blue
  const ProjectedLight* projected = nullptr;                // falls on top of the room's light
};

class PhotoRenderer {
 public:
  // Both must outlive the renderer.
  PhotoRenderer(const RoomScene& scene, const CameraProjection& camera);

  // 8-bit BGR. Rows side by side; the same for every number of threads.
  cv::Mat Render(const RowPoses& poses, const PhotoSettings& settings, int num_threads) const;

 private:
  struct Shot {
    LinearRgb color = LinearRgb::Zero();
    int place = -1;  // tells surfaces apart
  };
  Eigen::Vector3d RayAt(double x_in_img, double y_in_img) const;
  using Pose = Eigen::Matrix<double, 3, 4>;
  Shot Shoot(const Pose& room_from_cam, double x_in_img, double y_in_img, double pixel_size,
             const PhotoSettings& settings) const;
  // Light that a varnished surface throws back at a hit to who looks along `direction` (unit).
  LinearRgb Reflection(const SceneHit& hit, const Eigen::Vector3d& direction) const;
  void Develop(const cv::Mat& linear, const PhotoSettings& settings, int num_threads,
               cv::Mat* photo) const;

  const RoomScene& scene_;
  int width_, height_;
  Eigen::Vector2d principal_point_;
  // RayFromImg() through a lattice of kStep pixels, linear between. Off by at most 0.001 px in
  // photos of 1200 pixels by an ordinary lens of 65 degrees, by 0.01 px in small photos and those
  // of wide lenses, but for the last pixels that a distorted fisheye reaches.
  static constexpr int kStep = 4;
  int lattice_columns_;
  std::vector<Eigen::Vector3d> lattice_;
};

}  // namespace roomtex
