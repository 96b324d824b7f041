#include "importers/scan_check.h"

#include <algorithm>
#include <utility>

#include "importers/scan_poses.h"

namespace roomtex {
namespace {

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
  for (const std::string& path : paths) {
    CheckedFile checked;
    std::vector<ScanPoses::Asked> asked;
    const ScanFile file = ReadScanFile(path, options, [&](std::vector<Scan>* of_file) {
      const Scan scan = std::exchange(of_file->back(), Scan());
      checked.scans.push_back(Look(scan));
      asked.push_back({path, scan.number_in_file, 1, UpInStation(scan)});
      if (checked.scans.size() == 1) checked.up_is_assumed = scan.up_is_assumed;
    });
    checked.path = path;
    checked.format = file.format;
    checked.byte_order = file.byte_order;
    checked.notes = file.notes;
    checked.up_axis = file.up_axis;
    for (size_t k = 0; k < asked.size(); ++k) {
      ScanPoses::Asked& scan = asked[k];
      scan.count = static_cast<int>(asked.size());
      scan.file_has_pose = file.CarriesPoses();
      checked.scans[k].name = scan.count > 1 ? path + "#" + std::to_string(scan.number) : path;
      checked.scans[k].has_pose = poses.IsPlaced(scan, poses.Take(scan));
    }
    files.push_back(std::move(checked));
    progress->Tick();
  }
  poses.RequireAllPlaced();
  return files;
}

Json ReportKeys(const std::vector<CheckedFile>& files) {
  CheckedScan total;
  int64_t num_columns = 0;  // of clouds, a column is a point: all together are too many for an int
  Json scans = Json::array();
  for (const CheckedFile& file : files) {
    for (const CheckedScan& scan : file.scans) {
      scans.push_back(ReportOf(file, scan));
      num_columns += scan.num_columns;
      total.num_rows = std::max(total.num_rows, scan.num_rows);
      total.num_samples += scan.num_samples;
      total.num_missing += scan.num_missing;
      total.has_colors |= scan.has_colors;
      total.bounds.min = total.bounds.min.cwiseMin(scan.bounds.min);
      total.bounds.max = total.bounds.max.cwiseMax(scan.bounds.max);
    }
  }
  Json keys;
  keys["num_columns"] = num_columns;
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
