#pragma once
// What photos and views of the scan's intensity have in common: SIFT (Lowe 2004) in both, locally
// normalised, compared once as they are and once with opposite gradients counted as one, since
// intensity and brightness differ in sign. Frames: `scan`, `img`.

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "align/trust/descriptors.h"
#include "align/trust/scan_view.h"
#include "colmap_ext/sparse_model.h"

namespace roomtex {

// Features of several pictures: a row of `sift` each.
struct AppearanceFeatures {
  std::vector<Eigen::Vector3d> places;  // what they are features of: `scan`, or as a photo says
  std::vector<Eigen::Vector2d> in_img;  // of a photo: in the photo as it is
  std::vector<uint32_t> image_ids;      // of a photo, after JoinFeatures()
  std::vector<float> responses;
  Descriptors sift;
};

// Where a keypoint is and, if known, which way is down there, in its picture.
struct FeaturePlace {
  Eigen::Vector3d x;
  std::optional<Eigen::Vector2d> down;
  Eigen::Vector2d in_img;
};
// By a keypoint's position in its picture; none to leave it out.
using PlaceOfKeypoint = std::function<std::optional<FeaturePlace>(const Eigen::Vector2d&)>;

// The strongest first; several of one place have different directions. Empty valid: everywhere.
std::vector<cv::KeyPoint> FindKeypoints(const cv::Mat1b& picture, const cv::Mat1b& valid);
struct KeypointUse {
  bool upright;  // place_of says which way is down; else they are turned as their gradients say
  PlaceOfKeypoint place_of;
};
// For each use the `most` strongest of FindKeypoints() that have a place. What is slow, the
// pyramid of the picture, is made once for all uses.
std::vector<AppearanceFeatures> DescribeFeatures(const cv::Mat1b& picture,
                                                 const std::vector<cv::KeyPoint>& keypoints,
                                                 const std::vector<KeypointUse>& uses, int most);
// The `most` strongest of all. part_ids: of the photos, or none.
AppearanceFeatures JoinFeatures(std::vector<AppearanceFeatures> parts,
                                const std::vector<uint32_t>& part_ids, size_t most);

// Features of sixteen views of the scan from each of up to max_stations stations, evenly taken;
// once for each entry of `upright` (as in DescribeFeatures). up_in_scan: unit length. Scans without
// a grid have no station to look from, and no features. The same for every number of threads.
std::vector<AppearanceFeatures> FeaturesOfScan(const ScanViewer& viewer,
                                               const Eigen::Vector3d& up_in_scan,
                                               const std::vector<bool>& upright, int max_stations,
                                               int most, int num_threads);

// Upright features of one view. in_img: in the view.
AppearanceFeatures FeaturesOfView(const ScanViewer& viewer, const Camera& camera,
                                  const Rigid& cam_from_scan, const Eigen::Vector3d& up_in_scan,
                                  int most);

// How a direction goes in the picture at a place (x/z, y/z) of it; none where the lens has no ray.
std::optional<Eigen::Vector2d> DirectionInImg(const CameraProjection& projection,
                                              const Eigen::Vector2d& plane,
                                              const Eigen::Vector3d& direction_in_cam);

// A photo as it is described, locally normalised, a pixel of the views or larger; empty if it
// cannot be read, or is too small.
cv::Mat1b ReadPictureOf(const SparseImage& image, const Camera& camera,
                        const std::string& image_path, const ScanViewer& viewer);

// Pairs (feature of a photo, feature of the scan) whose distance is at most max_ratio times that to
// the most similar feature of the scan elsewhere (Lowe 2004).
std::vector<std::pair<int, int>> MatchFeatures(const AppearanceFeatures& photos,
                                               const AppearanceFeatures& scan, double max_ratio);

// The same for a photo and a view of about the same pose: only features are compared that lie
// within `reach` pixels of each other (in_img of both, in pixels of the view).
std::vector<std::pair<int, int>> MatchNear(const AppearanceFeatures& photo,
                                           const AppearanceFeatures& view, double reach,
                                           double max_ratio);

}  // namespace roomtex
