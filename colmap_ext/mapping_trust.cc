#include "colmap_ext/mapping_trust.h"

#include <algorithm>
#include <set>
#include <string>

#include <fmt/core.h>

#include "colmap_ext/calibration_check.h"
#include "colmap_ext/mapping_report.h"
#include "colmap_ext/model_check.h"
#include "core/text.h"

namespace roomtex {
namespace {

// about: what roomtex-align goes by when it reads this (mapper_verdict.h).
void Refuse(const std::string& about, const std::string& reason, Json* reasons) {
  reasons->push_back({{"about", about}, {"reason", reason}});
}

// Of all models together.
void JudgeNumber(const std::vector<MappedModel>& models, const MatchedImages& images,
                 const Command::Context& context, Json* reasons) {
  size_t num_registered = 0, num_groups = 0;
  for (const MappedModel& model : models) {
    num_registered += model.result->model.images.size();
    num_groups += !model.is_room;
  }
  const std::string groups = num_groups > 1 ? "" : SeparateGroupsSentence(images);
  if (2 * num_registered < images.images().size()) {
    Refuse("photos",
           fmt::format("only {} of {} photos could be registered. {}", num_registered,
                       images.images().size(),
                       groups.empty() ? "Take more photos between those that are missing, or match "
                                        "them more thoroughly."
                                      : groups),
           reasons);
  } else if (!groups.empty()) {
    context.Warn(groups);
  }
}

// What becomes of a model beside photos with known poses. whose: "" or of which model, in front of
// warnings.
void JudgeKnown(const MappingOutcome& outcome, const KnownPhotos& known,
                const MatchedImages& images, const std::string& whose,
                const Command::Context& context, ModelTrust* trust) {
  if (!outcome.known) return;
  const KnownPlacement& placement = *outcome.known;
  const KnownFit& fit = placement.fit;
  const auto warn = [&](const std::string& warning) { context.Warn(whose + warning); };
  trust->known = KnownToJson(placement, known, images.images());
  const char by_scan[] =
      " The model keeps a frame of its own; roomtex-align puts it into the scan by what the scan "
      "shows in these photos.";
  switch (fit.kind) {
    case KnownFit::Kind::kTooFew:
      warn(std::string("Fewer than two of the photos with known poses could be mapped.") + by_scan);
      return;
    case KnownFit::Kind::kOnePlace:
      warn(std::string("The photos with known poses stand too near each other to tell the "
                       "scale.") +
           by_scan);
      return;
    case KnownFit::Kind::kContradicts:
      Refuse("motion",
             "the known poses contradict the photos: no similarity brings more than half of them "
             "to where the photos were mapped. Check --known_path, or map without it.",
             &trust->reasons);
      return;
    case KnownFit::Kind::kPlaced:
      break;
  }
  const auto names = [&images](const std::set<uint32_t>& ids) {
    std::string list;
    for (const uint32_t id : ids) {
      list += (list.empty() ? "" : ", ") + images.images().at(id).name;
    }
    return list;
  };
  if (!fit.contradicting.empty()) {
    warn("Photos that were not taken where --known_path has them, as the others tell: " +
         names(fit.contradicting) + ". Their poses are those of their matches.");
  }
  if (placement.held) {
    if (placement.rough.empty()) return;
    warn("Known poses that are not exact enough to be held, and were adjusted: " +
         names(placement.rough));
    return;
  }
  warn(
      "The known poses are not exact enough to be held: most of the photos would lose most of "
      "their "
      "points, or the keypoints fit much worse. The model was moved to them, and no more.");
}

// What a model's own photos say against it, the third-view test on pairs that it was not started
// from among it.
void JudgeByOwnPhotos(const ModelCheck& check, const MatchedImages& images, ModelTrust* trust) {
  const auto name_of = [&](uint32_t image_id) { return images.images().at(image_id).name; };
  trust->check["num_pairs"] = check.num_pairs;
  trust->check["contradicting"] = Json::array();
  for (const auto& [image_id1, image_id2] : check.contradicting) {
    trust->check["contradicting"].push_back({name_of(image_id1), name_of(image_id2)});
  }
  trust->check["doubtful_images"] = Json::array();
  std::string doubtful;
  for (const uint32_t image_id : check.doubtful) {
    trust->check["doubtful_images"].push_back(name_of(image_id));
    doubtful += (doubtful.empty() ? "" : ", ") + name_of(image_id) + " (" +
                Percent(check.support.at(image_id)) + ")";
  }
  if (!check.doubtful.empty()) {
    Refuse("photos",
           "photos stand where most of their own matches do not put them: " + doubtful +
               " of the matches obey the model. Take these photos out (they may show a "
               "repeated pattern, or something that moved) and map again.",
           &trust->reasons);
  }
  const size_t num_contradicting = check.contradicting.size();
  if (static_cast<double>(num_contradicting) >
      ModelCheckOptions().max_contradicting * check.num_pairs) {
    const auto& [image_id1, image_id2] = check.contradicting.front();
    Refuse("motion",
           fmt::format("the model is contradicted by its own photos: for {} of {} pairs, "
                       "e.g. {} and {}, a third photo supports another camera motion. "
                       "Start from another pair (--Init.image_name1), or add photos that "
                       "show something off the wall.",
                       num_contradicting, check.num_pairs, name_of(image_id1), name_of(image_id2)),
           &trust->reasons);
  }
}

// A camera of a model that COLMAP's OPENCV would describe better.
bool HasPlainLens(const SparseModel& model) {
  return std::any_of(model.cameras.begin(), model.cameras.end(), [](const auto& one) {
    const CameraModel kind = one.second.model;
    return kind == CameraModel::kSimplePinhole || kind == CameraModel::kPinhole ||
           kind == CameraModel::kSimpleRadial || kind == CameraModel::kRadial;
  });
}

// What to do about a lens that does not fit. refine: what the user asked for.
std::string LensRemedy(const MappingPass& pass, RefineIntrinsics refine) {
  if (!pass.refine && refine == RefineIntrinsics::kNever) {
    return "Calibrate the camera, or give --refine_intrinsics auto.";
  }
  if (!pass.refine) {
    return "Calibrate the camera (roomtex-calibrate), or add photos from more places; "
           "--refine_intrinsics 1 takes the lens that these photos ask for.";
  }
  return HasPlainLens(pass.model())
             ? "Extract the features with a camera model that can describe the lens "
               "(--ImageReader.camera_model OPENCV)."
             : "Calibrate the camera (roomtex-calibrate), or add photos from more places.";
}

// Whether the errors shrink when the lens may change.
Json JudgeLens(const MappingPass& pass, RefineIntrinsics refine, const Command::Context& context,
               Json* reasons) {
  context.progress.Stage("check calibration");
  const CalibrationCheck check =
      CheckCalibration(pass.model(), [&](const SparseModel& model, bool is_free) {
        ThrowIfInterrupted();
        return pass.mapper->BundleAdjust(model, is_free);
      });
  Json json;
  json["rms_fixed_px"] = check.rms_fixed_px;
  json["rms_free_px"] = check.rms_free_px;
  if (check.Fits()) return json;
  Refuse(
      "calibration",
      fmt::format("the camera's calibration does not fit the photos: their error falls from {:.2f} "
                  "to {:.2f} px "
                  "when focal length and distortion may change, so the model is bent. {}",
                  check.rms_fixed_px, check.rms_free_px, LensRemedy(pass, refine)),
      reasons);
  return json;
}

}  // namespace

std::vector<ModelTrust> JudgeModels(const std::vector<MappingPass>& passes,
                                    const MatchedImages& images, const KnownPhotos& known,
                                    RefineIntrinsics refine, const Command::Context& context) {
  const std::vector<MappedModel> models = ListModels(passes);
  std::vector<ModelTrust> trusts;
  Json of_all = Json::array(), of_pass, calibration;
  JudgeNumber(models, images, context, &of_all);
  for (const MappedModel& model : models) {
    const MappingOutcome& outcome = model.pass->best[0];
    if (!model.is_room) {
      of_pass = of_all;
      if (outcome.seed.ambiguous) {
        Refuse("motion", AmbiguousSentence(outcome.seed.trial, images), &of_pass);
      }
      calibration = JudgeLens(*model.pass, refine, context, &of_pass);
    }
    ModelTrust trust;
    trust.reasons = of_pass;
    JudgeByOwnPhotos(*model.check, images, &trust);
    trust.check["calibration"] = calibration;
    const std::string whose = trusts.empty() ? "" : "Model " + std::to_string(trusts.size()) + ": ";
    if (!model.is_room) JudgeKnown(outcome, known, images, whose, context, &trust);
    trusts.push_back(std::move(trust));
  }
  return trusts;
}

}  // namespace roomtex
