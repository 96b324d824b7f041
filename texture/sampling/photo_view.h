#pragma once
// One photo on the scan: where its file is, where it was taken, and fast projection into it.

#include <array>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/camera_model.h"
#include "core/photo.h"
#include "core/similarity.h"
#include "texture/sampling/photo_mask.h"
#include "texture/sampling/photo_tone.h"
#include "texture/sampling/photo_warp.h"

namespace roomtex {

struct PhotoView {
  std::string name;  // as in the model
  std::string path;  // the file that gives the colour
  // Which way up; the file is used as stored but for a reason, see FitPhotoToCamera().
  PhotoPixels pixels = PhotoPixels::kAsStored;
  Camera camera;  // of the size of that picture
  Rigid cam_from_scan;
  std::shared_ptr<const PhotoTone> tone;  // how its bytes become light; none = sRGB
  float weight = 1;  // share of its weight in the blend that it keeps, e.g. a blurred one
  std::shared_ptr<const PhotoWarp> warp;  // what camera and pose do not say; none = nothing

  std::shared_ptr<const PhotoMask> moving;       // parts that count for nothing; none = nothing
  std::shared_ptr<const PhotoMask> transparent;  // parts that show nothing at all

  Eigen::Vector3d Centre() const { return cam_from_scan.TargetOriginInSource(); }
};

// Points as three rows of floats, relative to a near `origin` in the `scan` frame: fast, and exact
// to micrometres wherever the scan lies.
struct PointBlock {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  std::vector<float> x, y, z;
  float radius = 0;  // of a sphere around the origin that holds all points

  int size() const { return static_cast<int>(x.size()); }
  void Add(const Eigen::Vector3d& point);
};

// Positions in `img` and depths, metres: along the optical axis, or the distance for cameras that
// see more than what lies in front (Camera::IsPerspective). Depth 0 = the camera model gives no
// position (behind the camera, or where the distortion folds).
struct ProjectedBlock {
  std::vector<float> x, y, depth;
  void Resize(int n);
};

class PhotoProjector {
 public:
  explicit PhotoProjector(const PhotoView& view);

  void Project(const PointBlock& block, ProjectedBlock* projected) const;
  // False only if no point of the sphere can lie in the image.
  bool MaySee(const Eigen::Vector3d& centre, double radius) const {
    return MaySeeInCam(cam_from_scan_ * centre, radius);
  }
  bool MaySeeInCam(const Eigen::Vector3d& centre_in_cam, double radius) const;
  // The camera's centre relative to an origin in the scan frame.
  Eigen::Vector3f CentreFrom(const Eigen::Vector3d& origin) const {
    return (centre_ - origin).cast<float>();
  }
  int width() const { return camera_.camera().width; }
  int height() const { return camera_.camera().height; }
  const CameraProjection& camera() const { return camera_; }
  const Rigid& cam_from_scan() const { return cam_from_scan_; }
  const Eigen::Vector3d& centre() const { return centre_; }

 private:
  void FindFrustum();

  CameraProjection camera_;
  Rigid cam_from_scan_;
  Eigen::Matrix3f rotation_;
  Eigen::Vector3d centre_;
  std::vector<float> params_;
  // Inward unit normals in `cam` of the planes through the camera's centre that bound its view;
  // none if it sees behind itself.
  std::vector<Eigen::Vector3d> frustum_;
};

}  // namespace roomtex
