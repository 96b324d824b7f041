#include "importers/scan_record.h"

#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <set>
#include <stdexcept>

#include "core/error.h"
#include "core/frames.h"
#include "core/json_text.h"
#include "core/result_names.h"
#include "core/text.h"
#include "importers/content_hash.h"
#include "importers/length_unit.h"
#include "importers/scan_path.h"
#include "importers/scan_poses.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;

constexpr double kSamePosition = 1e-6;  // metres
constexpr double kSameRotation = 1e-6;  // radians
constexpr char kToUseAnother[] =
    ". To use another: align anew, or copy the model's folder without alignment.json";

std::string FolderOf(const std::string& path) {
  const fs::path parent = fs::path(path).parent_path();
  return parent.empty() ? "." : parent.string();
}

int64_t SizeOf(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return -1;
  const auto size = fs::file_size(path, error);
  return error ? -1 : static_cast<int64_t>(size);
}

bool HasContentOf(const ScanRecord& record, const std::string& path) {
  return SizeOf(path) == record.num_bytes && HashOfFile(path) == record.content_hash;
}

// Where the scan of a record lies now.
std::string FindFile(const ScanRecord& record, const AlignmentRecord& alignment) {
  const std::string beside =
      (fs::path(alignment.folder) / record.relative_path).lexically_normal().string();
  std::set<std::string> folders;
  std::string changed;
  for (const std::string& path : {record.path, beside, record.absolute_path}) {
    if (path.empty()) continue;
    if (HasContentOf(record, path)) return path;
    if (changed.empty() && SizeOf(path) >= 0) changed = path;
    folders.insert(FolderOf(path));
  }
  for (const std::string& folder : folders) {
    std::error_code error;
    std::set<std::string> files;  // ordered: the same answer wherever
    for (const auto& entry : fs::directory_iterator(folder, error)) {
      if (SizeOf(entry.path()) == record.num_bytes) files.insert(entry.path().string());
    }
    for (const std::string& path : files) {
      if (HashOfFile(path) == record.content_hash) return path;
    }
  }
  if (!changed.empty()) {
    throw InputError(changed, "",
                     "is no longer the scan that the model in " + alignment.folder +
                         " was aligned to: its content has changed",
                     std::string("Give that scan with --scan_path") + kToUseAnother);
  }
  throw InputError(
      record.path, "",
      "the scan that the model in " + alignment.folder + " was aligned to is no longer there",
      "Say with --scan_path where it is now");
}

// What is read: a record, and where its file is, with the part of it.
struct Found {
  const ScanRecord* record;
  std::string path;
};

std::string WithPart(const std::string& path, const ScanRecord& record) {
  return record.part.empty() ? path : path + "#" + record.part;
}

std::vector<Found> FindScans(const AlignmentRecord& alignment,
                             const std::vector<std::string>& paths) {
  std::vector<Found> found;
  if (paths.empty()) {
    for (const ScanRecord& record : alignment.scans) {
      found.push_back({&record, WithPart(FindFile(record, alignment), record)});
    }
    return found;
  }
  std::set<const ScanRecord*> taken;
  for (const std::string& path : paths) {
    const ScanPath given = SplitScanPath(path);
    const std::string hash = HashOfFile(given.file);
    const ScanRecord* match = nullptr;
    bool twice = false;
    for (const ScanRecord& record : alignment.scans) {
      if (record.content_hash != hash || record.part != given.part) continue;
      twice = taken.count(&record) > 0;
      if (twice) continue;
      match = &record;
      break;
    }
    if (match == nullptr && twice) throw UsageError("--scan_path " + path + " is given twice");
    if (match == nullptr) {
      throw InputError(path, "",
                       "is another scan than the model in " + alignment.folder +
                           " was aligned to, " +
                           WithPart(alignment.scans[0].path, alignment.scans[0]) +
                           (alignment.scans.size() > 1 ? " and others" : ""),
                       std::string("Give that one, or none: it is remembered") + kToUseAnother);
    }
    taken.insert(match);
    found.push_back({match, path});
  }
  return found;
}

std::string Metres(double value) { return Significant(value, 6) + " m"; }

