#include "importers/scan_poses.h"

#include <cmath>
#include <filesystem>
#include <sstream>
#include <string_view>

#include "core/error.h"
#include "core/frames.h"
#include "importers/file_reader.h"

namespace roomtex {
namespace {

const char kFormat[] =
    "Expected \"NAME m00 ... m33\" (4x4, row by row) or \"NAME qw qx qy qz tx ty tz\"";

std::optional<Rigid> PoseFromMatrix(const std::vector<double>& v) {
  const Eigen::Matrix4d matrix =
      Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(v.data());
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  const bool rigid =
      (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <
          1e-3 &&
      rotation.determinant() > 0;
  const bool affine =
      matrix.bottomLeftCorner<1, 3>().isZero(1e-9) && std::abs(matrix(3, 3) - 1) < 1e-9;
  if (!rigid || !affine) return std::nullopt;
  return Rigid{Eigen::Quaterniond(rotation).normalized(), matrix.topRightCorner<3, 1>()};
}

std::optional<Rigid> PoseFromQuaternion(const std::vector<double>& v) {
  const Eigen::Quaterniond rotation = QuaternionFromWxyz({v[0], v[1], v[2], v[3]});
  if (!(std::abs(rotation.norm() - 1) < 1e-2)) return std::nullopt;
  return Rigid{rotation.normalized(), {v[4], v[5], v[6]}};
}

}  // namespace

ScanPoses::ScanPoses(const std::string& path) : path_(path) {
  if (path.empty()) return;
  const FileReader file(path);
  LineReader lines(file);
  std::string_view line;
  while (lines.Next(&line)) {
    // '#' starts a comment at the beginning of a word; inside a word it is part of a name
    // ("room.ptx#2").
    std::istringstream words{std::string(line)};
    std::string name, word;
    if (!(words >> name) || name[0] == '#') continue;
    std::vector<double> numbers;
    bool good = true;
    while (good && words >> word && word[0] != '#') {
      char* end = nullptr;
      numbers.push_back(std::strtod(word.c_str(), &end));
      good = *end == '\0' && std::isfinite(numbers.back());
    }
    if (!good || (numbers.size() != 16 && numbers.size() != 7)) {
      throw InputError(path, LinePosition(lines.line_number()),
                       "is " + Quoted(line, 60) + ", which is no pose", kFormat);
    }
    const std::optional<Rigid> pose =
        numbers.size() == 16 ? PoseFromMatrix(numbers) : PoseFromQuaternion(numbers);
    if (!pose) {
      throw InputError(path, LinePosition(lines.line_number()),
                       "the pose of " + name + " is not a rotation with a translation",
                       "A mirrored, scaled or sheared pose cannot be used");
    }
    for (const Entry& entry : entries_) {
      if (entry.name == name) {
        throw InputError(path, LinePosition(lines.line_number()),
                         "gives a second pose for " + name + ", the first is in line " +
                             std::to_string(entry.line),
                         "Remove one of them");
      }
    }
    entries_.push_back({name, lines.line_number(), *pose, false});
  }
}

std::optional<Rigid> ScanPoses::Take(const std::string& scan_path, int index, int count) {
  const std::string file_name = std::filesystem::path(scan_path).filename().string();
  const std::string number = "#" + std::to_string(index + 1);
  for (Entry& entry : entries_) {
    const bool bare = entry.name == scan_path || entry.name == file_name;
    if (bare && count > 1) {
      throw InputError(path_, LinePosition(entry.line),
                       entry.name + " holds " + std::to_string(count) + " scans",
                       "Give a pose per scan: " + entry.name + "#1, " + entry.name + "#2 ...");
    }
    if (bare || entry.name == scan_path + number || entry.name == file_name + number) {
      entry.taken = true;
      return entry.scan_from_station;
    }
  }
  return std::nullopt;
}

void ScanPoses::RequireAllTaken() const {
  for (const Entry& entry : entries_) {
    if (entry.taken) continue;
    throw InputError(path_, LinePosition(entry.line), entry.name + " is none of the scans given",
                     "Write the scan's path or file name");
  }
}

void PlaceScan(const Rigid& scan_from_station, Scan* scan) {
  const Rigid moved = scan_from_station * scan->scan_from_station.Inverse();
  for (size_t i = 0; i < scan->points.size(); ++i) {
    if (!scan->IsMissing(static_cast<int>(i))) scan->points[i] = moved * scan->points[i];
  }
  scan->up = moved.rotation * scan->up;
  scan->scan_from_station = scan_from_station;
}

}  // namespace roomtex
