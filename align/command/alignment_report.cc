#include "align/command/alignment_report.h"

#include <cmath>
#include <limits>
#include <vector>

#include "align/command/plane_bundle_report.h"
#include "core/frames.h"

namespace roomtex {
namespace {

Json RmsOrNull(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return NumberOrNull(std::sqrt(sum / static_cast<double>(values.size())));
}

// How far picks miss their places, those of the start from `first` to `last`; NaN for none.
struct Misses {
  double rms_px, max_px, refined_rms_px;
};
Misses MissesOf(const Alignment& alignment, size_t first, size_t last) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  Misses misses = {kNone, kNone, kNone};
  const AlignmentStart& start = alignment.start;
  const std::vector<PickOutcome> some(start.picks.begin() + static_cast<long>(first),
                                      start.picks.begin() + static_cast<long>(last));
  if (some.empty() || alignment.refined_pick_px.size() < last) return misses;
  std::vector<double> at_start;
  for (const PickOutcome& outcome : some) {
    at_start.push_back(outcome.residual_px);
    if (outcome.pick.weight > 0) misses.max_px = std::fmax(misses.max_px, outcome.residual_px);
  }
  const std::vector<double>& all_refined = alignment.refined_pick_px;
  misses.rms_px = PickRms(some, at_start);
  misses.refined_rms_px = PickRms(some, {all_refined.begin() + static_cast<long>(first),
                                         all_refined.begin() + static_cast<long>(last)});
  return misses;
}

// Corners of the photos that the scan has at the same place: they hold a model without picks, or
// with few.
Json CornersToJson(const Alignment& alignment) {
  const size_t num_picks = alignment.start.picks.size(), num_corners = alignment.start.num_corners;
  if (num_corners == 0) return nullptr;
  const Misses misses = MissesOf(alignment, num_picks - num_corners, num_picks);
  return {{"count", num_corners},
          {"rms_px", NumberOrNull(misses.rms_px)},
          {"max_px", NumberOrNull(misses.max_px)},
          {"refined_rms_px", NumberOrNull(misses.refined_rms_px)}};
}

Json PicksToJson(const Alignment& alignment) {
  Json json;
  int num_used = 0;
  Json per_pick = Json::array();
  std::vector<double> check_px, refined_check_px;  // of weight 0: nothing rests on them
  const AlignmentStart& start = alignment.start;
  const size_t num_picks = start.picks.size() - start.num_corners;
  for (size_t i = 0; i < num_picks; ++i) {
    const PickOutcome& outcome = start.picks[i];
    num_used += outcome.used;
    Json one;
    one["image_name"] = outcome.pick.image_name;
    one["x"] = outcome.pick.x_in_img.x();
    one["y"] = outcome.pick.x_in_img.y();
    one["line"] = outcome.pick.line;
    one["residual_px"] = NumberOrNull(outcome.residual_px);
    one["refined_residual_px"] = NumberOrNull(alignment.refined_pick_px[i]);
    one["leave_one_out_px"] = NumberOrNull(outcome.leave_one_out_px);
    one["used"] = outcome.used;
    one["weight"] = outcome.pick.weight;
    if (!outcome.pick.label.empty()) one["label"] = outcome.pick.label;
    per_pick.push_back(one);
    if (outcome.pick.weight > 0 || !std::isfinite(outcome.residual_px)) continue;
    check_px.push_back(outcome.residual_px);
    refined_check_px.push_back(alignment.refined_pick_px[i]);
  }
  json["count"] = num_picks;
  json["num_used"] = num_used;
  json["image_name"] = start.image_name.empty() ? Json(nullptr) : Json(start.image_name);
  const Misses misses = start.num_corners > 0 ? MissesOf(alignment, 0, num_picks)
                                              : Misses{start.pick_rms_px, start.pick_max_px,
                                                       alignment.refined_pick_rms_px};
  json["rms_px"] = NumberOrNull(misses.rms_px);
  json["max_px"] = NumberOrNull(misses.max_px);
  json["refined_rms_px"] = NumberOrNull(misses.refined_rms_px);
  json["position_sigma_m"] = num_picks > 0 ? NumberOrNull(start.position_sigma) : Json(nullptr);
  if (!check_px.empty()) {
    json["check_points"] = {{"count", check_px.size()},
                            {"rms_px", RmsOrNull(check_px)},
                            {"refined_rms_px", RmsOrNull(refined_check_px)}};
  }
  json["corners"] = CornersToJson(alignment);
  json["per_pick"] = per_pick;
  return json;
}

// One standard deviation, by what clicks, keypoints and the scan's noise leave open.
Json ExpectedErrorToJson(const ExpectedError& error) {
  Json json;
  json["at_cameras_mm"] = NumberOrNull(1000 * error.at_cameras);
  json["at_far_corner_mm"] = NumberOrNull(1000 * error.at_far_corner);
  json["far_corner"] = {error.far_corner.x(), error.far_corner.y(), error.far_corner.z()};
  json["rotation_deg"] = NumberOrNull(DegFromRad(error.rotation));
  json["scale"] = NumberOrNull(error.scale);
  return json;
}

Json OpenDirectionsToJson(const OpenDirections& open) {
  const auto to_json = [](const std::vector<Eigen::Vector3d>& directions) {
    Json json = Json::array();
    for (const Eigen::Vector3d& d : directions) json.push_back({d.x(), d.y(), d.z()});
    return json;
  };
  Json json;
  json["degenerate"] = !open.None();
  json["num_facings"] = open.num_facings;
  json["open_translations"] = to_json(open.slides);
  json["open_rotations"] = to_json(open.turns);
  json["open_scale"] = open.scale;
  json["position_sigma_mm"] = NumberOrNull(1000 * open.slide_sigma);
  return json;
}

Json PlacementToJson(const Placement& placement) {
  Json json;
  json["num_points"] = placement.num_points;
  json["num_on_surface"] = placement.num_on_surface;
  json["num_floating"] = placement.num_floating;
  json["num_hidden"] = placement.num_hidden;
  json["surface_share"] = placement.SurfaceShare();
  json["changed_share"] = placement.ChangedShare();
  json["camera_share"] = placement.CameraShare();
  return json;
}

// Of Alignment::rolling_shutter.
Json RollingShutterToJson(const Alignment& alignment) {
  if (!alignment.rolling_shutter) return nullptr;
  const RollingShutter& rolling = *alignment.rolling_shutter;
  return {{"num_photos", rolling.motions.size()},
          {"median_turn_deg", DegFromRad(rolling.MedianTurn())},
          {"median_move_mm", 1000 * rolling.MedianMove()},
          {"cost_still", rolling.cost_still},
          {"cost_moving", rolling.cost_moving}};
}

}  // namespace

