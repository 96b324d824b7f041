#include "align/pick/pick_json.h"

#include <cmath>

#include "core/error.h"

namespace roomtex {
namespace {

constexpr size_t kMaxPicks = 2000;
constexpr double kMaxCoordinate = 1e8;  // metres; the Earth is 1.3e7 across
constexpr int kMaxShownName = 60;
constexpr size_t kMaxLabel = 200;

const char* StatusName(PickState::Status status) {
  switch (status) {
    case PickState::Status::kUsed:
      return "used";
    case PickState::Status::kOff:
      return "off";
    case PickState::Status::kBad:
      return "bad";
    case PickState::Status::kHalf:
      return "half";
    case PickState::Status::kWaiting:
      return "waiting";
  }
  return "";
}

const char* ByName(PhotoState::By by) {
  switch (by) {
    case PhotoState::By::kNothing:
      return "";
    case PhotoState::By::kPicks:
      return "picks";
    case PhotoState::By::kSparseModel:
      return "sparse_model";
    case PhotoState::By::kSearch:
      return "search";
  }
  return "";
}

const char* ReasonName(ScanPlaces::Reason reason) {
  switch (reason) {
    case ScanPlaces::Reason::kNone:
      return "";
    case ScanPlaces::Reason::kMissing:
      return "missing";
    case ScanPlaces::Reason::kDepthEdge:
      return "depth_edge";
    case ScanPlaces::Reason::kOutside:
      return "outside";
  }
  return "";
}

std::string MessageOf(ScanPlaces::Reason reason) {
  switch (reason) {
    case ScanPlaces::Reason::kNone:
      return "";
    case ScanPlaces::Reason::kMissing:
      return "The scanner measured nothing here.";
    case ScanPlaces::Reason::kDepthEdge:
      return "The surface ends here: a point on the edge could lie on either side of it.";
    case ScanPlaces::Reason::kOutside:
      return "This place is outside the scan's picture.";
  }
  return "";
}

Json Numbers(const Eigen::VectorXd& vector) {
  Json json = Json::array();
  for (Eigen::Index i = 0; i < vector.size(); ++i) json.push_back(vector[i]);
  return json;
}

// The member, or null if it is not there.
const Json& Member(const Json& object, const char* name) {
  static const Json kNull;
  const auto at = object.find(name);
  return at == object.end() ? kNull : *at;
}

double ParseNumber(const Json& json, const std::string& what, double low, double high) {
  if (!json.is_number()) throw UsageError(what + " must be a number.");
  const double value = json.get<double>();
  if (!(value >= low && value <= high)) throw UsageError(what + " is out of range.");
  return value;
}

template <int kSize>
Eigen::Matrix<double, kSize, 1> ParseVector(const Json& json, const std::string& what, double low,
                                            double high) {
  if (!json.is_array() || json.size() != kSize) {
    throw UsageError(what + " must be a list of " + std::to_string(kSize) + " numbers.");
  }
  Eigen::Matrix<double, kSize, 1> vector;
  for (int i = 0; i < kSize; ++i) vector[i] = ParseNumber(json[i], what, low, high);
  return vector;
}

int ParseWhole(const Json& json, const std::string& what, int low, int high) {
  const double value = ParseNumber(json, what, low, high);
  if (value != std::floor(value)) throw UsageError(what + " must be a whole number.");
  return static_cast<int>(value);
}

ScanSpot ParseSpot(const Json& json, const std::string& what, const PickScene& scene) {
  if (!json.is_object()) throw UsageError(what + " must be an object or null.");
  ScanSpot spot;
  spot.scan = ParseWhole(Member(json, "id"), what + ".id", 0, scene.num_scans() - 1);
  const ScanPlaces& places = scene.places(spot.scan);
  spot.place.x() = ParseNumber(Member(json, "x"), what + ".x", 0, places.width());
  spot.place.y() = ParseNumber(Member(json, "y"), what + ".y", 0, places.height());
  return spot;
}

SessionPick ParsePick(const Json& json, const std::string& what, const PickScene& scene) {
  if (!json.is_object()) throw UsageError(what + " must be an object.");
  const Json& name = Member(json, "image_name");
  if (!name.is_string()) throw UsageError(what + ".image_name must be a name.");
  SessionPick pick;
  pick.image_name = name.get<std::string>();
  const PickPhoto* photo = scene.FindPhoto(pick.image_name);
  if (photo == nullptr) {
    throw UsageError("There is no photo \"" + pick.image_name.substr(0, kMaxShownName) + "\".");
  }
  const Camera& camera = photo->projection->camera();
  if (const Json& img = Member(json, "img"); !img.is_null()) {
    const auto x = ParseVector<2>(img, what + ".img", 0, std::max(camera.width, camera.height));
    if (!photo->projection->InImage(x)) throw UsageError(what + ".img is outside the photo.");
    pick.x_in_img = x;
  }
  if (const Json& spot = Member(json, "scan"); !spot.is_null()) {
    pick.spot = ParseSpot(spot, what + ".scan", scene);
  }
  if (const Json& point = Member(json, "point"); !point.is_null()) {
    pick.x_in_scan = ParseVector<3>(point, what + ".point", -kMaxCoordinate, kMaxCoordinate);
  } else if (pick.spot) {
    const ScanPlaces::Found found = scene.places(pick.spot->scan).PointAt(pick.spot->place);
    if (found.reason != ScanPlaces::Reason::kNone) throw UsageError(MessageOf(found.reason));
    pick.x_in_scan = found.x_in_scan;
  }
  if (!pick.x_in_img && !pick.x_in_scan) {
    throw UsageError(what + " has a place neither in the photo nor in the scan.");
  }
  if (const Json& weight = Member(json, "weight"); !weight.is_null()) {
    pick.weight = ParseNumber(weight, what + ".weight", 0, kMaxPickWeight);
  }
  if (const Json& label = Member(json, "label"); !label.is_null()) {
    if (!label.is_string()) throw UsageError(what + ".label must be a text.");
    pick.label = label.get<std::string>();
    if (pick.label.size() > kMaxLabel || pick.label.find_first_of("\r\n") != std::string::npos) {
      throw UsageError("A label is one line of at most " + std::to_string(kMaxLabel) + " letters.");
    }
  }
  return pick;
}

Json SpotToJson(const ScanSpot& spot) {
  return {{"id", spot.scan}, {"x", spot.place.x()}, {"y", spot.place.y()}};
}

Json PickToJson(const SessionPick& pick, const PickState& state) {
  Json json;
  json["image_name"] = pick.image_name;
  json["img"] = pick.x_in_img ? Numbers(*pick.x_in_img) : Json();
  json["scan"] = pick.spot ? SpotToJson(*pick.spot) : Json();
  json["point"] = pick.x_in_scan ? Numbers(*pick.x_in_scan) : Json();
  json["weight"] = pick.weight;
  json["label"] = pick.label;
  json["complete"] = pick.complete();
  json["used"] = state.status == PickState::Status::kUsed;
  json["residual_px"] = NumberOrNull(state.residual_px);
  json["residual_mm"] = NumberOrNull(1000 * state.residual);
  json["residual"] = state.error_px.allFinite() ? Numbers(state.error_px) : Json();
  json["leave_one_out_px"] = NumberOrNull(state.leave_one_out_px);
  json["worst"] = state.worst;
  json["status"] = StatusName(state.status);
  json["predicted_img"] = state.predicted_img ? Numbers(*state.predicted_img) : Json();
  json["predicted_scan"] = nullptr;
  if (state.predicted_spot) {
    json["predicted_scan"] = SpotToJson(*state.predicted_spot);
    json["predicted_scan"]["point"] = Numbers(state.predicted_point);
  }
  return json;
}

Json PhotoToJson(const PhotoState& photo) {
  Json json;
  json["num_complete"] = photo.num_complete;
  json["num_used"] = photo.num_used;
  json["solved"] = photo.solved();
  json["by"] = ByName(photo.by);
  json["rms_px"] = NumberOrNull(photo.rms_px);
  json["rms_mm"] = NumberOrNull(1000 * photo.rms);
  json["position_sigma_mm"] = NumberOrNull(1000 * photo.position_sigma);
  json["focal_length_px"] = nullptr;
  if (photo.found_projection && photo.solved_by_picks()) {
    json["focal_length_px"] = photo.found_projection->camera().MeanFocalLength();
  }
  json["focal_length_sigma_px"] = NumberOrNull(photo.focal_sigma);
  json["warnings"] = photo.warnings;
  json["ambiguous"] = photo.ambiguous;
  return json;
}

Json FoundToJson(const FoundPlaces* found) {
  if (found == nullptr) return nullptr;
  Json json;
  json["trusted"] = found->trusted;
  json["confirm_in"] = found->confirm_in.empty() ? Json() : Json(found->confirm_in);
  return json;
}

// Null where the model has no place yet.
Json SimilarityToJson(const ModelState& model) {
  if (!model.scan_from_sparse) return nullptr;
  return {{"scale", model.scan_from_sparse->scale},
          {"relative_mad", NumberOrNull(model.scale.relative_mad)},
          {"num_features", model.scale.num_features},
          {"rms_px", NumberOrNull(model.rms_px)},
          {"num_photos", model.num_clicked_photos}};
}

}  // namespace

PutPicks ParsePutPicks(const Json& json, const PickScene& scene) {
  if (!json.is_object()) throw UsageError("The request must be an object.");
  PutPicks put;
  put.revision =
      ParseWhole(Member(json, "revision"), "revision", 0, std::numeric_limits<int>::max() - 1);
  const Json& picks = Member(json, "picks");
  if (!picks.is_array()) throw UsageError("picks must be a list.");
  if (picks.size() > kMaxPicks) {
    throw UsageError("No more than " + std::to_string(kMaxPicks) + " picks can be kept.");
  }
  for (size_t i = 0; i < picks.size(); ++i) {
    put.picks.push_back(ParsePick(picks[i], "picks[" + std::to_string(i) + "]", scene));
  }
  return put;
}

Json SessionToJson(const PickSession::Snapshot& snapshot, const PickScene& scene) {
  const PickSolution& solution = snapshot.solution;
  Json json;
  json["revision"] = snapshot.revision;
  json["solution_number"] = snapshot.solution_number;
  json["saved"] = snapshot.saved;
  json["save_error"] = snapshot.save_error;
  json["picks"] = Json::array();
  for (size_t i = 0; i < snapshot.picks.size(); ++i) {
    json["picks"].push_back(PickToJson(snapshot.picks[i], solution.picks[i]));
  }
  json["photos"] = Json::object();
  for (const PickPhoto& photo : scene.photos()) {
    json["photos"][photo.name()] = PhotoToJson(solution.photos.at(photo.name()));
  }
  json["similarities"] = Json::array();
  for (const ModelState& model : solution.models) {
    json["similarities"].push_back(SimilarityToJson(model));
  }
  json["found"] = FoundToJson(solution.found.get());
  json["check_points"] = nullptr;
  if (solution.num_check_points > 0) {
    json["check_points"] = {{"count", solution.num_check_points},
                            {"rms_px", NumberOrNull(solution.check_rms_px)},
                            {"rms_mm", NumberOrNull(1000 * solution.check_rms)}};
  }
  json["next"] = solution.next;
  json["milliseconds"] = snapshot.milliseconds;
  return json;
}

Json ScanPointToJson(const ScanPlaces::Found& found) {
  const bool ok = found.reason == ScanPlaces::Reason::kNone;
  Json json;
  json["ok"] = ok;
  json["reason"] = ReasonName(found.reason);
  json["message"] = MessageOf(found.reason);
  json["point"] = ok ? Numbers(found.x_in_scan) : Json();
  json["range"] = ok ? Json(found.range) : Json();
  json["snap"] = nullptr;
  if (found.snap) {
    json["snap"] = {{"x", found.snap->place.x()},
                    {"y", found.snap->place.y()},
                    {"point", Numbers(found.snap->x_in_scan)}};
  }
  return json;
}

}  // namespace roomtex
