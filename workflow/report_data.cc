#include "workflow/report_data.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/child_program.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/text.h"
#include "workflow/search_evidence.h"

namespace roomtex {
namespace {

const Json& At(const Json& json, std::initializer_list<const char*> keys) {
  static const Json kNull;
  const Json* at = &json;
  for (const char* key : keys) {
    if (!at->is_object() || !at->contains(key)) return kNull;
    at = &(*at)[key];
  }
  return *at;
}

const StepOutcome* StepNamed(const RunResult& result, const std::string& name) {
  for (const StepOutcome& step : result.steps) {
    if (step.name == name && step.known) return &step;
  }
  return nullptr;
}

Json ReportOfStep(const RunResult& result, const std::string& name) {
  const StepOutcome* const step = StepNamed(result, name);
  return step == nullptr ? Json() : step->report;
}

class ReportMaker {
 public:
  ReportMaker(Chain* chain, const RunResult& result)
      : chain_(*chain),
        result_(result),
        mapper_(ReportOfStep(result, "mapper")),
        align_(ReportOfStep(result, "align")),
        texture_(ReportOfStep(result, "texture")) {}

  Json Keys() {
    Json keys;
    keys["verdict"] = Verdict();
    keys["remedies"] = Remedies();
    keys["facts"] = Facts();
    keys["notices"] = Notices();
    keys["searches"] = SearchEvidence(align_);
    keys["photos"] = Photos();
    keys["registration"] = At(texture_, {"registration", "applied"});
    keys["steps"] = Steps();
    keys["total"] = Total();
    keys["versions"] = {{"roomtex", Version()}};
    if (!chain_.OnlyScanner()) keys["versions"]["colmap"] = chain_.Colmap().version();
    keys["command_line"] = CommandText(chain_.AutoCommand());
    return keys;
  }

 private:
  // Of a whole run: roomtex-align has had its say.
  bool IsAccepted() const {
    return std::any_of(result_.steps.begin(), result_.steps.end(), [](const StepOutcome& step) {
      return step.known && step.name != "associate" && step.record.state == StepState::kUntrusted &&
             !IsLeftToAlign(step);
    });
  }

  bool HasOverruledMapper() const {
    return std::any_of(result_.steps.begin(), result_.steps.end(), [](const StepOutcome& step) {
      return step.known && step.record.state == StepState::kUntrusted && IsLeftToAlign(step);
    });
  }

  std::vector<std::string> Outdated() const {
    std::vector<std::string> sentences;
    for (const StepOutcome& step : result_.steps) {
      if (!step.outdated.empty()) {
        sentences.push_back("The step " + step.name + " was passed over, and what it left is not " +
                            "that of these photos, scans and options (" + step.outdated + ").");
      }
    }
    return sentences;
  }

  Json Verdict() const {
    Json verdict;
    std::vector<std::string> sentences;
    const Stop& stop = result_.stop;
    const double mm = NumberAt(align_, {"expected_error", "at_cameras_mm"});
    const double coverage = NumberAt(texture_, {"coverage"});
    if (stop.stopped) {
      const bool untrusted = stop.exit_code == kExitUntrusted;
      verdict["state"] = untrusted ? "untrusted" : "failed";
      verdict["headline"] =
          "Not finished: " + (untrusted ? Doubt(stop.step)
                                        : "the step " + stop.step +
                                              (stop.cannot_begin ? " cannot run yet" : " failed"));
      sentences.push_back(stop.reason);
    } else if (const std::vector<std::string> outdated = Outdated(); !outdated.empty()) {
      verdict["state"] = "unfinished";
      verdict["headline"] = "Not up to date: steps before were passed over that have to run again";
      sentences = outdated;
    } else if (!result_.whole) {
      verdict["state"] = "unfinished";
      verdict["headline"] = "Not finished: only some of the steps were asked for";
    } else if (IsAccepted()) {
      verdict["state"] = "untrusted";
      verdict["headline"] = "Finished, but not to be trusted";
      for (const StepOutcome& step : result_.steps) {
        if (step.known && !step.record.reason.empty()) {
          sentences.push_back(step.name + ": " + step.record.reason);
        }
      }
    } else {
      verdict["state"] = "trusted";
      verdict["headline"] = "The room is coloured, and the result can be trusted";
      if (chain_.OnlyScanner()) {
        verdict["headline"] = "The room is coloured by the scanner's own photos";
        sentences.emplace_back(
            "They stand where the scan's file has them, which nothing here has checked: look at "
            "the "
            "pictures.");
      }
      if (std::isfinite(mm)) {
        sentences.push_back("The photos stand in the scan to about " + Millimetres(mm) +
                            " (one standard deviation).");
      }
      if (std::isfinite(coverage)) {
        sentences.push_back(Percent(coverage) +
                            " of the scan's samples have a colour from a photo.");
      }
      if (HasOverruledMapper()) {
        sentences.emplace_back(
            "The step mapper alone was not sure of its model; roomtex-align, which knows the scan, "
            "is.");
      }
    }
    verdict["sentences"] = sentences;
    return verdict;
  }