void CheckOptions(const AlignmentRecord& alignment, const std::vector<Found>& found,
                  const ScanReaderOptions& given) {
  std::vector<std::string> problems;
  const auto add = [&](const std::string& option, const ScanRecord& record,
                       const std::string& how) {
    problems.push_back(option + " contradicts the alignment in " + alignment.folder +
                       ", for which " + record.path + " was read " + how +
                       ". Leave the option out, or align anew with it");
  };
  for (const Found& one : found) {
    const ScanRecord& record = *one.record;
    if (given.azimuth != "auto" && !record.azimuth.empty() && given.azimuth != record.azimuth) {
      add("--azimuth " + given.azimuth, record, record.azimuth);
    }
    const double unit = MetersPerUnit(given.units).value_or(record.meters_per_unit);
    if (!given.units.empty() && std::abs(unit / record.meters_per_unit - 1) > 1e-9) {
      add("--units " + given.units, record, "in units of " + Metres(record.meters_per_unit));
    }
    if (given.up_axis != "auto" && !record.up_axis.empty() && given.up_axis != record.up_axis) {
      add("--up_axis " + given.up_axis, record, "with " + record.up_axis + " up");
    }
    if (given.max_range > 0 && given.max_range != record.max_range) {
      add("--max_range", record,
          record.max_range > 0 ? "up to " + Metres(record.max_range) : "without such a limit");
    }
  }
  ThrowIfProblems(problems);
}

// Stations as --scan_poses says them now must be those that are remembered.
void CheckPoses(const AlignmentRecord& alignment, const std::vector<Found>& found,
                const std::string& poses_path, const std::vector<Scan>& scans) {
  if (poses_path.empty()) return;
  ScanPoses poses(poses_path);
  size_t scan = 0;
  for (const Found& one : found) {
    const int count = static_cast<int>(one.record->poses.size());
    for (int k = 0; k < count; ++k, ++scan) {
      const Rigid& known = one.record->poses[k].scan_from_station;
      const auto said =
          poses.Take({one.path, scans[scan].number_in_file, count, UpInStation(scans[scan])});
      if (!said) continue;
      const Rigid& now = said->scan_from_station;
      if ((now.translation - known.translation).norm() <= kSamePosition &&
          RotationAngle(now.rotation, known.rotation) <= kSameRotation) {
        continue;
      }
      throw UsageError("--scan_poses " + poses_path + " puts " + one.path +
                       " elsewhere than the alignment in " + alignment.folder +
                       " has it. Leave the option out, or align anew with it");
    }
  }
  poses.RequireAllTaken();
}

template <typename Value>
Value ValueOf(const Json& json, const char* key) {
  return json.at(key).get<Value>();
}

Json ToJson(const GeoPosition& position) {
  return {{"latitude", position.latitude_deg},
          {"longitude", position.longitude_deg},
          {"height", position.height}};
}

GeoPosition PositionFromJson(const Json& json) {
  const GeoPosition position{ValueOf<double>(json, "latitude"), ValueOf<double>(json, "longitude"),
                             ValueOf<double>(json, "height")};
  if (!position.Problems().empty()) throw std::domain_error("no place on Earth");
  return position;
}

// Absent in what is not surveyed.
std::optional<SurveyedStation> StationFromJson(const Json& pose) {
  if (!pose.contains("station")) return std::nullopt;
  const Json& station = pose.at("station");
  return SurveyedStation{PositionFromJson(station), ValueOf<double>(station, "heading")};
}

ScanRecord RecordFromJson(const Json& json) {
  ScanRecord record;
  record.path = ValueOf<std::string>(json, "path");
  record.part = json.value("part", std::string());
  record.absolute_path = ValueOf<std::string>(json, "absolute_path");
  record.relative_path = ValueOf<std::string>(json, "relative_path");
  record.num_bytes = ValueOf<int64_t>(json, "num_bytes");
  record.content_hash = ValueOf<std::string>(json, "content_hash");
  record.azimuth = json.at("azimuth").is_null() ? "" : ValueOf<std::string>(json, "azimuth");
  record.units = json.at("units").is_null() ? "" : ValueOf<std::string>(json, "units");
  record.meters_per_unit = ValueOf<double>(json, "meters_per_unit");
  record.max_range = ValueOf<double>(json, "max_range");
  record.up_axis = json.value("up_axis", std::string());
  if (!(record.meters_per_unit > 0) || !(record.max_range >= 0)) {
    throw std::domain_error("a length out of range");
  }
  for (const Json& pose : json.at("poses")) {
    const auto q = ValueOf<std::array<double, 4>>(pose, "rotation_wxyz");
    const auto t = ValueOf<std::array<double, 3>>(pose, "translation");
    if (!(std::abs(Eigen::Vector4d(q.data()).norm() - 1) < 1e-3)) {
      throw std::domain_error("no rotation");
    }
    record.poses.push_back({{QuaternionFromWxyz({q[0], q[1], q[2], q[3]}), {t[0], t[1], t[2]}},
                            ValueOf<bool>(pose, "given"),
                            StationFromJson(pose)});
  }
  if (json.contains("enu_origin")) record.enu_origin = PositionFromJson(json.at("enu_origin"));
  return record;
}

