#include "align/trust/photo_finder.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "core/camera_model.h"
#include "core/frames.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// EXIF is good to some percent; where nobody says, every seventh part more.
const std::vector<double> kExifScales = {0.96, 1, 1.04};
const std::vector<double> kUnknownScales = {0.5, 0.58, 0.67, 0.77, 0.88, 1, 1.15, 1.32, 1.52};

// Looks at one place: how far a feature may be from where the view has it, degrees, and how far
// from the pose that comes of them all. With fewer cells than `fewest` there is no further one: of
// the kitchen's and the desk's photos no place that came to 25 had fewer than 9 and then 17.
struct CloserLook {
  double reach, tolerance;
  int fewest;
};
constexpr CloserLook kLooks[] = {{5, 0.6, 8}, {3, 0.6, 15}, {3, 0.4, 0}, {3, 0.4, 0}};
// Of the places that come of the views so many at least, and those with so many of the cells of the
// best one.
constexpr size_t kFewestLooks = 2;
constexpr double kRivalShare = 0.5;
constexpr int kCloserSamples = 3200;
constexpr int kMostFeatures = 2500;  // of a photo and of a view that are compared closely
constexpr int kFewestMatches = 8;    // that are worth another look
constexpr double kMostMedians = 3;   // times the median residual: what misses by more is left out
constexpr double kHiddenBy = 0.05;   // metres, as TrustOptions::surface_tolerance

std::vector<double> FocalScales(FocalSource source) {
  if (source == FocalSource::kGiven) return {1};
  return source == FocalSource::kExif ? kExifScales : kUnknownScales;
}

PointPairs PairsOf(const std::vector<PhotoMatch>& matches, const std::vector<int>& which) {
  PointPairs pairs;
  pairs.x_in_img.resize(2, static_cast<Eigen::Index>(which.size()));
  pairs.x_in_scan.resize(3, static_cast<Eigen::Index>(which.size()));
  for (size_t k = 0; k < which.size(); ++k) {
    pairs.x_in_img.col(static_cast<Eigen::Index>(k)) = matches[which[k]].x_in_img;
    pairs.x_in_scan.col(static_cast<Eigen::Index>(k)) = matches[which[k]].x_in_scan;
  }
  return pairs;
}

PointPairs Near(const PointPairs& pairs, const Eigen::VectorXd& residual_px, double most) {
  PointPairs near = pairs;
  Eigen::Index num = 0;
  for (Eigen::Index i = 0; i < residual_px.size(); ++i) {
    if (!(residual_px[i] <= most)) continue;
    near.x_in_img.col(num) = pairs.x_in_img.col(i);
    near.x_in_scan.col(num++) = pairs.x_in_scan.col(i);
  }
  near.x_in_img.conservativeResize(2, num);
  near.x_in_scan.conservativeResize(3, num);
  return near;
}

// The pose, and the lens where it is not known and the pairs tell it; without those that miss by
// much more than the others. None if they leave no pose.
std::optional<ViewPose> SolveWithout(const Camera& camera, FocalSource source,
                                     const Rigid& cam_from_scan, PointPairs* pairs) {
  const CameraProjection projection(camera);
  std::unique_ptr<PoseSolver> solver;
  const bool finds_lens = source == FocalSource::kExif ||
                          (source == FocalSource::kPicks && FindFocalProblem(*pairs).empty());
  if (finds_lens) {
    solver = std::make_unique<LensPoseSolver>(camera, source);
  } else {
    solver = std::make_unique<ViewPoseSolver>(projection);
  }
  ViewPose pose;
  pose.cam_from_scan = cam_from_scan;
  if (finds_lens) pose.lens = camera;
  for (int round = 0; round < 3; ++round) {
    if (pairs->size() < kFewestMatches) return std::nullopt;
    const std::vector<ViewPose> poses = solver->Solve(*pairs, pose);
    if (poses.empty()) return std::nullopt;
    pose = poses[0];
    const double most = kMostMedians * Median(std::vector<double>(pose.residual_px.begin(),
                                                                  pose.residual_px.end()));
    if (pose.residual_px.maxCoeff() <= most || round == 2) break;
    *pairs = Near(*pairs, pose.residual_px, most);
  }
  return pose;
}

}  // namespace

PhotoFinder::PhotoFinder(const ScanViewer& viewer, const Eigen::Vector3d& up_in_scan,
                         const PhotoFinderOptions& options, int num_threads)
    : viewer_(viewer),
      up_in_scan_(up_in_scan),
      options_(options),
      num_threads_(num_threads),
      features_(FeaturesOfScan(viewer, up_in_scan, {false, true}, options.max_stations,
                               options.max_scan_features, num_threads)) {}

std::vector<PhotoMatch> PhotoFinder::MatchPicture(const Picture& picture,
                                                  const Camera& camera) const {
  const Eigen::Vector2d size(camera.width, camera.height),
      small(picture.grey.cols, picture.grey.rows);
  std::vector<PhotoMatch> matches;
  // As their own gradients are turned, and upright: photos are mostly held level.
  for (const bool upright : {false, true}) {
    const AppearanceFeatures& scan = features_[upright];
    const AppearanceFeatures photo =
        DescribeFeatures(picture.grey, picture.keypoints, upright, options_.max_photo_features,
                         [&](const Eigen::Vector2d& at) {
                           return FeaturePlace{Eigen::Vector3d::Zero(), Eigen::Vector2d(0, 1),
                                               at.cwiseProduct(size.cwiseQuotient(small))};
                         });
    for (const auto& [i, k] : MatchFeatures(photo, scan, options_.max_ratio)) {
      matches.push_back({photo.in_img[i], scan.places[k]});
    }
  }
  return matches;
}