void FillReport(const Alignment& alignment, double reprojection_rms_after, Report* report) {
  Report& r = *report;
  r["scan_from_sparse"] = ToJson(alignment.scan_from_sparse);
  r["scan_from_sparse_from_picks"] = ToJson(alignment.start.scan_from_sparse);
  r["picks"] = PicksToJson(alignment);
  const ScaleEstimate& scale = alignment.start.scale;
  const bool has_scale = scale.num_features > 0;
  // Without picks in a photo of which the features could tell it, that of the answer.
  r["scale"]["value"] = has_scale ? scale.scale : alignment.scan_from_sparse.scale;
  r["scale"]["num_features"] = scale.num_features;
  r["scale"]["relative_mad"] = has_scale ? Json(scale.relative_mad) : Json(nullptr);
  r["planes"] = Json::array();
  const bool refined = alignment.fit.refined;
  const SimilarityFit& fit = alignment.fit.surface;
  // Of the similarity by the picks and the refined one; the adjustment has its own below.
  r["plane_rms_m"]["before"] = refined ? Json(fit.rms_before) : Json(nullptr);
  r["plane_rms_m"]["after"] = refined ? Json(fit.rms_after) : Json(nullptr);
  r["plane_rms_m"]["num_points"] = refined ? fit.num_points : 0;
  const PlaneBundle& bundle = alignment.adjustment.bundle;
  if (alignment.adjusted()) {
    r["plane_rms_m"]["before"] = bundle.plane_rms_before;
    r["plane_rms_m"]["after"] = bundle.plane_rms_after;
    r["plane_rms_m"]["num_points"] = bundle.constraints.size();
  }
  r["plane_bundle"] = PlaneBundleToJson(alignment);
  r["reprojection_rms_px"]["before"] = alignment.reprojection_rms_px;
  r["reprojection_rms_px"]["after"] = reprojection_rms_after;
  r["rolling_shutter"] = RollingShutterToJson(alignment);
  r["placement"] = PlacementToJson(alignment.placement);
  r["expected_error"] = ExpectedErrorToJson(alignment.expected_error);
  r["expected_error"]["disagreement_mm"] = NumberOrNull(1000 * alignment.disagreement.rms);
  r["surface_geometry"] = refined ? OpenDirectionsToJson(alignment.open) : Json(nullptr);
  r["agreement"] = nullptr;
}

