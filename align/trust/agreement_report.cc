#include "align/trust/agreement_report.h"

#include <optional>

namespace roomtex {
namespace {

void AddMeasures(const ImageMeasures& measures, Json* json) {
  (*json)["mutual_information"] = measures.mutual_information;
  (*json)["chi_square"] = measures.chi_square;
  (*json)["patch_ncc"] = measures.patch_ncc;
}

Json ShareToJson(const Tally& tally) {
  Json json;
  json["num_patches"] = tally.num;
  json["share"] = tally.num > 0 ? Json(tally.Share()) : Json(nullptr);
  json["share_low"] = tally.Low(1.96);  // 95 % interval
  json["share_high"] = tally.High(1.96);
  return json;
}

Json GradientAgreementToJson(const GradientAgreement& gradient,
                             const GradientShiftOptions& options) {
  const GradientShifts& shifts = gradient.shifts;
  Json json = ShareToJson(shifts.at_pose);
  const bool any = shifts.at_pose.num > 0;
  json["num_photos"] = shifts.num_photos;
  json["num_unclear_photos"] = shifts.num_unclear_photos;
  json["tolerance_deg"] = any ? Json(shifts.tolerance_deg) : Json(nullptr);
  json["median_shift_px"] = any ? Json(gradient.median_shift_px) : Json(nullptr);
  json["median_shift_deg"] = any ? Json(gradient.median_shift_deg) : Json(nullptr);
  json["chance"] = ShareToJson(shifts.elsewhere);
  json["far_poses"] = ShareToJson(shifts.far);
  json["turned"] = Json::array();
  for (size_t k = 0; k < shifts.turned.size(); ++k) {
    Json one = ShareToJson(shifts.turned[k]);
    one["turn_deg"] = options.turns_deg[k];
    json["turned"].push_back(one);
  }
  json["moved"] = Json::array();
  for (size_t k = 0; k < shifts.moved.size(); ++k) {
    Json one = ShareToJson(shifts.moved[k]);
    one["move_m"] = options.moves[k];
    json["moved"].push_back(one);
  }
  const std::optional<double> shown = shifts.ShownShare();
  json["shown_share"] = shown ? Json(*shown) : Json(nullptr);
  json["supports"] = gradient.supports;
  json["contradicts"] = gradient.contradicts;
  return json;
}

}  // namespace

Json AgreementToJson(const Agreement& agreement, const AgreementOptions& options) {
  Json json;
  json["num_photos"] = agreement.num_photos;
  json["num_pixels"] = agreement.num_pixels;
  AddMeasures(agreement.at_pose, &json);
  Json turned = Json::array(), information_turned = Json::array();
  for (const Agreement::Turned& one : agreement.turned) {
    Json entry, information;
    entry["turn_deg"] = information["turn_deg"] = one.turn_deg;
    AddMeasures(one.measures, &entry);
    information["mutual_information"] = one.measures.mutual_information;
    turned.push_back(entry);
    information_turned.push_back(information);
  }
  json["turned"] = turned;
  json["mutual_information_turned"] = information_turned;
  json["gradient_shift"] = GradientAgreementToJson(agreement.gradient, options.gradient);
  return json;
}

}  // namespace roomtex
