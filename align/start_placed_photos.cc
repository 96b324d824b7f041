#include "align/start_placed_photos.h"

#include <algorithm>
#include <utility>

#include "align/fit/joint_picks.h"
#include "align/start_appearance.h"
#include "align/start_photos.h"
#include "align/trust/scan_view.h"
#include "core/frames.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr int kFewestDepths = 10;    // that tell a scale
constexpr size_t kMostDepths = 300;  // of a photo

// Photos over all of the model, a coarser choice first; no panoramas.
PhotoModel PhotosToAsk(const SparseModel& model, const PlacedPhotoOptions& options) {
  const std::vector<const SparseImage*> images = SpreadImages(model, options.num_all);
  const size_t num_rounds = (images.size() + options.num_first - 1) / options.num_first;
  PhotoModel photos;
  for (size_t round = 0; round < num_rounds; ++round) {
    for (size_t i = round; i < images.size(); i += num_rounds) {
      const Camera& camera = model.cameras.at(images[i]->camera_id);
      if (camera.IsPanorama()) continue;
      SparseImage one;
      one.image_id = static_cast<uint32_t>(photos.model.images.size() + 1);
      one.name = images[i]->name;
      one.camera_id = images[i]->camera_id;
      photos.model.cameras.emplace(one.camera_id, camera);
      photos.model.images.emplace(one.image_id, one);
      photos.focal_sources[one.name] = FocalSource::kGiven;
    }
  }
  return photos;
}

// Where one photo puts the model: its scale is that of its points' depths. None if too few of them
// lie before the scan.
std::optional<Similarity> PlaceOfModel(const PickView& view, const SparseModel& model,
                                       const FreeSpace& surface) {
  const SparseImage& image = *model.FindImage(view.image_name);
  const Rigid& cam_from_scan = view.review.poses[0].cam_from_scan;
  const Eigen::Vector3d centre = cam_from_scan.TargetOriginInSource();
  const Eigen::Vector3d centre_in_sparse = image.cam_from_model.TargetOriginInSource();
  const size_t stride = 1 + image.point3d_ids.size() / kMostDepths;
  std::vector<double> scales;
  for (size_t i = 0; i < image.point3d_ids.size(); i += stride) {
    if (image.point3d_ids[i] == kInvalidPoint3dId) continue;
    const Eigen::Vector3d ray = model.points.at(image.point3d_ids[i]).x_in_model - centre_in_sparse;
    const Eigen::Vector3d ray_in_scan =
        cam_from_scan.rotation.conjugate() * (image.cam_from_model.rotation * ray.normalized());
    const auto sight = surface.Look(centre, ray_in_scan);
    if (sight) scales.push_back((sight->x_in_scan - centre).norm() / ray.norm());
  }
  if (scales.size() < kFewestDepths) return std::nullopt;
  return ScanFromSparse(cam_from_scan, image.cam_from_model, Median(&scales));
}

// Of the views, those that stand where the model has them.
std::vector<const PickView*> Agreeing(const std::vector<PickView>& views, const SparseModel& model,
                                      const Similarity& scan_from_sparse,
                                      const PlacedPhotoOptions& options) {
  std::vector<const PickView*> agreeing;
  for (const PickView& view : views) {
    const Rigid here =
        CamFromScan(model.FindImage(view.image_name)->cam_from_model, scan_from_sparse);
    const Rigid& there = view.review.poses[0].cam_from_scan;
    const double off = (here.TargetOriginInSource() - there.TargetOriginInSource()).norm();
    const double turned = RotationAngle(here.rotation, there.rotation);
    if (off > options.same_place || turned > RadFromDeg(options.same_turn_deg)) continue;
    agreeing.push_back(&view);
  }
  return agreeing;
}

// What most of the placed photos agree on.
PlacedPhotoEvidence Agree(const FoundPhotos& found, const AlignmentInput& input,
                          const AlignmentOptions& options, const PlacedPhotoOptions& placed) {
  PlacedPhotoEvidence evidence;
  evidence.num_asked = static_cast<int>(found.photos.size());
  evidence.num_placed = static_cast<int>(found.views.size());
  std::vector<const PickView*> best;
  for (const PickView& view : found.views) {
    const auto place = PlaceOfModel(view, input.model, input.surveyed.free_space());
    if (!place) continue;
    std::vector<const PickView*> agreeing = Agreeing(found.views, input.model, *place, placed);
    if (agreeing.size() <= best.size()) continue;
    best = std::move(agreeing);
    evidence.scan_from_sparse = *place;
  }
  evidence.num_agreeing = static_cast<int>(best.size());
  for (const PickView* view : best) {
    for (const int pick : view->picks) evidence.agreeing.push_back(found.picks[pick]);
  }
  evidence.spread = FindCellSpread(evidence.agreeing);
  if (evidence.num_agreeing < placed.min_agreeing) return evidence;
  const JointPickFit joint = FitPicksJointly(
      input.model, evidence.agreeing, std::vector<bool>(evidence.agreeing.size(), true),
      CornerSigma(evidence.agreeing, input.model, *evidence.scan_from_sparse),
      *evidence.scan_from_sparse, options.fit, options.picks.min_bad_pick_px);
  if (joint.converged) evidence.scan_from_sparse = joint.scan_from_sparse;
  return evidence;
}

}  // namespace

bool StandsOut(const PlacedPhotoEvidence& evidence, const PlacedPhotoOptions& options) {
  const int elsewhere = evidence.num_placed - evidence.num_agreeing;
  return evidence.num_agreeing >= options.min_agreeing &&
         evidence.spread.num_apart >= kFewestApart &&
         elsewhere <= options.max_share_elsewhere * evidence.num_agreeing;
}

void AskPhotosAlone(const AlignmentInput& input, const AlignmentOptions& options,
                    const PlacedPhotoOptions& placed, Progress* progress, StartSearch* search) {
  if (input.image_path.empty()) return;
  if (!search->placed_photos) {
    PlacedPhotoEvidence evidence;
    const PhotoModel photos = PhotosToAsk(input.model, placed);
    FindPhotos(photos, input.surveyed, input.image_path, {}, placed.photo, options.trust,
               input.num_threads, progress, [&](const FoundPhotos& found) {
                 evidence = Agree(found, input, options, placed);
                 const bool hopeless =
                     evidence.num_asked == placed.num_first && evidence.num_placed == 0;
                 return hopeless || StandsOut(evidence, placed);
               });
    search->placed_photos = std::move(evidence);
  }
  const PlacedPhotoEvidence& evidence = *search->placed_photos;
  if (!StandsOut(evidence, placed)) return;
  AddStartThatLooksAlike(input, options, *evidence.scan_from_sparse, evidence.agreeing, search);
}

}  // namespace roomtex