ScanReaderOptions OptionsOf(const ScanRecord& record, const ScanReaderOptions& given) {
  ScanReaderOptions options;
  options.colors = given.colors;
  options.colors_as_intensity = given.colors_as_intensity;
  options.e57_check = given.e57_check;
  if (!record.azimuth.empty()) options.azimuth = record.azimuth;
  options.units = record.units;
  options.max_range = record.max_range;
  if (!record.up_axis.empty()) options.up_axis = record.up_axis;
  return options;
}

}  // namespace

std::vector<ScanRecord> RecordScans(const PlacedScans& placed, const std::string& model_folder) {
  std::vector<ScanRecord> records;
  size_t scan = 0;
  for (const PlacedScans::File& file : placed.files) {
    std::error_code error;
    ScanRecord record;
    const ScanPath path = SplitScanPath(file.path);
    record.path = path.file;
    record.part = path.part;
    const fs::path absolute = fs::weakly_canonical(fs::absolute(path.file), error);
    record.absolute_path = absolute.string();
    record.relative_path =
        absolute.lexically_relative(fs::weakly_canonical(fs::absolute(model_folder), error))
            .string();
    record.num_bytes = SizeOf(path.file);
    record.content_hash = HashOfFile(path.file);
    record.azimuth = file.azimuth;
    record.units = file.options.units;
    record.meters_per_unit = file.meters_per_unit;
    record.max_range = file.options.max_range;
    record.up_axis = file.up_axis;
    if (placed.enu) record.enu_origin = placed.enu->origin();
    for (const bool given : file.placed) {
      ScanRecord::Pose pose{placed.scans[scan].scan_from_station, given, std::nullopt};
      if (scan < placed.stations.size()) pose.station = placed.stations[scan];
      record.poses.push_back(pose);
      ++scan;
    }
    records.push_back(std::move(record));
  }
  return records;
}

Json ToJson(const std::vector<ScanRecord>& records) {
  Json json = Json::array();
  for (const ScanRecord& record : records) {
    Json one;
    one["path"] = record.path;
    if (!record.part.empty()) one["part"] = record.part;
    one["absolute_path"] = record.absolute_path;
    one["relative_path"] = record.relative_path;
    one["num_bytes"] = record.num_bytes;
    one["content_hash"] = record.content_hash;
    one["azimuth"] = record.azimuth.empty() ? Json(nullptr) : Json(record.azimuth);
    one["units"] = record.units.empty() ? Json(nullptr) : Json(record.units);
    one["meters_per_unit"] = record.meters_per_unit;
    one["max_range"] = record.max_range;
    one["up_axis"] = record.up_axis;
    if (record.enu_origin) one["enu_origin"] = ToJson(*record.enu_origin);
    one["poses"] = Json::array();
    for (const ScanRecord::Pose& pose : record.poses) {
      Json of_scan = {
          {"rotation_wxyz", ToJson(WxyzFromQuaternion(pose.scan_from_station.rotation))},
          {"translation", ToJson(pose.scan_from_station.translation)},
          {"given", pose.given}};
      if (pose.station) {
        of_scan["station"] = ToJson(pose.station->position);
        of_scan["station"]["heading"] = pose.station->heading_deg;
      }
      one["poses"].push_back(of_scan);
    }
    json.push_back(one);
  }
  return json;
}

AlignmentRecord ReadAlignmentRecord(const std::string& model_folder) {
  AlignmentRecord record;
  record.folder = model_folder;
  record.path = (fs::path(model_folder) / kAlignReportName).string();
  std::error_code error;
  if (!fs::is_regular_file(record.path, error)) {
    // The same model about a place on the Earth, of roomtex-align --geo_origin, lies in another
    // frame than the scans: its trust alone goes along.
    const Json geo = ReadJsonIfAny((fs::path(model_folder) / "geo.json").string());
    if (!geo.is_object()) return record;
    record.trusted = geo.value("trusted", Json(true)) != Json(false);
    const Json reason = geo.value("reason", Json());
    if (reason.is_string()) record.reason = reason.get<std::string>();
    return record;
  }
  const Json json = ReadJsonIfAny(record.path);
  try {
    if (!json.is_object()) throw InputError(record.path, "", "", "");
    record.found = true;
    record.trusted = json.value("trusted", true);
    record.reason = json.value("reason", std::string());
    const Json expected = json.value("expected_error", Json());
    // Photos that were placed one by one have no common error at the room's far corner.
    for (const char* key : {"at_far_corner_mm", "at_cameras_mm"}) {
      const Json found = expected.is_object() ? expected.value(key, Json()) : Json();
      if (!found.is_number()) continue;
      record.expected_error = found.get<double>() / 1000;
      break;
    }
    const Json disagreement =
        expected.is_object() ? expected.value("disagreement_mm", Json()) : Json();
    if (disagreement.is_number()) record.disagreement = disagreement.get<double>() / 1000;
    for (const Json& image : json.value("images", Json::array())) {
      const Json doubt = image.value("doubt", Json());
      if (!doubt.is_string()) continue;
      const std::string name = image.at("name");
      record.doubtful_photos[name] = "roomtex-align doubts " + name + ": " +
                                     doubt.get<std::string>() + " --use_doubtful 1 uses it.";
    }
    if (!json.contains("scans")) return record;
    for (const Json& scan : json.at("scans")) record.scans.push_back(RecordFromJson(scan));
  } catch (const std::exception&) {
    throw InputError(record.path, "", "is not as roomtex-align writes it",
                     "Align anew, or remove it: then nothing is known of the scans of this model");
  }
  return record;
}

