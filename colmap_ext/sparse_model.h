#pragma once
// COLMAP's sparse model: cameras, images, points3D. Read as .bin or .txt, from COLMAP 3.7 to 4.x;
// written so that COLMAP's own programs read it.

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/camera_model.h"
#include "core/similarity.h"

namespace roomtex {

inline constexpr uint64_t kInvalidPoint3dId = UINT64_MAX;
inline constexpr uint32_t kNoFrame = UINT32_MAX;

struct SparseImage {
  uint32_t image_id = 0;
  uint32_t camera_id = 0;
  std::string name;  // relative to --image_path
  // model = the `sparse` frame, or the `scan` frame once the model is aligned.
  Rigid cam_from_model;
  std::vector<Eigen::Vector2d> points2d;  // `img`; all keypoints of the database, in row order
  std::vector<uint64_t> point3d_ids;      // one per point2d; kInvalidPoint3dId = none
  // Of a COLMAP 4 model: the frame of a rig that this image was taken in, together with others.
  // Images of one frame move as one: their poses against each other are those of the rig.
  uint32_t frame_id = kNoFrame;
};

struct TrackElement {
  uint32_t image_id = 0;
  uint32_t point2d_index = 0;
};

struct SparsePoint {
  Eigen::Vector3d x_in_model = Eigen::Vector3d::Zero();
  Eigen::Matrix<uint8_t, 3, 1> color = Eigen::Matrix<uint8_t, 3, 1>::Zero();  // r, g, b
  double error = -1;  // mean reprojection error, pixels; -1 = not computed
  std::vector<TrackElement> track;
};

// Ordered maps, so that every loop over them is reproducible.
struct SparseModel {
  std::map<uint32_t, Camera> cameras;
  std::map<uint32_t, SparseImage> images;
  std::map<uint64_t, SparsePoint> points;

  // By name; nullptr if not in the model.
  const SparseImage* FindImage(const std::string& name) const;
};

// Reads the model in a folder: cameras/images/points3D as .bin (preferred) or .txt, and of 4.x
// which images were taken together (frames.bin or .txt; the poses stand in images as well). Throws
// InputError: no model there, truncated or impossible counts (checked against the bytes left before
// anything is allocated), unknown camera model, image without camera, NaN pose, track elements and
// keypoints that do not answer each other, ids or names given twice ...
SparseModel ReadSparseModel(const std::string& folder);

inline constexpr const char* kSparseModelFiles[] = {"cameras.bin", "images.bin", "points3D.bin"};
// Writes kSparseModelFiles (each aside and renamed); makes the folder.
// rigs.bin and frames.bin of an older 4.x model in the same folder would contradict: refuses with
// an InputError when `folder` holds them.
void WriteSparseModel(const SparseModel& model, const std::string& folder);
// The same as cameras.txt, images.txt, points3D.txt, single spaces only (COLMAP 3.8 crashes on
// padding).
void WriteSparseModelText(const SparseModel& model, const std::string& folder);

// The model in another frame: points, and poses by CamFromScan (core/similarity.h).
void TransformModel(const Similarity& target_from_model, SparseModel* model);

// The model without these photos, and without points that fewer than two of the others see. All
// cameras stay.
SparseModel WithoutPhotos(const SparseModel& model, const std::set<uint32_t>& image_ids);

// Median distance of a photo's points from its centre, in units of the model; 0 if it has none.
double MedianDepth(const SparseModel& model, const SparseImage& image);

// Sets SparsePoint::error of every point and gives the mean and the root mean square over all
// observations, pixels. Observations behind a camera, or outside the valid field of its distortion,
// count as half the image diagonal. Points that nobody sees keep -1.
struct ReprojectionErrors {
  double mean_px = 0;
  double rms_px = 0;
  size_t num_observations = 0;
};
ReprojectionErrors UpdateReprojectionErrors(SparseModel* model);

}  // namespace roomtex
