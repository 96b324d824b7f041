#include "colmap_ext/mapping_report.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include <fmt/core.h>

#include "colmap_ext/view_graph.h"

namespace roomtex {

Json TrialJson(const PairTrial& trial, const MatchedImages& images, const std::string& outcome) {
  Json json;
  json["pair"] = {images.images().at(trial.image_id1).name,
                  images.images().at(trial.image_id2).name};
  json["num_matches"] = trial.num_matches;
  json["h_ratio"] = trial.analysis.h_ratio;
  json["num_hypotheses"] = trial.analysis.hypotheses.size();
  json["outcome"] = outcome;
  return json;
}

namespace {

// How a photo was registered, or why it was not.
Json ImageJson(const DatabaseImage& image, const MappingOutcome& outcome,
               const MatchedImages& images) {
  const bool registered = outcome.result.model.images.count(image.image_id) > 0;
  const auto chained = outcome.chained.find(image.image_id);
  Json json;
  json["name"] = image.name;
  json["registered"] = registered;
  json["by"] = !registered                                                       ? "none"
               : chained != outcome.chained.end()                                ? "chained"
               : outcome.known && outcome.known->added.count(image.image_id) > 0 ? "known"
               : outcome.seed.poses.images.count(image.image_id) > 0             ? "seed"
                                                                                 : "mapper";
  if (registered && chained != outcome.chained.end()) {
    json["neighbor"] = images.images().at(chained->second.neighbor_id).name;
    json["num_common_points"] = chained->second.num_common_points;
    json["scale_spread"] = chained->second.scale_spread;
  }
  if (!registered) {
    const auto reason = outcome.reasons.find(image.image_id);
    json["reason"] = reason != outcome.reasons.end()
                         ? reason->second
                         : "too few points of the model for colmap mapper, and --Chain.enabled 0";
  }
  return json;
}

std::vector<const SparseModel*> ModelsOfRooms(const MappingOutcome& outcome) {
  std::vector<const SparseModel*> models = {&outcome.result.model};
  for (const MapperResult& room : outcome.other_rooms) models.push_back(&room.model);
  return models;
}

}  // namespace

void FillMappingReport(const MappingOutcome& outcome, const MatchedImages& images, Report* report) {
  const PairTrial& trial = outcome.seed.trial;
  const SparseModel& model = outcome.result.model;
  Report& r = *report;
  r["pair"] = {images.images().at(trial.image_id1).name, images.images().at(trial.image_id2).name};
  r["num_f_inliers"] = trial.analysis.num_f_inliers;
  r["num_h_inliers"] = trial.analysis.num_h_inliers;
  r["h_ratio"] = trial.analysis.h_ratio;
  r["degenerate"] = trial.analysis.degenerate;
  r["num_points"] = model.points.size();
  r["num_reg_images"] = model.images.size();
  r["num_images"] = images.images().size();
  r["mean_reprojection_error_px"] = outcome.result.mean_reprojection_error_px;
  const ThirdViewDecision& decision = trial.decision;
  const TwoViewHypothesis& chosen = trial.analysis.hypotheses[decision.best];
  Json init;
  init["num_matches"] = trial.num_matches;
  init["num_points"] = outcome.seed.pair_model.points.size();
  init["origin"] = chosen.origin;
  init["median_angle_deg"] = chosen.median_angle_deg;
  init["num_off_plane"] = trial.analysis.num_off_plane;
  init["num_third_views"] = decision.num_views;
  init["num_hypotheses"] = trial.analysis.hypotheses.size();
  // null: there was no second hypothesis to compare with.
  init["confidence"] = std::isfinite(decision.confidence) ? Json(decision.confidence) : Json();
  init["seed_images"] = Json::array();
  for (const auto& [image_id, image] : outcome.seed.poses.images) {
    init["seed_images"].push_back(image.name);
  }
  r["init"] = init;
  if (!outcome.other_rooms.empty()) {
    Json rooms;
    rooms["share_within"] = outcome.share_within;
    rooms["share_between"] = outcome.share_between;
    rooms["models"] = Json::array();
    for (const SparseModel* of_room : ModelsOfRooms(outcome)) {
      Json one;
      one["num_points"] = of_room->points.size();
      one["images"] = Json::array();
      for (const auto& [id, image] : of_room->images) one["images"].push_back(image.name);
      rooms["models"].push_back(one);
    }
    r["rooms"] = rooms;
  }
  r["images"] = Json::array();
  for (const auto& [image_id, image] : images.images()) {
    r["images"].push_back(ImageJson(image, outcome, images));
  }
}

std::string AmbiguousSentence(const PairTrial& trial, const MatchedImages& images) {
  const std::string name1 = images.images().at(trial.image_id1).name,
                    name2 = images.images().at(trial.image_id2).name;
  const std::string cure =
      " Add a photo that overlaps both, taken from another place (not in one "
      "line with them), best with something that stands off the wall.";
  if (trial.decision.num_views == 0) {
    return "planar-ambiguous: " + name1 + " and " + name2 +
           " show (almost) one plane, which allows two camera motions, and no third photo sees "
           "enough of what both see to tell which one is right." +
           cure;
  }
  return fmt::format(
      "planar-ambiguous: two camera motions explain {} and {} about equally well (ratio {:.2f}, {} "
      "third views), as happens before a wall.{}",
      name1, name2, trial.decision.confidence, trial.decision.num_views, cure);
}

std::string SeparateGroupsSentence(const MatchedImages& images) {
  constexpr size_t kFewest = 4;  // photos, to be called a group
  constexpr size_t kNumShown = 4;
  std::vector<const DatabaseImage*> photos;
  std::map<uint32_t, int> place;
  for (const auto& [image_id, image] : images.images()) {
    place[image_id] = static_cast<int>(photos.size());
    photos.push_back(&image);
  }
  DisjointSets sets(static_cast<int>(photos.size()));
  for (const DatabasePair& pair : images.pairs()) {
    sets.Join(place.at(pair.image_id1), place.at(pair.image_id2));
  }
  std::vector<std::vector<int>> groups = sets.Groups();
  groups.erase(std::remove_if(groups.begin(), groups.end(),
                              [](const std::vector<int>& group) { return group.size() < kFewest; }),
               groups.end());
  if (groups.size() < 2) return "";
  std::string list;
  for (size_t i = 0; i < std::min(groups.size(), kNumShown); ++i) {
    list += fmt::format("{}{} photos (e.g. {})", i == 0 ? "" : ", ", groups[i].size(),
                        photos[groups[i][0]]->name);
  }
  if (groups.size() > kNumShown) list += fmt::format(" and {} more", groups.size() - kNumShown);
  return fmt::format(
      "Verified matches connect the photos in {} groups that nothing connects to each other: {}. A "
      "model holds one of them: map each room's photos by themselves, or take and match photos "
      "between.",
      groups.size(), list);
}

}  // namespace roomtex