  std::vector<std::string> Remedies() const {
    if (result_.stop.stopped || Outdated().empty()) return result_.stop.remedies;
    return {"Start again without --from and --only: what has not changed is not run again"};
  }

  static std::string Doubt(const std::string& step) {
    if (step == "mapper") return "it is not sure where the photos stand to each other";
    if (step == "align") return "it is not sure where the photos stand in the scan";
    return "the step " + step + " is not to be trusted";
  }

  void Fact(const std::string& name, double value, const std::string& text, Json* facts) const {
    if (std::isfinite(value)) facts->push_back({{"name", name}, {"value", text}});
  }

  Json Facts() const {
    Json facts = Json::array();
    double registered = NumberAt(mapper_, {"num_reg_images"});
    const Json& models = At(mapper_, {"models"});
    if (models.is_array()) {
      registered = 0;
      for (const Json& model : models) registered += NumberAt(model, {"num_reg_images"});
    }
    Fact("Photos registered", registered,
         Number(registered, 0) + " of " + Number(NumberAt(mapper_, {"num_images"}), 0), &facts);
    if (At(align_, {"models"}).is_array() && At(align_, {"images"}).is_array()) {
      const auto placed = static_cast<double>(At(align_, {"images"}).size());
      Fact("Photos placed in the scan", placed, Number(placed, 0) + " of " + Number(registered, 0),
           &facts);
    }
    const double mm = NumberAt(align_, {"expected_error", "at_cameras_mm"});
    Fact("Expected error at the photos", mm, Millimetres(mm), &facts);
    const double corner = NumberAt(align_, {"expected_error", "at_far_corner_mm"});
    Fact("Expected error at the far corner", corner, Millimetres(corner), &facts);
    const double agree = NumberAt(align_, {"agreement", "gradient_shift", "share"});
    const double chance = NumberAt(align_, {"agreement", "gradient_shift", "chance", "share"});
    Fact("Photos agree with the scan's intensity", agree,
         "at " + Percent(agree) + " of the places (" + Percent(chance) + " by chance)", &facts);
    const double coverage = NumberAt(texture_, {"coverage"});
    Fact("Samples with colour", coverage, Percent(coverage), &facts);
    const double views = NumberAt(texture_, {"views_mean"});
    Fact("Photos that see a sample, mean", views, Number(views, 1), &facts);
    const double disagreement = NumberAt(texture_, {"disagreement", "after"});
    Fact("Photos disagree by", disagreement, Number(disagreement, 1) + " of 255 levels", &facts);
    const double error = NumberAt(mapper_, {"mean_reprojection_error_px"});
    Fact("Reprojection error", error, Number(error, 2) + " px", &facts);
    return facts;
  }

  Json Notices() const {
    Json notices = Json::array();
    for (const StepOutcome& step : result_.steps) {
      const Json& warnings = At(step.report, {"warnings"});
      if (!step.known || !warnings.is_array()) continue;
      for (const Json& warning : warnings) {
        notices.push_back({{"step", step.name}, {"text", warning}});
      }
    }
    return notices;
  }

