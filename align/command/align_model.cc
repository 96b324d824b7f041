#include "align/command/align_model.h"

#include <algorithm>
#include <iterator>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "align/automatic_alignment.h"
#include "align/command/align_outputs.h"
#include "align/command/one_model.h"
#include "align/surface/scan_planes_report.h"
#include "colmap_ext/model_join.h"
#include "core/commit_together.h"
#include "core/error.h"
#include "core/scan.h"
#include "core/text.h"

namespace roomtex {
namespace {

// One of several models, and what became of it.
struct Attempt {
  std::string path;
  size_t num_images = 0;
  bool is_alike = false;  // MapperVerdict's
  Report report;
  std::string refusal;
  std::string azimuth;  // of the scans that it was put into, as they were read then
  std::optional<AlignedModel> aligned;

  bool trusted() const { return aligned.has_value() && report.trusted(); }
  std::string Problem() const { return aligned ? report.reason() : refusal; }
};

// Picks belong to the models that hold their photo, and so does a hint. Throws InputError for a
// pick whose photo no model holds, or several under other names, and for such a hint.
void GiveOut(const AlignCommandOptions& a, std::vector<ModelToAlign>* models) {
  std::vector<Pick> picks = a.picks_path.empty() ? std::vector<Pick>() : ReadPicks(a.picks_path);
  std::vector<const SparseModel*> all;
  for (const ModelToAlign& one : *models) all.push_back(&one.model);
  NamePicksAsInModels(all, &picks);
  if (models->size() == 1) {
    (*models)[0].picks = std::move(picks);
    return;
  }
  CheckPickNames(a.picks_path, picks, all, "in any of the sparse models");
  for (ModelToAlign& one : *models) {
    std::copy_if(
        picks.begin(), picks.end(), std::back_inserter(one.picks),
        [&one](const Pick& pick) { return one.model.FindImage(pick.image_name) != nullptr; });
    if (one.picks.empty()) one.options.picks_path.clear();
  }
  if (a.near.empty()) return;
  const NearHint near = ParseNearHint(a.near);
  CheckPhotoName("--near", near.image_name, PhotoNames(all), "in any of the sparse models");
  for (ModelToAlign& one : *models) {
    if (one.model.FindImage(near.image_name) == nullptr) one.options.near.clear();
  }
}

std::vector<ModelToAlign> ReadModels(const AlignCommandOptions& a,
                                     const Command::Context& context) {
  std::vector<ModelToAlign> models;
  bool any_known = false;
  for (const std::string& path : a.input_paths) {
    AlignCommandOptions own = a;
    own.input_path = path;
    models.push_back(ReadModelToAlign(own, context));
    const MapperVerdict& verdict = models.back().verdict;
    any_known |= verdict.known_rms || !verdict.told_poses.empty();
  }
  if (!any_known) RequirePicksOrPhotos(a);
  GiveOut(a, &models);
  for (ModelToAlign& one : models) {
    // Of one model alone this is an error; the others may have what they need.
    if (models.size() > 1 && a.image_path.empty() && !one.picks.empty() && AreHints(one.picks)) {
      context.Warn(fmt::format(
          "{} of the picks are in photos of {}, which are too few to place it, and without "
          "--image_path nothing confirms them: they are left out.",
          one.picks.size(), one.options.input_path));
      one.picks.clear();
      one.options.picks_path.clear();
    }
    one.near = ReadHints(one.options, one.picks, one.model, context);
  }
  std::vector<const SparseModel*> all;
  for (const ModelToAlign& one : models) all.push_back(&one.model);
  const std::set<std::string> told = LookForPhotos(a, all, context);
  for (ModelToAlign& one : models) one.told = told;
  return models;
}

std::string ShortName(const Attempt& attempt) {
  return fmt::format("{} ({} photos)", attempt.path, attempt.num_images);
}

// Of the places where photos and scan can be compared, those that agree; none if nobody compared.
double AgreeingShare(const Attempt& attempt) {
  const Json& keys = attempt.report.keys();
  const Json agreement = keys.value("agreement", Json());
  if (!agreement.is_object()) return 0;
  const Json share = agreement["gradient_shift"].value("share", Json());
  return share.is_number() ? share.get<double>() : 0;
}

// Do most of the photos of b stand among those of a?
bool StandsAmong(const SparseModel& b, const SparseModel& a) {
  constexpr double kMargin = 0.5;  // metres
  Bounds among;
  for (const auto& [id, image] : a.images) {
    const Eigen::Vector3d centre = image.cam_from_model.TargetOriginInSource();
    among.min = among.min.cwiseMin(centre - Eigen::Vector3d::Constant(kMargin));
    among.max = among.max.cwiseMax(centre + Eigen::Vector3d::Constant(kMargin));
  }
  const auto num_inside = std::count_if(b.images.begin(), b.images.end(), [&](const auto& one) {
    const Eigen::Vector3d centre = one.second.cam_from_model.TargetOriginInSource();
    return (centre.array() >= among.min.array()).all() &&
           (centre.array() <= among.max.array()).all();
  });
  return 2 * num_inside > static_cast<long>(b.images.size());
}

// Of rooms that are alike only one stands in one place of the scan: the one whose photos show more
// of what the scan has there.
void DoubtRivals(std::vector<Attempt>* attempts) {
  std::vector<Attempt*> ranked;
  for (Attempt& attempt : *attempts) {
    if (attempt.trusted() && attempt.is_alike) ranked.push_back(&attempt);
  }
  std::stable_sort(ranked.begin(), ranked.end(), [](const Attempt* a, const Attempt* b) {
    return AgreeingShare(*a) > AgreeingShare(*b);
  });
  for (size_t i = 1; i < ranked.size(); ++i) {
    const SparseModel& model = ranked[i]->aligned->model;
    const auto rival = std::find_if(
        ranked.begin(), ranked.begin() + static_cast<long>(i), [&](const Attempt* other) {
          const SparseModel& there = other->aligned->model;
          return other->trusted() && (StandsAmong(model, there) || StandsAmong(there, model));
        });
    if (rival == ranked.begin() + static_cast<long>(i)) continue;
    ranked[i]->report.SetUntrusted(fmt::format(
        "it fits where {} lies, which shows a room that is alike, and {} of the places "
        "that can be compared agree with the scan, {} there.",
        (*rival)->path, Percent(AgreeingShare(*ranked[i])), Percent(AgreeingShare(**rival))));
  }
}

// Each by itself. A model that lies in the scan says how the scans are to be read; the others do
// not turn them any more.
std::vector<Attempt> AlignEach(std::vector<ModelToAlign> models, const Database* database,
                               ScanReading* reading, const Command::Context& context) {
  std::vector<Attempt> attempts(models.size());
  bool may_turn = true;
  for (size_t i = 0; i < models.size(); ++i) {
    Attempt& attempt = attempts[i];
    attempt.path = models[i].options.input_path;
    attempt.num_images = models[i].model.images.size();
    attempt.is_alike = models[i].verdict.is_alike;
    const bool is_strict = models[i].options.strict;
    context.progress.Finish();
    context.progress.Note(
        fmt::format("sparse model [{}/{}]: {}", i + 1, models.size(), ShortName(attempt)));
    const Command::Context own{context.options, context.progress, attempt.report};
    try {
      const bool turns = may_turn && MayTurn(models[i].options, *reading);
      attempt.aligned =
          AlignOne(std::move(models[i]), database, turns, reading, &attempt.refusal, own);
    } catch (const InputError& error) {
      if (is_strict) throw;
      attempt.refusal = error.what();
    } catch (const UsageError&) {  // RequirePicksOrPhotos()
      attempt.refusal =
          "none of the picks is in its photos, and without --image_path its place cannot be "
          "searched for";
    }
    attempt.azimuth = reading->azimuth();
    may_turn &= !attempt.trusted();
  }
  DoubtRivals(&attempts);
  return attempts;
}

// The one that the report is of: the first that is trusted, else the first that has a place in the
// scans as they are read now (a later one may have turned them, and was not trusted either).
const Attempt& MainOf(const std::vector<Attempt>& attempts, const std::string& azimuth) {
  const auto trusted = std::find_if(attempts.begin(), attempts.end(),
                                    [](const Attempt& attempt) { return attempt.trusted(); });
  if (trusted != attempts.end()) return *trusted;
  const auto placed = std::find_if(attempts.begin(), attempts.end(), [&](const Attempt& attempt) {
    return attempt.aligned.has_value() && attempt.azimuth == azimuth;
  });
  return placed != attempts.end() ? *placed : attempts[0];
}

// The report's `models`.
Json AttemptsToJson(const std::vector<Attempt>& attempts, const Attempt& main) {
  Json json = Json::array();
  for (const Attempt& attempt : attempts) {
    Json one = attempt.report.keys();
    for (const char* key : {"images", "planes"}) one.erase(key);
    one["input_path"] = attempt.path;
    one["num_images"] = attempt.num_images;
    one["trusted"] = attempt.trusted();
    one["reason"] = attempt.Problem();
    one["joined"] = attempt.trusted() || (&attempt == &main && attempt.aligned);
    json.push_back(one);
  }
  return json;
}

// Photos of the others beside those of the main one; of a photo in several models, the first
// counts.
SparseModel JoinTrusted(const std::vector<Attempt>& attempts, const Attempt& main, Json* images) {
  std::vector<const SparseModel*> models = {&main.aligned->model};
  std::set<std::string> names;
  for (const Json& image : *images) names.insert(image["name"].get<std::string>());
  for (const Attempt& attempt : attempts) {
    if (&attempt == &main || !attempt.trusted()) continue;
    models.push_back(&attempt.aligned->model);
    for (const Json& image : attempt.report.keys().at("images")) {
      if (names.insert(image["name"].get<std::string>()).second) images->push_back(image);
    }
  }
  return JoinModels(models);
}

// What is said of several models becomes the report of one.
void TakeOver(const std::vector<Attempt>& attempts, const Attempt& main,
              const Command::Context& context) {
  for (const auto& [key, value] : main.report.keys().items()) context.report[key] = value;
  context.report["models"] = AttemptsToJson(attempts, main);
  for (const Attempt& attempt : attempts) {
    for (const std::string& warning : attempt.report.warnings()) {
      context.report.AddWarning(attempt.path + ": " + warning);
    }
  }
  if (!main.trusted()) {
    // Without a place WriteRefusal() says it.
    if (main.aligned) context.report.SetUntrusted(ShortName(main) + ": " + main.Problem());
    return;
  }
  for (const Attempt& attempt : attempts) {
    if (attempt.trusted()) continue;
    context.Warn(ShortName(attempt) + " is left out, not to be trusted: " + attempt.Problem());
  }
}

}  // namespace

void AlignModel(const AlignCommandOptions& a, const Command::Context& context) {
  context.progress.Stage("read model");
  // Opened now: what is no database is said before anything takes long.
  std::optional<Database> database;
  if (!a.database_path.empty()) database.emplace(a.database_path);
  const Database* const matches = database ? &*database : nullptr;
  std::vector<ModelToAlign> models = ReadModels(a, context);
  context.progress.Stage("read scan");
  ScanReading reading(a, context);
  for (ModelToAlign& one : models) MoveToLocal(reading, &one);
  std::set<std::string> told;
  for (const ModelToAlign& one : models) told.insert(one.told.begin(), one.told.end());

  std::string refusal;
  std::optional<AlignedModel> aligned;
  if (models.size() == 1) {
    const bool may_turn = MayTurn(a, reading);
    aligned = AlignOne(std::move(models[0]), matches, may_turn, &reading, &refusal, context);
  } else {
    std::vector<Attempt> attempts = AlignEach(std::move(models), matches, &reading, context);
    const Attempt& main = MainOf(attempts, reading.azimuth());
    refusal = ShortName(main) + ": " + main.refusal;
    TakeOver(attempts, main, context);
    if (main.aligned) {
      aligned = *main.aligned;
      aligned->model = JoinTrusted(attempts, main, &context.report["images"]);
      aligned->row_motions.clear();  // by the images' numbers before
    }
  }
  WritePlanes(a, reading, context);
  if (!aligned) return WriteRefusal(a, refusal, reading, context);
  WriteAligned(a, std::move(aligned->model), aligned->row_motions, aligned->local_from_sparse,
               &reading, told, context);
}

}  // namespace roomtex
