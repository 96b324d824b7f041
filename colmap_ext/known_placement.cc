#include "colmap_ext/known_placement.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "colmap_ext/photo_bundle.h"
#include "core/frames.h"

namespace roomtex {
namespace {

// Held poses may cost so much: more says that they are not those of the photos to the pixel, and
// that holding them would bend the rest.
constexpr double kMostHeldNoise = 1.5;  // times the noise of the model as mapped
// A held pose that costs the photo more of its points is not where the photo was taken, to the
// pixel.
constexpr double kLeastPointsKept = 0.5;
// Points that a photo must see where it is told to stand to be believed.
constexpr long kLeastPoints = 10;

Eigen::Vector3d MeanPlace(const KnownPhotos& known) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& [id, pose] : known.cam_from_scan) sum += pose.TargetOriginInSource();
  return sum / static_cast<double>(known.cam_from_scan.size());
}

// About an origin of their own: numbers of a survey's grid would cost the adjustment its digits.
KnownPhotos MovedTo(const Eigen::Vector3d& origin, KnownPhotos known) {
  for (auto& [id, pose] : known.cam_from_scan) pose.translation += pose.rotation * origin;
  return known;
}

// Poses alone.
SparseModel PosesOf(const SparseModel& model) {
  SparseModel poses;
  poses.cameras = model.cameras;
  for (const auto& [id, image] : model.images) {
    poses.images[id] = {id, image.camera_id, image.name, image.cam_from_model, {}, {}};
  }
  return poses;
}

long NumPoints(const SparseImage& image) {
  return std::count_if(image.point3d_ids.begin(), image.point3d_ids.end(),
                       [](uint64_t id) { return id != kInvalidPoint3dId; });
}

class Placer {
 public:
  Placer(const KnownPhotos& known, const std::map<uint32_t, DatabaseImage>& images,
         const std::map<uint32_t, Camera>& cameras, MapperRun* mapper, KnownPlacement* placement)
      : known_(known), images_(images), cameras_(cameras), mapper_(mapper), out_(*placement) {}

  // The model, moved already, with the known poses held; as it came where they do not fit.
  SparseModel Hold(const SparseModel& moved) {
    out_.free_px = KeypointNoise(moved);
    std::set<uint32_t> held = out_.fit.agreeing;
    SparseModel model = moved;
    std::set<uint32_t> rough;
    if (!HoldAll(held, moved, &model, &rough)) return moved;
    for (const uint32_t id : rough) held.erase(id);
    if (!rough.empty()) {
      // The others may be exact all the same, if they are most.
      if (held.size() < 2 || held.size() <= rough.size()) return moved;
      out_.rough = std::move(rough);
      if (!HoldAll(held, moved, &model, &rough) || !rough.empty()) return moved;
    }
    out_.held_px = KeypointNoise(model);
    if (out_.held_px > kMostHeldNoise * out_.free_px) return moved;
    out_.held = true;
    return model;
  }

 private:
  // False: it could not be done. rough: of those held, the ones that lose their points by it.
  bool HoldAll(const std::set<uint32_t>& held, const SparseModel& moved, SparseModel* model,
               std::set<uint32_t>* rough) {
    *model = moved;
    for (const uint32_t id : held) {
      model->images.at(id).cam_from_model = known_.cam_from_scan.at(id);
    }
    // First the other poses, then the points anew: those that the old poses agreed on are not all.
    PhotoBundle bundle = AdjustPhotos(*model, LensesOf(*model), out_.free_px, held);
    if (!bundle.usable) return false;
    SparseModel poses = PosesOf(bundle.model);
    out_.added = Add(&poses);
    MapperResult triangulated = mapper_->Triangulate(poses);
    if (DropUnseen(triangulated, &out_.added, &poses)) triangulated = mapper_->Triangulate(poses);
    if (!triangulated.problem.empty() || triangulated.model.images.size() != poses.images.size()) {
      return false;
    }
    rough->clear();
    for (const uint32_t id : held) {
      const auto kept = static_cast<double>(NumPoints(triangulated.model.images.at(id)));
      const auto before = static_cast<double>(NumPoints(moved.images.at(id)));
      if (kept < kLeastPointsKept * before) rough->insert(id);
    }
    std::set<uint32_t> fixed = held;
    fixed.insert(out_.added.begin(), out_.added.end());
    bundle = AdjustPhotos(triangulated.model, LensesOf(triangulated.model), out_.free_px, fixed);
    *model = std::move(bundle.model);
    return bundle.usable;
  }

