#include "align/trust/photo_finder.h"

#include <algorithm>
#include <limits>
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
constexpr double kStill = 0.5;       // pixels of the view, median: a pose that has not moved
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

// A place that is looked at more closely: what is known of it so far, and its last view.
struct CloserPlace {
  SeenPlace seen;
  Camera lens;
  bool is_done = false;

  std::optional<CameraProjection> projection;  // of the view, in pixels of the picture
  Rigid cam_from_scan;
  std::vector<PhotoMatch> matches;

  void SetView(const cv::Size& size) {
    Camera small = lens;
    small.Resize(size.width, size.height);
    projection.emplace(small);
    cam_from_scan = seen.pose.cam_from_scan;
  }

  // Of the photo's keypoints, when it is taken as the view is.
  PlaceOfKeypoint UprightPlaces(const Eigen::Vector3d& up_in_scan) const {
    const Eigen::Vector3d down = cam_from_scan.rotation * -up_in_scan;
    return [this, down](const Eigen::Vector2d& at) -> std::optional<FeaturePlace> {
      const auto plane = projection->CamFromImg(at);
      if (!plane) return std::nullopt;
      FeaturePlace one = {Eigen::Vector3d::Zero(), DirectionInImg(*projection, *plane, down), at};
      if (!one.down) return std::nullopt;
      return one;
    };
  }

  // The pose has hardly moved since the view was drawn: another one would show the same.
  bool IsStill() const {
    Camera small = lens;
    small.Resize(projection->camera().width, projection->camera().height);
    const CameraProjection now(small);
    std::vector<double> moved;
    for (Eigen::Index i = 0; i < seen.pairs.x_in_scan.cols(); ++i) {
      const Eigen::Vector3d x = seen.pairs.x_in_scan.col(i);
      const auto was_at = projection->ImgFromCam(cam_from_scan * x),
                 is_at = now.ImgFromCam(seen.pose.cam_from_scan * x);
      moved.push_back(was_at && is_at ? (*is_at - *was_at).norm()
                                      : std::numeric_limits<double>::infinity());
    }
    return Median(&moved) <= kStill;
  }

  // Of the matches; without a pose that they agree on it is done, and nothing is seen.
  void Solve(FocalSource source, const PhotoSearchOptions& search, int num_threads) {
    const std::vector<PhotoPlace> found = SearchPhotoPlaces(matches, lens, search, num_threads);
    std::optional<ViewPose> solved;
    if (!found.empty()) {
      seen.pairs = PairsOf(matches, found[0].agreeing);
      solved = SolveWithout(lens, source, found[0].cam_from_scan, &seen.pairs);
    }
    if (!solved) {
      seen = {};
      is_done = true;
      return;
    }
    seen.num_cells = found[0].num_cells;
    seen.share = static_cast<double>(found[0].agreeing.size()) /
                 std::max(1, CountCells(matches, search.cell));
    seen.pose = *solved;
    if (solved->lens) lens = *solved->lens;
  }
};

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
  const Eigen::Vector2d grow =
      Eigen::Vector2d(camera.width, camera.height)
          .cwiseQuotient(Eigen::Vector2d(picture.grey.cols, picture.grey.rows));
  const auto place_of = [&grow](const std::optional<Eigen::Vector2d>& down) {
    return [grow, down](const Eigen::Vector2d& at) {
      return FeaturePlace{Eigen::Vector3d::Zero(), down, at.cwiseProduct(grow)};
    };
  };
  // As their own gradients are turned, and upright: photos are mostly held level.
  const std::vector<AppearanceFeatures> photo =
      DescribeFeatures(picture.grey, picture.keypoints,
                       {{false, place_of(std::nullopt)}, {true, place_of(Eigen::Vector2d(0, 1))}},
                       options_.max_photo_features);
  std::vector<PhotoMatch> matches;
  for (const bool upright : {false, true}) {
    for (const auto& [i, k] :
         MatchFeatures(photo[upright], features_[upright], options_.max_ratio)) {
      matches.push_back({photo[upright].in_img[i], features_[upright].places[k]});
    }
  }
  return matches;
}

std::vector<SeenPlace> PhotoFinder::LookCloser(const Picture& picture, const Camera& camera,
                                               FocalSource source,
                                               const std::vector<PhotoPlace>& places) const {
  const cv::Size size = picture.grey.size();
  const Eigen::Vector2d grow = Eigen::Vector2d(camera.width, camera.height)
                                   .cwiseQuotient(Eigen::Vector2d(size.width, size.height));
  PhotoSearchOptions search = options_.search;
  search.num_samples = kCloserSamples;
  search.focal_scales = {1};
  search.num_kept = 1;
  std::vector<CloserPlace> all(places.size());
  for (size_t k = 0; k < places.size(); ++k) {
    all[k].lens = WithFocalScale(camera, places[k].focal_scale);
    all[k].seen.pose.cam_from_scan = places[k].cam_from_scan;
  }
  const CloserLook* before = nullptr;
  for (const CloserLook& look : kLooks) {
    std::vector<CloserPlace*> redrawn;
    std::vector<KeypointUse> uses;
    for (CloserPlace& one : all) {
      if (one.is_done || (before && before->reach == look.reach && one.IsStill())) continue;
      one.SetView(size);
      redrawn.push_back(&one);
      uses.push_back({true, one.UprightPlaces(up_in_scan_)});
    }
    const std::vector<AppearanceFeatures> photo =
        DescribeFeatures(picture.grey, picture.keypoints, uses, kMostFeatures);
    for (size_t k = 0; k < redrawn.size(); ++k) {
      CloserPlace* const one = redrawn[k];
      const Camera& small = one->projection->camera();
      const AppearanceFeatures view =
          FeaturesOfView(viewer_, small, one->cam_from_scan, up_in_scan_, kMostFeatures);
      const double reach = look.reach * RadFromDeg(1.0) * small.MeanFocalLength();
      one->matches.clear();
      for (const auto& [i, j] : MatchNear(photo[k], view, reach, options_.max_ratio_near)) {
        one->matches.push_back({photo[k].in_img[i].cwiseProduct(grow), view.places[j]});
      }
    }
    search.tolerance_deg = look.tolerance;
    for (CloserPlace& one : all) {
      if (one.is_done) continue;
      one.Solve(source, search, num_threads_);
      one.is_done |= one.seen.num_cells < look.fewest;
    }
    before = &look;
  }
  std::vector<SeenPlace> seen;
  for (CloserPlace& one : all) {
    const bool tells_lens = one.seen.num_cells > 0 && source != FocalSource::kGiven;
    if (tells_lens && !one.seen.pose.lens) one.seen.pose.lens = one.lens;
    seen.push_back(std::move(one.seen));
  }
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
  std::vector<PhotoPlace> found =
      SearchPhotoPlaces(MatchPicture(picture, camera), camera, search, num_threads_);
  if (found.empty() || found[0].num_cells < options_.min_cells_of_views) return sighting;
  size_t num_looks = 0;
  while (num_looks < found.size() &&
         (num_looks < kFewestLooks ||
          found[num_looks].num_cells >= kRivalShare * found[0].num_cells)) {
    ++num_looks;
  }
  found.resize(num_looks);
  for (SeenPlace& seen : LookCloser(picture, camera, source, found)) {
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
