#pragma once
// Places of the scan that look like what photos show at sparse points: evidence of where the model
// lies that geometry has no part in. SIFT (Lowe 2004) in photos and in views of the scan's
// intensity, locally normalised, upright by gravity instead of by their gradients; compared once as
// they are and once with opposite gradients counted as one, since intensity and brightness differ
// in sign. Frames: `sparse`, `scan`.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "align/trust/scan_view.h"
#include "colmap_ext/sparse_model.h"

namespace roomtex {

struct AppearanceMatch {
  Eigen::Vector3d x_in_sparse, x_in_scan;
  uint32_t image_id = 0;  // the photo that shows it, and where
  Eigen::Vector2d x_in_img = Eigen::Vector2d::Zero();
};

struct AppearanceOptions {
  int max_photos = 24;            // asked, evenly taken
  int max_photo_features = 6000;  // of all photos together
  int max_scan_features = 9000;   // of all views together
  int max_stations = 8;           // views are made from, evenly taken
  // A match counts if its distance is at most this share of that to the most similar feature of the
  // scan elsewhere (Lowe 2004). Larger = more matches, more of them wrong, and more of those that
  // another room with the same furniture has, too.
  double max_ratio = 0.8;
};

class AppearanceMatcher {
 public:
  // Reads the photos, and keeps them small; those that cannot be read are passed over. Model and
  // viewer must outlive it.
  AppearanceMatcher(const SparseModel& model, const std::string& image_path,
                    const ScanViewer& viewer, const AppearanceOptions& options, int num_threads);

  // up_in_sparse, up_in_scan: unit vectors; without the first, which photos held any way may leave
  // unknown, features are turned as their own gradients say. Scans without a grid have no station
  // to look from, and count for nothing. The same for every number of threads.
  std::vector<AppearanceMatch> Match(const std::optional<Eigen::Vector3d>& up_in_sparse,
                                     const Eigen::Vector3d& up_in_scan) const;

 private:
  const SparseModel& model_;
  const ScanViewer& viewer_;
  const AppearanceOptions options_;
  const int num_threads_;
  std::vector<const SparseImage*> images_;
  std::vector<cv::Mat1b> photos_;  // locally normalised, a pixel of the views or larger
};

}  // namespace roomtex
