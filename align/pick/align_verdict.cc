// What an alignment's report says, in plain words (align_job.h).

#include <cmath>

#include "align/pick/align_job.h"
#include "core/error.h"
#include "core/text.h"

namespace roomtex {
namespace {

// Of several models all picks, though `picks` is of the first that was placed.
double NumberOfPicks(const Json& report, const char* key) {
  if (!report.contains("models") || !report["models"].is_array()) {
    return NumberAt(report, {"picks", key});
  }
  double sum = 0;
  bool any = false;
  for (const Json& model : report["models"]) {
    const double number = NumberAt(model, {"picks", key});
    any |= std::isfinite(number);
    if (std::isfinite(number)) sum += number;
  }
  return any ? sum : std::nan("");
}

class FactList {
 public:
  explicit FactList(AlignVerdict* verdict) : verdict_(verdict) {}
  void Add(const std::string& name, double value, const std::string& text) {
    if (std::isfinite(value)) verdict_->facts.emplace_back(name, text);
  }

 private:
  AlignVerdict* verdict_;
};

void AddFacts(const Json& report, AlignVerdict* verdict) {
  FactList facts(verdict);
  const double at_cameras = NumberAt(report, {"expected_error", "at_cameras_mm"});
  facts.Add("Expected error at the photos", at_cameras, Millimetres(at_cameras));
  const double at_corner = NumberAt(report, {"expected_error", "at_far_corner_mm"});
  facts.Add("Expected error at the scan's far corner", at_corner, Millimetres(at_corner));
  const double count = NumberOfPicks(report, "count");
  const double used = NumberOfPicks(report, "num_used");
  const double rms_px = NumberAt(report, {"picks", "rms_px"});
  if (count > 0) facts.Add("Picks used", count, Number(used, 0) + " of " + Number(count, 0));
  facts.Add("Picks miss by (rms)", rms_px, Number(rms_px, 2) + " px");
  const double refined_px = NumberAt(report, {"picks", "refined_rms_px"});
  facts.Add("The same after the refinement", refined_px, Number(refined_px, 2) + " px");
  const double scale = NumberAt(report, {"scale", "value"});
  facts.Add("Scale", scale, Number(scale, 5) + " m per unit of the sparse model");
  const double features = NumberAt(report, {"scale", "num_features"});
  if (features > 0) facts.Add("Features that fix the scale", features, Number(features, 0));
  const double share = NumberAt(report, {"placement", "surface_share"});
  facts.Add("Sparse points on the scan's surface", share, Percent(share));
  const double rms = NumberAt(report, {"plane_rms_m", "after"});
  facts.Add("Their distance from it (rms)", rms, Millimetres(1000 * rms));
  const double before = NumberAt(report, {"reprojection_rms_px", "before"});
  const double after = NumberAt(report, {"reprojection_rms_px", "after"});
  if (std::isfinite(before)) {  // not of photos without a sparse model
    facts.Add("Reprojection error, before and after", after,
              Number(before, 2) + " and " + Number(after, 2) + " px");
  }
  const double agreement = NumberAt(report, {"agreement", "gradient_shift", "share"});
  const double chance = NumberAt(report, {"agreement", "gradient_shift", "chance", "share"});
  facts.Add("Photos and scan intensity agree", agreement,
            Percent(agreement) + " of the places looked at (by chance " + Percent(chance) + ")");
}

// Of several models those that are not trusted are left out: how many photos are placed, and of how
// many; "" = all.
std::string PlacedPhotos(const Json& report) {
  if (!report.contains("models") || !report["models"].is_array()) return "";
  int num_placed = 0, num_photos = 0;
  for (const Json& model : report["models"]) {
    const double num_images = NumberAt(model, {"num_images"});
    if (!std::isfinite(num_images)) return "";
    num_photos += static_cast<int>(num_images);
    if (model.value("joined", false)) num_placed += static_cast<int>(num_images);
  }
  if (num_placed == num_photos) return "";
  return std::to_string(num_placed) + " of " + std::to_string(num_photos) + " photos";
}

void AddWarnings(const Json& report, AlignVerdict* verdict) {
  if (!report.contains("warnings") || !report["warnings"].is_array()) return;
  for (const Json& warning : report["warnings"]) {
    if (warning.is_string()) verdict->sentences.push_back(warning.get<std::string>());
  }
}

}  // namespace

AlignVerdict JudgeRun(int exit_code, const Json& report, const std::vector<std::string>& errors) {
  AlignVerdict verdict;
  const bool ran = exit_code == kExitDone || exit_code == kExitUntrusted;
  if (!ran) {
    verdict.verdict = "failed";
    verdict.headline = exit_code == kExitInput   ? "The input cannot be aligned."
                       : exit_code == kExitUsage ? "roomtex-align cannot be run like this."
                       : exit_code >= 128        ? "roomtex-align was killed."
                                                 : "roomtex-align failed.";
    verdict.sentences = errors;
    return verdict;
  }
  const bool has_report = report.is_object();
  if (exit_code == kExitDone) {
    const double mm = NumberAt(report, {"expected_error", "at_cameras_mm"});
    verdict.verdict = "trusted";
    verdict.headline = "Trusted.";
    if (std::isfinite(mm)) {
      const std::string placed = has_report ? PlacedPhotos(report) : "";
      verdict.headline = "Trusted: " + (placed.empty() ? "the photos" : placed) +
                         " are placed to about " + Millimetres(mm) + ".";
    }
  } else {
    verdict.verdict = "untrusted";
    const bool has_model = has_report && report.contains("images") && report["images"].is_array();
    const bool searched = has_report && report.contains("search") && report["search"].is_object();
    verdict.headline = has_model  ? "Not to be trusted: look at the reasons before you use it."
                       : searched ? "There is no alignment: the search found no place."
                                  : "There is no alignment: the picks contradict the scan or each "
                                    "other.";
    if (has_report && report.contains("reason") && report["reason"].is_string()) {
      verdict.sentences.push_back(report["reason"].get<std::string>());
    } else {
      verdict.sentences = errors;
    }
  }
  if (!has_report) return verdict;
  AddWarnings(report, &verdict);
  AddFacts(report, &verdict);
  return verdict;
}

}  // namespace roomtex
