#include "align/command/search_report.h"

#include <cmath>

namespace roomtex {
namespace {

// Of photos that were placed alone, at most so many were wrong (95 %; docs/automatic.md); without
// one there is no answer that could be right.
constexpr double kChanceFoundPhoto = 0.02, kChanceNone = 1;

Json SightsToJson(const SightAgreement& sights) {
  Json json;
  json["score"] = sights.Score();
  json["agreeing_share"] = sights.Share();
  json["through_share"] = sights.ThroughShare();
  json["num_judged"] = sights.NumJudged();
  json["num_unseen"] = sights.num_unseen;
  return json;
}

Json PhotosToJson(const GradientAgreement& gradient) {
  const GradientShifts& shifts = gradient.shifts;
  Json json;
  json["num_patches"] = shifts.at_pose.num;
  json["share"] = shifts.at_pose.num > 0 ? Json(shifts.at_pose.Share()) : Json(nullptr);
  json["chance"] = shifts.elsewhere.num > 0 ? Json(shifts.elsewhere.Share()) : Json(nullptr);
  json["far_poses"] = shifts.far.num > 0 ? Json(shifts.far.Share()) : Json(nullptr);
  json["supports"] = gradient.supports;
  json["contradicts"] = gradient.contradicts;
  return json;
}

Json StartToJson(const AutomaticAlignment& found, int index) {
  const FittedStart& start = found.search.starts[index];
  Json json;
  json["scan_from_sparse"] = ToJson(start.scan_from_sparse);
  json["photos_middle"] = ToJson(PhotosMiddle(found.search, index));
  json["settled"] = start.settled;
  json["correlation"] = start.score;
  json["num_on_surface"] = start.num_on_surface;
  json["surface_rms_m"] = start.rms;
  json["rays"] = SightsToJson(start.sights);
  json["photos"] = start.photos ? PhotosToJson(*start.photos) : Json(nullptr);
  json["looks_alike"] = start.looks_alike;
  return json;
}

// The best place by appearance, and how many cells of the scan the best and the next one have.
Json AppearanceToJson(const StartSearch& search) {
  if (!search.appearance) return nullptr;
  const std::vector<AppearancePlace>& places = search.appearance->places;
  Json json;
  json["num_cells"] = places.empty() ? 0 : places[0].num_cells;
  json["num_cells_second"] = places.size() < 2 ? 0 : places[1].num_cells;
  json["num_cells_apart"] = search.appearance->spread.num_apart;
  json["scan_from_sparse"] = places.empty() ? Json(nullptr) : ToJson(places[0].scan_from_sparse);
  return json;
}

// How many photos were each placed alone, and where those that agree put the model.
Json PlacedPhotosToJson(const StartSearch& search) {
  if (!search.placed_photos) return nullptr;
  const PlacedPhotoEvidence& evidence = *search.placed_photos;
  Json json;
  json["num_asked"] = evidence.num_asked;
  json["num_placed"] = evidence.num_placed;
  json["num_agreeing"] = evidence.num_agreeing;
  json["num_cells"] = evidence.spread.num_cells;
  json["num_cells_apart"] = evidence.spread.num_apart;
  json["scan_from_sparse"] =
      evidence.scan_from_sparse ? ToJson(*evidence.scan_from_sparse) : Json(nullptr);
  return json;
}

}  // namespace

Json SearchToJson(const AutomaticAlignment& found) {
  const StartVerdict& verdict = found.verdict;
  Json json;
  json["method"] = verdict.looks_alike ? "geometry and appearance" : "geometry";
  json["num_hypotheses"] = found.search.num_hypotheses;
  json["up_known"] = found.search.up_known;
  json["verdict"] = NameOf(verdict.kind);
  json["best"] = verdict.best < 0 ? Json(nullptr) : StartToJson(found, verdict.best);
  json["second"] = verdict.second < 0 ? Json(nullptr) : StartToJson(found, verdict.second);
  json["ratio"] = verdict.ratio;
  json["mirrored_score"] = verdict.mirrored_score;
  json["appearance"] = AppearanceToJson(found.search);
  json["placed_photos"] = PlacedPhotosToJson(found.search);
  json["agreement"] = verdict.looks_alike || verdict.support != PhotoSupport::kNone;
  json["chance_wrong"] = verdict.chance_wrong;
  json["chance_counted"] = verdict.chance_counted;
  json["hint_decides"] = verdict.hint_decides;
  json["hypotheses"] = Json::array();
  for (size_t i = 0; i < found.search.starts.size(); ++i) {
    json["hypotheses"].push_back(StartToJson(found, static_cast<int>(i)));
  }
  return json;
}

Json FoundPhotosToJson(const FoundPhotos& found) {
  Json json;
  json["method"] = "appearance of each photo";
  json["num_hypotheses"] = found.num_places;
  // Each photo has its own.
  json["best"] = json["second"] = nullptr;
  json["agreement"] = !found.views.empty();
  json["chance_wrong"] = found.views.empty() ? kChanceNone : kChanceFoundPhoto;
  json["chance_counted"] = !found.views.empty();
  json["photos"] = Json::array();
  for (const PhotoEvidence& photo : found.photos) {
    Json one;
    one["name"] = photo.image_name;
    one["num_cells"] = photo.num_cells;
    one["num_cells_second"] = photo.num_cells_second;
    one["share"] = photo.share;
    one["placed"] = photo.problem.empty();
    json["photos"].push_back(one);
  }
  return json;
}

}  // namespace roomtex
