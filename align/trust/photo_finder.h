#pragma once
// Where one photo was taken, without a sparse model and without a click: its features against those
// of views of the scan (photo_search.h), then a closer look at every place that comes of it,
// against a view of the scan from there. Of the right place this finds many more features that
// agree, of a wrong one hardly any. Frames: `scan`, `cam`, `img`.

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "align/clicks/lens_pose.h"
#include "align/trust/appearance_features.h"
#include "align/trust/photo_search.h"
#include "align/trust/scan_view.h"
#include "colmap_ext/sparse_model.h"

namespace roomtex {

struct PhotoFinderOptions {
  int max_photo_features = 2000;
  int max_scan_features = 9000;  // of all views together
  int max_stations = 8;          // views are made from, evenly taken
  double max_ratio = 0.8;        // Lowe's; larger = more matches, more of them wrong
  double max_ratio_near = 0.85;  // of the closer look
  // Cells of the scan in which the views agree with a photo at its best place: with fewer it is not
  // looked at closely. Larger = faster, and fewer photos are placed.
  int min_cells_of_views = 0;
  PhotoSearchOptions search;
};

struct SeenPlace {
  // Best pose of the features that agree, and their lens where it was not known.
  ViewPose pose;
  PointPairs pairs;  // those features, one of each cell of the scan
  int num_cells = 0;
  double share = 0;  // of the cells in which anything was matched
};

struct PhotoSighting {
  bool is_read = false;           // the photo could be read and described
  std::vector<SeenPlace> places;  // clearly different ones, the best first
};

class PhotoFinder {
 public:
  // up_in_scan: unit length. The viewer must outlive it. The same for every number of threads.
  PhotoFinder(const ScanViewer& viewer, const Eigen::Vector3d& up_in_scan,
              const PhotoFinderOptions& options, int num_threads);

  // camera: as MakePhotoModel() has it, not a panorama. Its pose is not looked at.
  PhotoSighting Find(const SparseImage& image, const Camera& camera, FocalSource source,
                     const std::string& image_path) const;

 private:
  struct Picture {
    cv::Mat1b grey;
    std::vector<cv::KeyPoint> keypoints;
  };

  std::vector<PhotoMatch> MatchPicture(const Picture& picture, const Camera& camera) const;
  // One for each place; of those that lead to no pose num_cells is 0.
  std::vector<SeenPlace> LookCloser(const Picture& picture, const Camera& camera,
                                    FocalSource source,
                                    const std::vector<PhotoPlace>& places) const;

  const ScanViewer& viewer_;
  const Eigen::Vector3d up_in_scan_;
  const PhotoFinderOptions options_;
  const int num_threads_;
  // Of the scan: turned as their own gradients say, and by gravity.
  std::vector<AppearanceFeatures> features_;
};

}  // namespace roomtex