void RequireAlignedModel(const AlignmentRecord& record) {
  if (!record.found || record.trusted) return;
  for (const char* name : {"cameras", "images", "points3D"}) {
    for (const char* extension : {".bin", ".txt"}) {
      std::error_code error;
      if (fs::exists(fs::path(record.folder) / (std::string(name) + extension), error)) return;
    }
  }
  std::string why = record.reason.empty() ? "it does not say why" : record.reason;
  if (why.back() == '.') why.pop_back();  // the sentence gets its own
  throw InputError(
      record.folder, "",
      "holds no model, only the report of roomtex-align, which refused to align: " + why,
      "Align anew; what stands in the way is in alignment.json there");
}

void RequireScans(const std::vector<std::string>& paths, const std::string& model_folder) {
  std::error_code error;
  if (!paths.empty() || fs::exists(fs::path(model_folder) / kAlignReportName, error)) return;
  throw UsageError("--scan_path is required: " +
                   (model_folder.empty()
                        ? "only a single model of roomtex-align remembers its scans"
                        : model_folder + " is no model of roomtex-align, which "
                                         "would remember its scans"));
}

PlacedScans ReadScansOfModel(const AlignmentRecord& alignment, const ScanRequest& request) {
  if (alignment.scans.empty()) {
    if (request.paths.empty() && alignment.found) {
      throw UsageError("--scan_path is required: " + alignment.path +
                       " does not say which scan the model was aligned to");
    }
    return ReadPlacedScans(request.paths, request.poses_path, request.options, request.max_samples);
  }
  const std::vector<Found> found = FindScans(alignment, request.paths);
  CheckOptions(alignment, found, request.options);
  PlacedScans placed;
  ScanThinner thinner(request.max_samples, &placed.scans);
  const auto thin = [&thinner](std::vector<Scan>* of_file) { thinner.Take(of_file); };
  for (const Found& one : found) {
    const ScanReaderOptions options = OptionsOf(*one.record, request.options);
    ScanFile file = ReadScanFile(one.path, options, thin);
    const std::vector<ScanRecord::Pose>& poses = one.record->poses;
    if (one.record->enu_origin) placed.enu.emplace(*one.record->enu_origin);
    if (file.scans.size() != poses.size()) {
      throw InputError(alignment.path, "",
                       "gives " + std::to_string(poses.size()) + " poses for the " +
                           std::to_string(file.scans.size()) + " scans of " + one.path,
                       "Align anew");
    }
    PlacedScans::File read{one.path, file.azimuth, file.up_axis, file.meters_per_unit, {}, options};
    for (size_t k = 0; k < poses.size(); ++k) {
      if (poses[k].given) PlaceScan(poses[k].scan_from_station, &file.scans[k]);
      read.placed.push_back(poses[k].given);
      if (poses[k].station) placed.stations.push_back(*poses[k].station);
      placed.scans.push_back(std::move(file.scans[k]));
    }
    placed.files.push_back(std::move(read));
  }
  placed.stride = thinner.stride();
  CheckPoses(alignment, found, request.poses_path, placed.scans);
  return placed;
}

PlacedScans ReadScansOfModel(const AlignmentRecord& record, const ScanRequest& request,
                             const Command::Context& context) {
  PlacedScans placed = ReadScansOfModel(record, request);
  for (const std::string& note : placed.notes) context.Warn(note);
  for (size_t i = 0; i < placed.scans.size(); ++i) {
    const Scan& scan = placed.scans[i];
    if (scan.NumMissing() < static_cast<int>(scan.points.size())) continue;
    throw InputError(ScanName(placed.scans, i), "", "holds no measured sample",
                     "Check the scan and --max_range");
  }
  return placed;
}

void TakeOverTrust(const AlignmentRecord& record, bool accept, const Command::Context& context) {
  if (record.trusted) return;
  const std::string reason = "The alignment in " + record.folder + " is not to be trusted" +
                             (record.reason.empty() ? "." : ": " + record.reason);
  if (accept) {
    context.Warn(reason);
  } else {
    context.report.SetUntrusted(reason + " (--accept_untrusted 1 takes it as it is.)");
  }
}

}  // namespace roomtex
