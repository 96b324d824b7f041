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

// A photo in cells of a view, and the view: what the scan shows of the same cells.
struct PhotoAndView {
  cv::Mat cells;  // 8-bit BGR, as if all rows had been read with the middle one
  ScanView view;  // without what the photo does not show
};

// Whether a view shows what is `depth` deep, metres, where it is view_depth deep itself (0 = it
// shows nothing): to 2 cm and 2 %.
bool IsAsDeep(float view_depth, double depth);

// Natural logarithm of the linear light of 8-bit BGR, mean of the channels, 0..1; NaN where one of
// them is clipped or only noise.
float LogLight(const cv::Vec3b& bytes);

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
  // That, and what the scan shows there; camera: the image's.
  std::optional<PhotoAndView> Look(const ScanViewer& viewer, const SparseImage& image,
                                   const LookSetup& camera, std::string* warning) const;
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
