#include "colmap_ext/mapping_report.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include <fmt/core.h>

#include "colmap_ext/photo_groups.h"

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

struct PlaceOfPhoto {
  size_t model = 0;
  const MappedModel* mapped = nullptr;  // none: it is not registered
};

PlaceOfPhoto FindPhoto(const std::vector<MappedModel>& models, uint32_t image_id) {
  for (size_t i = 0; i < models.size(); ++i) {
    if (models[i].result->model.images.count(image_id) > 0) return {i, &models[i]};
  }
  return {};
}

// Why a photo is not in the first model.
std::string ReasonOf(uint32_t image_id, const PlaceOfPhoto& place,
                     const std::vector<MappingPass>& passes) {
  if (place.mapped != nullptr) {
    const std::string where = ": it is in model " + std::to_string(place.model);
    return (place.mapped->is_room ? "shows another room that is alike"
                                  : "too little connects it to model 0") +
           where;
  }
  bool is_of_a_group = false;
  for (const MappingPass& pass : passes) {
    const auto& reasons = pass.best[0].reasons;
    const auto reason = reasons.find(image_id);
    if (reason != reasons.end()) return reason->second;
    is_of_a_group |= pass.images->images().count(image_id) > 0;
  }
  return is_of_a_group ? "too few points of the model for colmap mapper, and --Chain.enabled 0"
                       : "too few photos are connected with it, or no model came of them";
}

// How a photo was registered, or why it was not.
Json ImageJson(const DatabaseImage& image, const std::vector<MappingPass>& passes,
               const std::vector<MappedModel>& models, const MatchedImages& images) {
  const uint32_t image_id = image.image_id;
  const MappingOutcome& outcome = passes[0].best[0];
  const PlaceOfPhoto place = FindPhoto(models, image_id);
  const bool registered = place.mapped != nullptr && place.model == 0;
  const auto chained = outcome.chained.find(image_id);
  Json json;
  json["name"] = image.name;
  json["registered"] = registered;
  json["by"] = !registered                                                 ? "none"
               : chained != outcome.chained.end()                          ? "chained"
               : outcome.known && outcome.known->added.count(image_id) > 0 ? "known"
               : outcome.seed.poses.images.count(image_id) > 0             ? "seed"
                                                                           : "mapper";
  if (registered && chained != outcome.chained.end()) {
    json["neighbor"] = images.images().at(chained->second.neighbor_id).name;
    json["num_common_points"] = chained->second.num_common_points;
    json["scale_spread"] = chained->second.scale_spread;
  }
  if (!registered) json["reason"] = ReasonOf(image_id, place, passes);
  json["model"] = place.mapped == nullptr ? Json() : Json(place.model);
  if (place.mapped != nullptr) {
    const auto support = place.mapped->check->support.find(image_id);
    if (support != place.mapped->check->support.end()) json["match_support"] = support->second;
  }
  return json;
}

Json NamesOf(const SparseModel& model) {
  Json names = Json::array();
  for (const auto& [id, image] : model.images) names.push_back(image.name);
  return names;
}

Json ModelJson(const MappedModel& model) {
  Json json;
  json["num_reg_images"] = model.result->model.images.size();
  json["num_points"] = model.result->model.points.size();
  json["mean_reprojection_error_px"] = model.result->mean_reprojection_error_px;
  json["refined_intrinsics"] = model.pass->refine;
  json["is_alike"] = model.IsAlike();
  json["images"] = NamesOf(model.result->model);
  return json;
}

void AddLenses(const MappingPass& pass, Report* report) {
  (*report)["cameras"] = Json::array();
  for (const LensFinding& lens : pass.lenses.lenses) {
    (*report)["cameras"].push_back(LensToJson(lens));
  }
}

}  // namespace

void FillMappingReport(const std::vector<MappingPass>& passes, const MatchedImages& images,
                       Report* report) {
  const std::vector<MappedModel> models = ListModels(passes);
  const MappingPass& pass = passes[0];
  const MappingOutcome& outcome = pass.best[0];
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
    for (const MapperResult* of_room : outcome.Models()) {
      rooms["models"].push_back(
          {{"num_points", of_room->model.points.size()}, {"images", NamesOf(of_room->model)}});
    }
    r["rooms"] = rooms;
  }
  r["is_alike"] = models[0].IsAlike();
  r["refined_intrinsics"] = pass.refine;
  AddLenses(pass, report);
  if (models.size() > 1) {
    r["models"] = Json::array();
    for (const MappedModel& one : models) r["models"].push_back(ModelJson(one));
  }
  r["images"] = Json::array();
  for (const auto& [image_id, image] : images.images()) {
    r["images"].push_back(ImageJson(image, passes, models, images));
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
  constexpr size_t kNumShown = 4;
  std::set<uint32_t> all;
  for (const auto& [image_id, image] : images.images()) all.insert(image_id);
  const std::vector<std::set<uint32_t>> groups = ConnectedPhotos(images, all, kFewestOfModel);
  if (groups.size() < 2) return "";
  std::string list;
  for (size_t i = 0; i < std::min(groups.size(), kNumShown); ++i) {
    list += fmt::format("{}{} photos (e.g. {})", i == 0 ? "" : ", ", groups[i].size(),
                        images.images().at(*groups[i].begin()).name);
  }
  if (groups.size() > kNumShown) list += fmt::format(" and {} more", groups.size() - kNumShown);
  return fmt::format(
      "Verified matches connect the photos in {} groups that nothing connects to each other: {}. "
      "Only one of them is in the model.",
      groups.size(), list);
}

}  // namespace roomtex
