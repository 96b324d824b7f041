#pragma once
// The photos of a model as pictures with a picture plane: panoramas as four faces each.

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>

#include "colmap_ext/sparse_model.h"

namespace roomtex {

class PerspectiveViews {
 public:
  // Must not outlive the model.
  explicit PerspectiveViews(const SparseModel& model);

  // Cameras and images, without keypoints and points. A face is called NAME_face1.EXT and so on.
  const SparseModel& model() const { return views_ ? *views_ : model_; }

  // The picture of an image of model() as 8-bit BGR; none, and a warning, if it cannot be read or
  // has another size than its camera.
  std::optional<cv::Mat> Read(const SparseImage& image, const std::string& image_path,
                              std::string* warning) const;
  // The same in cells, see ReadCellsOf().
  std::optional<cv::Mat> ReadCells(const SparseImage& image, int cell_px,
                                   const std::string& image_path, std::string* warning) const;

 private:
  struct Face {
    const SparseImage* panorama;
    Eigen::Quaterniond face_from_panorama;
  };
  const SparseModel& model_;
  std::optional<SparseModel> views_;  // if there are panoramas
  std::map<uint32_t, Face> faces_;    // by image_id of views_
};

}  // namespace roomtex
