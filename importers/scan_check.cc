#include "importers/scan_check.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "importers/scan_poses.h"

namespace roomtex {
namespace {

// What ScanPoses asks about a scan.
struct Placeable {
  int number_in_file = 1;
  Eigen::Vector3d up_in_station;
};

CheckedScan Look(const Scan& scan) {
  CheckedScan checked;
  const int num_missing = scan.NumMissing();
  checked.kind = scan.kind();
  checked.num_columns = scan.num_columns;
  checked.num_rows = scan.num_rows;
  checked.num_samples = static_cast<int64_t>(scan.points.size()) - num_missing;
  checked.num_missing = num_missing + scan.num_left_out;
  checked.num_triangles = scan.triangles.size();
  checked.has_colors = !scan.colors.empty();
  checked.bounds = FindBounds(scan);
  return checked;
}

std::string ShapeOf(const CheckedScan& scan) {
  switch (scan.kind) {
    case Scan::Kind::kGrid:
      return std::to_string(scan.num_columns) + " columns x " + std::to_string(scan.num_rows) +
             " rows";
    case Scan::Kind::kMesh:
      return "mesh of " + std::to_string(scan.num_triangles) + " triangles";
    case Scan::Kind::kCloud:
      break;
  }
  return "points without a grid";
}

Json BoundsJson(const Bounds& bounds) {
  return {{"min", ToJson(bounds.min)}, {"max", ToJson(bounds.max)}};
}

Json ReportOf(const CheckedFile& file, const CheckedScan& scan) {
  constexpr const char* kKinds[] = {"grid", "mesh", "cloud"};
  Json json;
  json["name"] = scan.name;
  json["format"] = file.format;
  json["kind"] = kKinds[static_cast<int>(scan.kind)];
  json["num_columns"] = scan.num_columns;
  json["num_rows"] = scan.num_rows;
  json["num_samples"] = scan.num_samples;
  json["num_missing"] = scan.num_missing;
  json["num_triangles"] = nullptr;
  if (scan.kind == Scan::Kind::kMesh) json["num_triangles"] = scan.num_triangles;
  json["has_colors"] = scan.has_colors;
  json["has_pose"] = scan.has_pose;
  json["bounds"] = BoundsJson(scan.bounds);
  return json;
}

}  // namespace

std::vector<CheckedFile> CheckScans(const std::vector<std::string>& paths,
                                    const std::string& poses_path, const ScanReaderOptions& options,
                                    Progress* progress) {
  ScanPoses poses(poses_path);
  std::vector<CheckedFile> files;
  struct Missing {
    std::string path;
    int number, count;
  };
  std::optional<Missing> missing;  // the first without a pose
  size_t num_scans = 0;
  for (const std::string& path : paths) {
    CheckedFile checked;
    std::vector<Placeable> placeable;
    const ScanFile file = ReadScanFile(path, options, [&](std::vector<Scan>* of_file) {
      const Scan scan = std::exchange(of_file->back(), Scan());
      checked.scans.push_back(Look(scan));
      placeable.push_back(
          {scan.number_in_file, scan.scan_from_station.rotation.conjugate() * scan.up});
      if (checked.scans.size() == 1) checked.up_is_assumed = scan.up_is_assumed;
    });
    checked.path = path;
    checked.format = file.format;
    checked.byte_order = file.byte_order;
    checked.notes = file.notes;
    checked.up_axis = file.up_axis;
    const int count = static_cast<int>(checked.scans.size());
    num_scans += checked.scans.size();
    for (size_t k = 0; k < checked.scans.size(); ++k) {
      const int number = placeable[k].number_in_file;
      checked.scans[k].name = count > 1 ? path + "#" + std::to_string(number) : path;
      const bool is_placed =
          poses.Take(path, number, count, placeable[k].up_in_station).has_value();
      checked.scans[k].has_pose = is_placed || (file.CarriesPoses() && !poses.surveyed());
      if (!checked.scans[k].has_pose && !missing) missing = Missing{path, number, count};
    }
    files.push_back(std::move(checked));
    progress->Tick();
  }
  poses.RequireAllTaken();
  if (missing && (num_scans > 1 || poses.surveyed())) {
    poses.ThrowMissing(missing->path, missing->number, missing->count, num_scans);
  }
  return files;
}

Json ReportKeys(const std::vector<CheckedFile>& files) {
  CheckedScan total;
  Json scans = Json::array();
  for (const CheckedFile& file : files) {
    for (const CheckedScan& scan : file.scans) {
      scans.push_back(ReportOf(file, scan));
      total.num_columns += scan.num_columns;
      total.num_rows = std::max(total.num_rows, scan.num_rows);
      total.num_samples += scan.num_samples;
      total.num_missing += scan.num_missing;
      total.has_colors |= scan.has_colors;
      total.bounds.min = total.bounds.min.cwiseMin(scan.bounds.min);
      total.bounds.max = total.bounds.max.cwiseMax(scan.bounds.max);
    }
  }
  Json keys;
  keys["num_columns"] = total.num_columns;
  keys["num_rows"] = total.num_rows;
  keys["num_samples"] = total.num_samples;
  keys["num_missing"] = total.num_missing;
  keys["num_triangles"] = scans.size() == 1 ? scans[0]["num_triangles"] : Json();
  keys["has_colors"] = total.has_colors;
  for (const char* key : {"format", "byte_order", "up", "bounds"}) keys[key] = nullptr;
  if (files.size() == 1) {
    keys["format"] = files[0].format;
    keys["byte_order"] = files[0].byte_order;
    keys["up"] = {{"axis", files[0].up_axis}, {"assumed", files[0].up_is_assumed}};
    keys["bounds"] = BoundsJson(total.bounds);
  }
  keys["scans"] = scans;
  return keys;
}

std::string LinesOn(const std::vector<CheckedFile>& files) {
  std::string text;
  for (const CheckedFile& file : files) {
    for (const CheckedScan& scan : file.scans) {
      text += scan.name + ": " + file.format + ", " + ShapeOf(scan) + ", " +
              std::to_string(scan.num_samples) + " samples, " + std::to_string(scan.num_missing) +
              " missing, " + (scan.has_pose ? "with a pose" : "no pose") + "\n";
    }
  }
  return text;
}

}  // namespace roomtex
