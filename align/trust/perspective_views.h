#pragma once
// The photos of a model as pictures with a picture plane: panoramas as four faces each.

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>

#include "align/trust/scan_view.h"
#include "colmap_ext/sparse_model.h"
#include "core/row_motion.h"

namespace roomtex {

// The photos of a model in the scan frame.
struct AlignedPhotos {
  const SparseModel& model;
  std::string image_path;  // their folder
  RowMotions row_motions = {};
};

class PerspectiveViews {
 public:
  // Must not outlive the photos.
  explicit PerspectiveViews(const AlignedPhotos& photos);

  // Cameras and images, without keypoints and points. A face is called NAME_face1.EXT and so on.
  const SparseModel& model() const { return views_ ? *views_ : photos_.model; }

  // The picture of an image of model() as 8-bit BGR; none, and a warning, if it cannot be read or
  // has another size than its camera.
  std::optional<cv::Mat> Read(const SparseImage& image, std::string* warning) const;
  // The same in cells, see ReadCellsOf().
  std::optional<cv::Mat> ReadCells(const SparseImage& image, int cell_px,
                                   std::string* warning) const;
  // Takes out of the view of an image what its photo does not show, being transparent there.
  void LeaveOutTransparent(const SparseImage& image, ScanView* view) const;
  // Either of them had its rows been read with the middle one; view: the image's, of that camera.
  cv::Mat Still(const SparseImage& image, const ScanView& view, const LookSetup& camera,
                const cv::Mat& picture) const;

 private:
  struct Face {
    const SparseImage* panorama;
    Eigen::Quaterniond face_from_panorama;
  };
  const AlignedPhotos& photos_;
  std::optional<SparseModel> views_;  // if there are panoramas
  std::map<uint32_t, Face> faces_;    // by image_id of views_
};

}  // namespace roomtex
