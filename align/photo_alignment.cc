#include "align/photo_alignment.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/LU>
#include <fmt/core.h>
#include <opencv2/core.hpp>

#include "core/frames.h"
#include "core/photo.h"
#include "core/statistics.h"
#include "core/text.h"

namespace roomtex {
namespace {

// A pose that misses the picks by no more than this many times as much as the best one fits as
// well.
constexpr double kFitsAsWell = 1.5;
constexpr double kLeastFit = 1.0;  // pixels, rms
// Metres; a surface nearer to the camera than a pick by more than this hides it.
constexpr double kHiddenBy = 0.1;
constexpr double kFocalToName =
    0.01;  // share; a focal length less certain than this is worth a word

// A photo with its pose.
struct PlacedPhoto {
  const PickView* view = nullptr;
  ViewPose pose;
  bool by_features = false;  // instead of by clicks
  bool ambiguous = false;
  double to_second = 0;  // metres from the camera to that of the other pose
};

bool IsCameraFree(const AlignmentInput& input, const Rigid& cam_from_scan,
                  const TrustOptions& trust) {
  return input.surveyed.free_space().Locate(cam_from_scan.TargetOriginInSource(),
                                            trust.surface_tolerance) != FreeSpace::Place::kHidden;
}

// Of the poses that fit about as well the one with its camera where the scanner looked through.
PlacedPhoto Place(const AlignmentInput& input, const PickView& view, const TrustOptions& trust) {
  const std::vector<ViewPose>& poses = view.review.poses;
  const double limit = std::max(kFitsAsWell * poses[0].rms_px, kLeastFit);
  std::vector<const ViewPose*> fitting, free;
  for (const ViewPose& pose : poses) {
    if (pose.rms_px > limit) continue;
    fitting.push_back(&pose);
    if (IsCameraFree(input, pose.cam_from_scan, trust)) free.push_back(&pose);
  }
  const std::vector<const ViewPose*>& candidates = free.empty() ? fitting : free;
  PlacedPhoto placed;
  placed.view = &view;
  placed.pose = *candidates[0];
  const Eigen::Vector3d centre = placed.pose.cam_from_scan.TargetOriginInSource();
  for (size_t i = 1; i < candidates.size() && !placed.ambiguous; ++i) {
    placed.to_second = (candidates[i]->cam_from_scan.TargetOriginInSource() - centre).norm();
    placed.ambiguous = placed.to_second > 3 * placed.pose.PositionSigma();
  }
  return placed;
}

int NumUsed(const PickReview& review) {
  return static_cast<int>(std::count(review.used.begin(), review.used.end(), true));
}

// Used picks that something of the scan hides from the photo.
int NumHidden(const AlignmentInput& input, const PlacedPhoto& photo) {
  const Eigen::Vector3d centre = photo.pose.cam_from_scan.TargetOriginInSource();
  int num_hidden = 0;
  for (int i = 0; i < photo.view->pairs.size(); ++i) {
    if (!photo.view->review.used[i]) continue;
    const Eigen::Vector3d to_pick = photo.view->pairs.x_in_scan.col(i) - centre;
    const auto sight = input.surveyed.free_space().Look(centre, to_pick.normalized());
    num_hidden += sight && (sight->x_in_scan - centre).norm() < to_pick.norm() - kHiddenBy;
  }
  return num_hidden;
}

const Camera& CameraOf(const AlignmentInput& input, const PlacedPhoto& photo) {
  return photo.pose.lens ? *photo.pose.lens : input.model.cameras.at(photo.view->image->camera_id);
}

// What speaks against the pose of one photo, in sentences.
std::vector<std::string> JudgePhoto(const AlignmentInput& input, const PlacedPhoto& photo,
                                    int min_picks, const TrustOptions& trust) {
  std::vector<std::string> reasons;
  const PickView& view = *photo.view;
  const std::string& name = view.image_name;
  const double limit = trust.PickRmsLimit(CameraOf(input, photo));
  if (!(photo.pose.rms_px <= limit)) {
    int worst = -1;
    for (int i = 0; i < view.pairs.size(); ++i) {
      if (!view.review.used[i]) continue;
      if (worst < 0 || view.review.residual_px[i] > view.review.residual_px[worst]) worst = i;
    }
    reasons.push_back("The picks in " + name + " miss by " + Number(photo.pose.rms_px, 1) +
                      " pixels (rms), more than the limit of " + Number(limit, 1) +
                      "; the worst is on " + LineOf(input.picks[view.picks[worst]]) + " with " +
                      Number(view.review.residual_px[worst], 1) + " pixels. Pick again.");
  }
  const double sigma = photo.pose.PositionSigma();
  if (!(sigma <= trust.max_position_sigma)) {
    reasons.push_back(
        "The picks leave open where " + name + " was taken, by " +
        (std::isfinite(sigma) ? Number(sigma, 2) + " m" : std::string("any distance")) +
        " (one standard deviation). Spread them more over the photo and in depth" +
        (photo.pose.lens ? ", or give its camera (--camera_params)." : "."));
  }
  if (photo.ambiguous) {
    reasons.push_back("Two places of the camera, " + Number(photo.to_second, 2) +
                      " m apart, fit the picks in " + name +
                      " about equally well. Pick a point off the plane of the others.");
  }
  if (const int num_used = NumUsed(view.review); num_used < min_picks) {
    reasons.push_back("Without the picks that were left out only " + std::to_string(num_used) +
                      " are left in " + name + ", fewer than " + std::to_string(min_picks) +
                      ". Correct those, or add others.");
  }
  if (!IsCameraFree(input, photo.pose.cam_from_scan, trust)) {
    reasons.push_back(name +
                      " would have been taken from behind the surface that the scanner saw.");
  }
  const int num_hidden = NumHidden(input, photo);
  if (num_hidden >= 2 && 3 * num_hidden >= NumUsed(view.review)) {
    reasons.push_back(std::to_string(num_hidden) + " of the picks in " + name +
                      " would be hidden from it by other surfaces of the scan. Check that they are "
                      "of this photo and of this scan.");
  }
  return reasons;
}

// What was found of a lens.
std::string LensSentence(const PlacedPhoto& photo, FocalSource source, double told) {
  const ViewPose& pose = photo.pose;
  const double focal = pose.lens->MeanFocalLength();
  std::string sentence = "The focal length of " + photo.view->image_name + " was found by its " +
                         (photo.by_features ? "features: " : "picks: ") + Number(focal, 0) +
                         " pixels, known to " + Number(100 * pose.focal_sigma, 1) + " %";
  if (source == FocalSource::kExif) sentence += " (its EXIF data: " + Number(told, 0) + ")";
  return sentence + (pose.focal_sigma > kFocalToName
                         ? "; give --camera_params where the camera is known."
                         : ".");
}

// Photos, cameras and picks as a model.
SparseModel ModelOf(const AlignmentInput& input, const std::vector<PlacedPhoto>& photos) {
  SparseModel model;
  std::map<std::array<double, 3>, uint64_t> ids;  // of points that are picked
  for (const PlacedPhoto& photo : photos) {
    SparseImage image = *photo.view->image;
    image.cam_from_model = photo.pose.cam_from_scan;
    Camera camera = CameraOf(input, photo);
    camera.camera_id = image.camera_id;
    model.cameras[camera.camera_id] = camera;
    for (int i = 0; i < photo.view->pairs.size(); ++i) {
      const Eigen::Vector3d x = photo.view->pairs.x_in_scan.col(i);
      image.points2d.push_back(photo.view->pairs.x_in_img.col(i));
      image.point3d_ids.push_back(kInvalidPoint3dId);
      if (!photo.view->review.used[i]) continue;
      const uint64_t id =
          ids.try_emplace({x.x(), x.y(), x.z()}, static_cast<uint64_t>(ids.size() + 1))
              .first->second;
      image.point3d_ids.back() = id;
      model.points[id].x_in_model = x;
      model.points[id].track.push_back({image.image_id, static_cast<uint32_t>(i)});
    }
    model.images[image.image_id] = image;
  }
  return model;
}

// Residuals and leave-one-out distances of the picks.
AlignmentStart StartOf(const AlignmentInput& input, const std::vector<PlacedPhoto>& photos) {
  AlignmentStart start;
  start.source = AlignmentStart::Source::kPicks;
  const double none = std::numeric_limits<double>::quiet_NaN();
  for (const Pick& pick : input.picks) start.picks.push_back({pick, false, none, none});
  std::vector<double> residuals(input.picks.size(), 0);
  for (const PlacedPhoto& photo : photos) {
    const Eigen::VectorXd distance = PickResiduals(CameraProjection(CameraOf(input, photo)),
                                                   photo.view->pairs, photo.pose.cam_from_scan);
    for (size_t k = 0; k < photo.view->picks.size(); ++k) {
      const int i = photo.view->picks[k];
      start.picks[i].used = photo.view->review.used[k];
      start.picks[i].residual_px = residuals[i] = distance[static_cast<int>(k)];
      start.picks[i].leave_one_out_px = photo.view->review.leave_one_out_px[static_cast<int>(k)];
      start.pick_max_px = std::fmax(start.pick_max_px, residuals[i]);
    }
    start.position_sigma = std::max(start.position_sigma, photo.pose.PositionSigma());
  }
  start.pick_rms_px = PickRms(start.picks, residuals);
  return start;
}

// Radians, root of the trace.
double RotationSigma(const ViewPose& pose) {
  return std::sqrt(pose.covariance.topLeftCorner<3, 3>().trace());
}

// Photos that have fewer picks than a pose asks for, and were not found with them as a hint.
void WarnOfFewPicks(const AlignmentInput& input, const FoundPhotos& found,
                    std::vector<std::string>* warnings) {
  for (const auto& entry : input.model.images) {
    const std::string& name = entry.second.name;
    const long count = std::count_if(input.picks.begin(), input.picks.end(), [&](const Pick& pick) {
      return pick.image_name == name && pick.weight > 0;
    });
    if (count >= kMinPicksPerPhoto) continue;  // why it has no pose is said already
    const auto asked =
        std::find_if(found.photos.begin(), found.photos.end(),
                     [&](const PhotoEvidence& photo) { return photo.image_name == name; });
    const bool was_asked = asked != found.photos.end();
    if (was_asked && asked->problem.empty()) continue;
    warnings->push_back(
        fmt::format("{} is left out: it has {} {}, and without a sparse model each photo needs {} "
                    "of its own",
                    name, count, count == 1 ? "pick" : "picks", kMinPicksPerPhoto) +
        (was_asked ? "; searched for with these as a hint, " + asked->problem + "." : "."));
  }
}

// What there is to say of the photos that have a pose.
void FillIn(const AlignmentInput& input, const PhotoModel& photos,
            const std::vector<PlacedPhoto>& placed, const TrustOptions& trust,
            PhotoAlignment* result) {
  Alignment& alignment = result->alignment;
  std::vector<double> positions, rotations;
  for (const PlacedPhoto& photo : placed) {
    const ViewPose& pose = photo.pose;
    const SparseImage& image = *photo.view->image;
    const FocalSource source = photos.focal_sources.at(image.name);
    PhotoAlignment::Lens lens{source};
    if (pose.lens) {
      const double told = input.model.cameras.at(image.camera_id).MeanFocalLength();
      std::vector<std::string>* const said =
          source == FocalSource::kPicks && pose.focal_sigma > kFocalToName ? &alignment.warnings
                                                                           : &result->notes;
      said->push_back(LensSentence(photo, source, told));
      lens.focal_sigma = pose.focal_sigma * pose.lens->MeanFocalLength();
      lens.radial_sigma = pose.radial_sigma;
    }
    result->lenses[image.image_id] = lens;
    positions.push_back(pose.PositionSigma());
    rotations.push_back(RotationSigma(pose));
    alignment.photo_sigmas[image.image_id] = {positions.back(), rotations.back()};
    alignment.placement.num_cameras += 1;
    alignment.placement.num_cameras_free += IsCameraFree(input, pose.cam_from_scan, trust);
  }
  alignment.start = StartOf(input, placed);
  alignment.refined_pick_px.assign(input.picks.size(), std::numeric_limits<double>::quiet_NaN());
  alignment.expected_error.at_cameras = Median(&positions);
  alignment.expected_error.rotation = Median(&rotations);
  result->model = ModelOf(input, placed);
}

}  // namespace

PhotoAlignment AlignPhotos(const AlignmentInput& input, const PhotoModel& photos,
                           const FoundPhotos& found, const AlignmentOptions& options,
                           Progress* progress) {
  PhotoAlignment result;
  Alignment& alignment = result.alignment;
  progress->Stage("scan surface");
  alignment.warnings = CheckPicksOnScan(input);
  progress->Stage("pose from picks");
  const std::vector<PickView> views = ReviewPhotoViews(photos, input.picks, options.picks);
  for (std::string& warning : CheckPhotoViews(input, views)) {
    alignment.warnings.push_back(std::move(warning));
  }
  WarnOfFewPicks(input, found, &alignment.warnings);

  progress->Stage("trust");
  std::vector<PlacedPhoto> placed;
  for (const PickView& view : views) {
    if (!view.HasPose()) continue;
    placed.push_back(Place(input, view, options.trust));
    const FocalSource source = photos.focal_sources.at(view.image_name);
    const int min_picks = source == FocalSource::kPicks ? kMinPicksForFocal : kMinPicksPerPhoto;
    for (std::string& reason : JudgePhoto(input, placed.back(), min_picks, options.trust)) {
      alignment.reasons.push_back(std::move(reason));
    }
  }
  // Their features are none of the picks.
  std::vector<PickView> found_views = found.views;
  for (PickView& view : found_views) {
    view.picks.clear();
    placed.push_back({&view, view.review.pose(), true});
  }
  FillIn(input, photos, placed, options.trust, &result);
  return result;
}

PhotoAlignment AlignFoundPhotos(const AlignmentInput& input, const PhotoModel& photos,
                                const FoundPhotos& found, const TrustOptions& trust) {
  PhotoAlignment result;
  std::vector<PlacedPhoto> placed;
  for (const PickView& view : found.views) placed.push_back({&view, view.review.pose(), true});
  std::string first_problem;
  for (const PhotoEvidence& photo : found.photos) {
    if (photo.problem.empty()) continue;
    if (first_problem.empty()) first_problem = photo.image_name + ": " + photo.problem;
    result.alignment.warnings.push_back(photo.image_name + " is left out: " + photo.problem + ".");
  }
  if (placed.empty()) {
    result.alignment.reasons.push_back(
        "None of the photos could be placed by what it shows of the scan's intensity (" +
        (first_problem.empty() ? "none could be read" : first_problem) +
        "). Pick six points in one of them (roomtex-pick), or give the sparse model of more photos "
        "(--input_path).");
  }
  FillIn(input, photos, placed, trust, &result);
  return result;
}

void ColorPoints(const std::string& image_path, SparseModel* model) {
  for (const auto& [id, image] : model->images) {
    const cv::Mat3b photo = ReadPhoto(image_path + "/" + image.name);
    for (size_t i = 0; i < image.points2d.size(); ++i) {
      if (image.point3d_ids[i] == kInvalidPoint3dId) continue;
      const Eigen::Vector2d x = image.points2d[i];
      const cv::Vec3b bgr = photo(std::clamp(static_cast<int>(x.y()), 0, photo.rows - 1),
                                  std::clamp(static_cast<int>(x.x()), 0, photo.cols - 1));
      model->points.at(image.point3d_ids[i]).color = {bgr[2], bgr[1], bgr[0]};
    }
  }
}

}  // namespace roomtex