SeenPlace PhotoFinder::LookCloser(const Picture& picture, const Camera& camera, FocalSource source,
                                  const PhotoPlace& place) const {
  SeenPlace seen;
  Camera lens = WithFocalScale(camera, place.focal_scale);
  seen.pose.cam_from_scan = place.cam_from_scan;
  PhotoSearchOptions search = options_.search;
  search.num_samples = kCloserSamples;
  search.focal_scales = {1};
  search.num_kept = 1;
  const Eigen::Vector2d grow =
      Eigen::Vector2d(camera.width, camera.height)
          .cwiseQuotient(Eigen::Vector2d(picture.grey.cols, picture.grey.rows));
  for (const CloserLook& look : kLooks) {
    Camera small = lens;
    small.Resize(picture.grey.cols, picture.grey.rows);
    const CameraProjection projection(small);
    const Rigid now = seen.pose.cam_from_scan;
    const Eigen::Vector3d down = now.rotation * -up_in_scan_;
    const AppearanceFeatures view = FeaturesOfView(viewer_, small, now, up_in_scan_, kMostFeatures);
    const AppearanceFeatures photo =
        DescribeFeatures(picture.grey, picture.keypoints, true, kMostFeatures,
                         [&](const Eigen::Vector2d& at) -> std::optional<FeaturePlace> {
                           const auto plane = projection.CamFromImg(at);
                           if (!plane) return std::nullopt;
                           FeaturePlace one = {Eigen::Vector3d::Zero(),
                                               DirectionInImg(projection, *plane, down), at};
                           if (!one.down) return std::nullopt;
                           return one;
                         });
    const double reach = look.reach * RadFromDeg(1.0) * small.MeanFocalLength();
    std::vector<PhotoMatch> matches;
    for (const auto& [i, k] : MatchNear(photo, view, reach, options_.max_ratio_near)) {
      matches.push_back({photo.in_img[i].cwiseProduct(grow), view.places[k]});
    }
    search.tolerance_deg = look.tolerance;
    const std::vector<PhotoPlace> found = SearchPhotoPlaces(matches, lens, search, num_threads_);
    if (found.empty()) return {};
    seen.num_cells = found[0].num_cells;
    seen.share = static_cast<double>(found[0].agreeing.size()) /
                 std::max(1, CountCells(matches, search.cell));
    seen.pairs = PairsOf(matches, found[0].agreeing);
    const auto solved = SolveWithout(lens, source, found[0].cam_from_scan, &seen.pairs);
    if (!solved) return {};
    seen.pose = *solved;
    if (solved->lens) lens = *solved->lens;
    if (seen.num_cells < look.fewest) break;
  }
  if (!seen.pose.lens && source != FocalSource::kGiven) seen.pose.lens = lens;
  return seen;
}

PhotoSighting PhotoFinder::Find(const SparseImage& image, const Camera& camera, FocalSource source,
                                const std::string& image_path) const {
  PhotoSighting sighting;
  PhotoSearchOptions search = options_.search;
  search.focal_scales = FocalScales(source);
  // Of the shortest focal length: as fine as the views.
  Picture picture;
  picture.grey =
      ReadPictureOf(image, WithFocalScale(camera, search.focal_scales[0]), image_path, viewer_);
  sighting.is_read = !picture.grey.empty();
  if (!sighting.is_read) return sighting;
  picture.keypoints = FindKeypoints(picture.grey, cv::Mat1b());
  const std::vector<PhotoPlace> found =
      SearchPhotoPlaces(MatchPicture(picture, camera), camera, search, num_threads_);
  if (found.empty() || found[0].num_cells < options_.min_cells_of_views) return sighting;
  for (size_t k = 0; k < found.size(); ++k) {
    const PhotoPlace& place = found[k];
    if (k >= kFewestLooks && place.num_cells < kRivalShare * found[0].num_cells) break;
    SeenPlace seen = LookCloser(picture, camera, source, place);
    const Eigen::Vector3d centre = seen.pose.cam_from_scan.TargetOriginInSource();
    // From behind, a mirrored wall looks like the wall.
    if (seen.num_cells == 0 ||
        viewer_.free_space().Locate(centre, kHiddenBy) == FreeSpace::Place::kHidden) {
      continue;
    }
    sighting.places.push_back(std::move(seen));
  }
  std::stable_sort(
      sighting.places.begin(), sighting.places.end(),
      [](const SeenPlace& a, const SeenPlace& b) { return a.num_cells > b.num_cells; });
  std::vector<SeenPlace> distinct;
  for (SeenPlace& place : sighting.places) {
    const bool is_new = std::all_of(distinct.begin(), distinct.end(), [&](const SeenPlace& other) {
      return AreDistinct(place.pose.cam_from_scan, other.pose.cam_from_scan, search);
    });
    if (is_new) distinct.push_back(std::move(place));
  }
  sighting.places = std::move(distinct);
  return sighting;
}

}  // namespace roomtex
