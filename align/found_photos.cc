#include "align/found_photos.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <Eigen/Geometry>

#include "align/search/up_directions.h"
#include "core/frames.h"
#include "core/text.h"

namespace roomtex {
namespace {

// The pose with all that it may be off by: FoundPhotoOptions.
ViewPose WithScanError(ViewPose pose, const FoundPhotoOptions& options) {
  pose.covariance *= options.formal_times * options.formal_times;
  const double turn2 = std::pow(RadFromDeg(options.scan_sigma_deg), 2) / 3;
  const double move2 = options.scan_sigma * options.scan_sigma / 3;
  pose.covariance.diagonal().head<3>().array() += turn2;
  pose.covariance.diagonal().tail<3>().array() += move2;
  return pose;
}

// Metres that a place may be off where a hint is held against it.
constexpr double kPhotoHintSlack = 0.1;

// Of this photo alone.
PhotoHints HintsOf(const std::string& image_name, const PhotoHints& all) {
  PhotoHints hints;
  for (const Pick& pick : all.picks) {
    if (pick.image_name == image_name && pick.weight > 0) hints.picks.push_back(pick);
  }
  for (const NearHint& hint : all.near) {
    if (hint.image_name == image_name) hints.near.push_back(hint);
  }
  return hints;
}

// Whether a place of the photo has what it was said to show where it was said to be.
bool Agrees(const PhotoHints& hints, const SparseImage& image, const Camera& camera,
            const SeenPlace& place) {
  SparseModel photo;
  photo.images[image.image_id] = image;
  photo.images[image.image_id].cam_from_model = Rigid();
  photo.cameras[image.camera_id] = place.pose.lens ? *place.pose.lens : camera;
  const Rigid scan_from_cam = place.pose.cam_from_scan.Inverse();
  return Agrees(FindHintRays(photo, hints.picks, hints.near),
                {1, scan_from_cam.rotation, scan_from_cam.translation}, kPhotoHintSlack);
}

// Why a photo has no pose, a clause; "" if it has one.
std::string ProblemOf(const PhotoSighting& sighting, FocalSource source, const ViewPose& pose,
                      const FoundPhotoOptions& options, const TrustOptions& trust) {
  const int num = sighting.places.empty() ? 0 : sighting.places[0].num_cells;
  if (num < options.min_cells) {
    return "it shows too little that the scan's intensity shows, too (" + std::to_string(num) +
           " places of the scan, " + std::to_string(options.min_cells) + " are asked for)";
  }
  const double share = sighting.places[0].share;
  if (share < options.min_share) {
    return "only " + Number(100 * share, 0) +
           " % of what it and the scan have at about the same place agrees, as in a room that is "
           "alike (" +
           Number(100 * options.min_share, 0) + " % are asked for)";
  }
  if (sighting.places.size() > 1 && num < options.min_ratio * sighting.places[1].num_cells) {
    const bool given = source == FocalSource::kGiven;
    return std::string("it could have been taken from two places") +
           (given ? "" : ", or with two focal lengths") + " (" + std::to_string(num) + " and " +
           std::to_string(sighting.places[1].num_cells) + " places of the scan agree)";
  }
  if (source == FocalSource::kPicks && !(pose.focal_sigma > 0)) {
    return "nothing says its focal length, and what it shows of the scan, one plane, does not tell "
           "it";
  }
  if (source == FocalSource::kPicks && !(pose.focal_sigma <= options.max_focal_sigma)) {
    return "nothing says its focal length, and what it shows of the scan tells it to no more "
           "than " +
           Number(100 * pose.focal_sigma, 1) + " %";
  }
  if (!(pose.PositionSigma() <= trust.max_position_sigma)) {
    return "what it shows of the scan leaves open where it was taken";
  }
  return "";
}

// The photo's features as picks, and its pose, which they have given already.
void AddView(const SparseImage& image, const SeenPlace& place, const ViewPose& pose,
             FoundPhotos* found) {
  PickView view;
  view.image_name = image.name;
  view.image = &image;
  view.pairs = place.pairs;
  for (int i = 0; i < place.pairs.size(); ++i) {
    view.picks.push_back(static_cast<int>(found->picks.size()));
    found->picks.push_back({image.name, place.pairs.x_in_img.col(i), place.pairs.x_in_scan.col(i)});
  }
  view.review.poses = {pose};
  view.review.used.assign(place.pairs.size(), true);
  view.review.residual_px = pose.residual_px;
  view.review.leave_one_out_px = view.review.without_px2 =
      Eigen::VectorXd::Constant(place.pairs.size(), std::numeric_limits<double>::quiet_NaN());
  found->views.push_back(std::move(view));
}

}  // namespace

FoundPhotos FindPhotos(const PhotoModel& photos, const SurveyedScans& surveyed,
                       const std::string& image_path, const PhotoHints& hints,
                       const FoundPhotoOptions& options, const TrustOptions& trust, int num_threads,
                       Progress* progress, const std::function<bool(const FoundPhotos&)>& enough) {
  FoundPhotos found;
  const UpDirections ups = FindScanUps(surveyed.scans(), surveyed.patches());
  progress->Stage("features of the scan");
  const PhotoFinder finder(surveyed.viewer(), ups.ups[0], options.finder, num_threads);
  progress->Stage("features of the photos", static_cast<int>(photos.model.images.size()));
  for (const auto& [id, image] : photos.model.images) {
    const Camera& camera = photos.model.cameras.at(image.camera_id);
    const FocalSource source = photos.focal_sources.at(image.name);
    PhotoSighting sighting = finder.Find(image, camera, source, image_path);
    progress->Tick();
    if (!sighting.is_read) continue;
    const PhotoHints said = HintsOf(image.name, hints);
    std::vector<SeenPlace>& places = sighting.places;
    const size_t num_seen = places.size();
    places.erase(std::remove_if(places.begin(), places.end(),
                                [&, &image = image](const SeenPlace& place) {
                                  return !Agrees(said, image, camera, place);
                                }),
                 places.end());
    PhotoEvidence evidence;
    evidence.image_name = image.name;
    found.num_places += static_cast<int>(num_seen);
    ViewPose pose;
    if (!places.empty()) {
      evidence.num_cells = places[0].num_cells;
      evidence.share = places[0].share;
      pose = WithScanError(places[0].pose, options);
    }
    if (places.size() > 1) evidence.num_cells_second = places[1].num_cells;
    evidence.problem = ProblemOf(sighting, source, pose, options, trust);
    if (places.empty() && num_seen > 0) {
      evidence.problem = "what is said of it agrees with none of the places it may be at";
    }
    if (evidence.problem.empty()) AddView(image, places[0], pose, &found);
    found.photos.push_back(std::move(evidence));
    if (enough && enough(found)) break;
  }
  return found;
}

}  // namespace roomtex