  // One per photo that any step knew, by name.
  Json Photos() const {
    std::map<std::string, Json> photos;
    const Json& mapped = At(mapper_, {"images"});
    for (const Json& image : mapped.is_array() ? mapped : Json::array()) {
      Json& photo = photos[image.at("name")];
      photo["registered_by"] = image.value("by", "none");
      photo["model"] = image.value("model", Json());
      photo["match_support"] = image.contains("match_support") ? image["match_support"] : Json();
      if (image.contains("reason")) photo["left_out"] = image["reason"];
    }
    const Json& aligned = At(align_, {"images"});
    for (const Json& image : aligned.is_array() ? aligned : Json::array()) {
      Json& photo = photos[image.at("name")];
      photo["expected_error_mm"] = image.value("position_sigma_mm", Json());
      // Of another model, which was put into the scan, too.
      photo.erase("left_out");
      const Json model = photo.value("model", Json());
      if (model.is_number() && model != 0) {
        photo["registered_by"] = "model " + std::to_string(model.get<int>());
      }
    }
    if (At(align_, {"models"}).is_array()) {
      for (auto& [name, photo] : photos) {
        if (photo.value("model", Json()).is_number() && !photo.contains("expected_error_mm")) {
          photo["left_out"] = "its sparse model has no place in the scan that can be trusted";
        }
      }
    }
    for (const Json* report : {&align_, &texture_}) {
      const Json& left_out = At(*report, {"photos_left_out"});
      for (const Json& one : left_out.is_array() ? left_out : Json::array()) {
        photos[one.at("name")]["left_out"] = one.at("reason");
      }
    }
    const Json& told = At(texture_, {"exposure_gain"});
    const Json gains = told.is_object() ? told : Json::object();
    for (const auto& [name, gain] : gains.items()) {
      if (gain.is_number() && gain.get<double>() > 0) {
        photos[name]["exposure_ev"] = -std::log2(gain.get<double>());
      }
      photos[name]["samples_seen"] = At(texture_, {"samples_seen", name.c_str()});
    }
    AddWhatTextureFound(&photos);
    Json list = Json::array();
    for (const auto& [name, photo] : photos) {
      Json one = {{"name", name}};
      one.update(photo);
      list.push_back(one);
    }
    return list;
  }

  // How each photo lies on the others, and how sharp it is beside them.
  void AddWhatTextureFound(std::map<std::string, Json>* photos) const {
    const Json& images = At(texture_, {"images"});
    for (const Json& image : images.is_array() ? images : Json::array()) {
      Json& photo = (*photos)[image.at("name")];
      for (const char* key : {"shift_px", "shift_map_px", "row_turned_deg", "corrected"}) {
        photo[key] = image.value(key, Json());
      }
    }
    const Json& told = At(texture_, {"photo_sharpness"});
    const Json sharpness = told.is_object() ? told : Json::object();
    for (const auto& [name, one] : sharpness.items()) {
      Json& photo = (*photos)[name];
      photo["sharpness"] = one.value("sharpness", Json());
      photo["blurred"] = NumberAt(one, {"weight"}) < 1;
      photo["agreement"] = At(texture_, {"photo_agreement", name.c_str(), "correlation"});
    }
  }

  Json Steps() const {
    Json steps = Json::array();
    for (const StepOutcome& step : result_.steps) {
      if (!step.known) continue;
      Json json = {{"name", step.name},
                   {"does", step.does},
                   {"ran_now", step.ran},
                   {"outdated", step.outdated.empty() ? Json() : Json(step.outdated)}};
      json.update(RecordToJson(step.record));
      steps.push_back(json);
    }
    return steps;
  }

  Json Total() const {
    double seconds = 0, cpu_seconds = 0;
    long long memory = 0;
    for (const StepOutcome& step : result_.steps) {
      seconds += step.record.seconds;
      cpu_seconds += step.record.cpu_seconds;
      memory = std::max(memory, step.record.peak_memory_bytes);
    }
    return {{"seconds", seconds}, {"cpu_seconds", cpu_seconds}, {"peak_memory_bytes", memory}};
  }

  Chain& chain_;
  const RunResult& result_;
  const Json mapper_, align_, texture_;
};

}  // namespace

Json MakeReportKeys(Chain* chain, const RunResult& result) {
  return ReportMaker(chain, result).Keys();
}

}  // namespace roomtex