  // Known photos that are not in the model.
  std::set<uint32_t> Add(SparseModel* poses) const {
    std::set<uint32_t> added;
    for (const auto& [id, pose] : known_.cam_from_scan) {
      if (poses->images.count(id) > 0) continue;
      const DatabaseImage& image = images_.at(id);
      poses->images[id] = {id, image.camera_id, image.name, pose, {}, {}};
      poses->cameras.emplace(image.camera_id, cameras_.at(image.camera_id));
      added.insert(id);
    }
    return added;
  }

  // Takes those out again that see too little to tell whether they stand right.
  static bool DropUnseen(const MapperResult& triangulated, std::set<uint32_t>* added,
                         SparseModel* poses) {
    bool any = false;
    for (auto at = added->begin(); at != added->end();) {
      const auto image = triangulated.model.images.find(*at);
      if (image != triangulated.model.images.end() && NumPoints(image->second) >= kLeastPoints) {
        ++at;
        continue;
      }
      poses->images.erase(*at);
      at = added->erase(at);
      any = true;
    }
    return any;
  }

  const KnownPhotos& known_;
  const std::map<uint32_t, DatabaseImage>& images_;
  const std::map<uint32_t, Camera>& cameras_;
  MapperRun* const mapper_;
  KnownPlacement& out_;
};

}  // namespace

KnownPlacement PlaceByKnownPhotos(const KnownPhotos& known,
                                  const std::map<uint32_t, DatabaseImage>& images,
                                  const std::map<uint32_t, Camera>& cameras,
                                  const std::string& folder, MapperRun* mapper,
                                  MapperResult* result) {
  const Eigen::Vector3d origin = MeanPlace(known);
  const KnownPhotos local = MovedTo(origin, known);
  KnownPlacement placement;
  placement.fit = FitToKnown(result->model, local);
  if (placement.fit.kind != KnownFit::Kind::kPlaced) return placement;
  SparseModel moved = result->model;
  TransformModel(placement.fit.scan_from_sparse, &moved);
  result->model = Placer(local, images, cameras, mapper, &placement).Hold(moved);
  if (!placement.held) {
    placement.added.clear();
    placement.rough.clear();
  }
  result->mean_reprojection_error_px = MeanPointError(&result->model);
  const Similarity scan_from_local{1, Eigen::Quaterniond::Identity(), origin};
  TransformModel(scan_from_local, &result->model);
  placement.fit.scan_from_sparse = scan_from_local * placement.fit.scan_from_sparse;
  WriteSparseModel(result->model, folder);
  result->folder = folder;
  return placement;
}

Json KnownToJson(const KnownPlacement& placement, const KnownPhotos& known,
                 const std::map<uint32_t, DatabaseImage>& images) {
  const KnownFit& fit = placement.fit;
  const bool placed = fit.kind == KnownFit::Kind::kPlaced;
  const auto number = [&](double value) { return placed ? Json(value) : Json(); };
  Json json;
  json["num_known"] = known.cam_from_scan.size();
  json["num_unmatched"] = known.unmatched.size();
  json["placed"] = placed;
  json["held"] = placement.held;
  json["num_agreeing"] = fit.agreeing.size();
  const auto names = [&images](const std::set<uint32_t>& ids) {
    Json list = Json::array();
    for (const uint32_t id : ids) list.push_back(images.at(id).name);
    return list;
  };
  json["contradicting"] = names(fit.contradicting);
  json["rough"] = names(placement.rough);
  std::set<uint32_t> held;
  std::set_difference(fit.agreeing.begin(), fit.agreeing.end(), placement.rough.begin(),
                      placement.rough.end(), std::inserter(held, held.end()));
  held.insert(placement.added.begin(), placement.added.end());
  json["photos_held"] = names(placement.held ? held : std::set<uint32_t>());
  // What one standpoint leaves open, the scan tells (roomtex-align), which needs the poses as told.
  json["told"] = Json::array();
  const bool is_open = fit.kind == KnownFit::Kind::kTooFew || fit.kind == KnownFit::Kind::kOnePlace;
  for (const auto& [id, pose] : known.cam_from_scan) {
    if (!is_open) break;
    json["told"].push_back({{"name", images.at(id).name},
                            {"rotation_wxyz", ToJson(WxyzFromQuaternion(pose.rotation))},
                            {"translation", ToJson(pose.translation)}});
  }
  json["position_rms_m"] = number(fit.position_rms);
  json["rotation_rms_deg"] = number(DegFromRad(fit.rotation_rms));
  json["baseline_m"] = number(fit.baseline);
  json["keypoint_noise_px"] = {{"mapped", number(placement.free_px)},
                               {"held", placement.held_px > 0 ? Json(placement.held_px) : Json()}};
  return json;
}

}  // namespace roomtex