Json PhotosToJson(const Alignment& alignment, const SparseModel& aligned) {
  Json json = Json::array();
  for (const auto& [image_id, image] : aligned.images) {
    const auto at = alignment.photo_sigmas.find(image_id);
    const bool known = at != alignment.photo_sigmas.end();
    Json one;
    one["name"] = image.name;
    one["position_sigma_mm"] = known ? NumberOrNull(1000 * at->second.position) : Json(nullptr);
    one["rotation_sigma_deg"] =
        known ? NumberOrNull(DegFromRad(at->second.rotation)) : Json(nullptr);
    if (alignment.rolling_shutter) {
      const auto& motions = alignment.rolling_shutter->motions;
      const auto motion = motions.find(image_id);
      const bool moves = motion != motions.end();
      // How the camera turned and where its centre went: the other way than what it sees.
      one["row_turn_deg"] = moves ? ToJson(-DegFromRad(1.0) * motion->second.turn) : Json(nullptr);
      one["row_move_mm"] = moves ? ToJson(-1000 * motion->second.move) : Json(nullptr);
    }
    json.push_back(one);
  }
  return json;
}

void AddVerdicts(const std::map<uint32_t, PhotoVerdict>& photos, const SparseModel& aligned,
                 Json* images) {
  for (Json& one : *images) {
    const SparseImage* const image = aligned.FindImage(one["name"].get<std::string>());
    const PhotoVerdict& photo = photos.at(image->image_id);
    one["num_points"] = photo.num_points;
    one["num_expected"] = photo.num_expected;
    one["sight_share"] = NumberOrNull(photo.sight_share);
    one["unevenness"] = NumberOrNull(photo.unevenness);
    one["surface_share"] = NumberOrNull(photo.surface_share);
    one["match_support"] = NumberOrNull(photo.match_support);
    const bool asked = photo.detail.num_windows > 0;
    one["detail_windows"] = asked ? Json(photo.detail.num_windows) : Json(nullptr);
    one["detail_share"] = NumberOrNull(photo.detail.Share());
    one["duplicate_of"] = photo.duplicate_of.empty() ? Json(nullptr) : Json(photo.duplicate_of);
    one["doubt"] = photo.doubt.empty() ? Json(nullptr) : Json(photo.doubt);
  }
}

Json StationsToJson(const StationCheck& check, const std::vector<Scan>& scans) {
  Json json = Json::array();
  for (const StationPair& pair : check.pairs) {
    Json one;
    one["first"] = ScanName(scans, pair.first);
    one["second"] = ScanName(scans, pair.second);
    one["num_patches"] = pair.num_patches;
    one["offset_mm"] = 1000 * pair.offset;
    one["offset_sigma_mm"] = 1000 * pair.sigma;
    one["turn_deg"] = DegFromRad(pair.turn);
    one["agree"] = !pair.Disagrees();
    json.push_back(one);
  }
  return json;
}

void AddLenses(const PhotoAlignment& found, Json* images) {
  for (Json& one : *images) {
    const SparseImage* image = found.model.FindImage(one["name"].get<std::string>());
    const Camera& camera = found.model.cameras.at(image->camera_id);
    const PhotoAlignment::Lens& lens = found.lenses.at(image->image_id);
    one["camera_model"] = CameraModelName(camera.model);
    one["camera_params"] = camera.params;
    one["focal_length_from"] = FocalSourceName(lens.source);
    one["focal_length_sigma_px"] = NumberOrNull(lens.focal_sigma);
    one["radial_sigma"] = NumberOrNull(lens.radial_sigma);
  }
}

void NullWithoutModel(Report* report) {
  Report& r = *report;
  for (const char* key : {"scan_from_sparse", "scan_from_sparse_from_picks", "plane_bundle"}) {
    r[key] = nullptr;
  }
  r["scale"]["value"] = nullptr;
  r["mirrored"] = nullptr;
  r["reprojection_rms_px"]["before"] = nullptr;
  r["expected_error"]["at_far_corner_mm"] = nullptr;
  r["expected_error"]["far_corner"] = nullptr;
  r["expected_error"]["scale"] = nullptr;
  r["placement"] = nullptr;
}

}  // namespace roomtex
