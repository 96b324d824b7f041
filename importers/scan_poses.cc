#include "importers/scan_poses.h"

#include <cmath>
#include <filesystem>
#include <iomanip>
#include <sstream>
#include <string_view>

#include "core/error.h"
#include "core/frames.h"
#include "core/text.h"
#include "importers/file_reader.h"

namespace roomtex {
namespace {

const char kFormat[] =
    "Expected \"NAME m00 ... m33\" (4x4, row by row), \"NAME qw qx qy qz tx ty tz\" or \"NAME geo "
    "LATITUDE LONGITUDE HEIGHT HEADING\" (degrees, metres); a NAME with blanks stands in double "
    "quotes";
const char kGeoFormat[] =
    "Expected \"NAME geo LATITUDE LONGITUDE HEIGHT HEADING\": degrees, metres above the WGS84 "
    "ellipsoid, degrees clockwise from north";
// Farther apart no two scans show the same room or street: a number is mistyped.
constexpr double kLargestSite = 100e3;

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

std::optional<double> NumberFrom(const std::string& word) {
  double number = 0;
  if (!ParseReal(word, &number) || !std::isfinite(number)) return std::nullopt;
  return number;
}

std::string Joined(const std::vector<std::string>& names) {
  constexpr size_t kShown = 5;
  std::string text;
  for (size_t i = 0; i < std::min(kShown, names.size()); ++i) {
    text += (i > 0 ? ", " : "") + names[i];
  }
  return names.size() > kShown ? text + " ..." : text;
}

std::string FileName(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

}  // namespace

ScanPoses::ScanPoses(const std::string& path) : path_(path) {
  if (path.empty()) return;
  const FileReader file(path);
  LineReader lines(file);
  std::string_view line;
  while (lines.Next(&line)) {
    const size_t first = line.find_first_not_of(" \t");
    if (first == std::string_view::npos || line[first] == '#') continue;
    AddEntry(ParseEntry(std::string(line), lines.line_number()));
  }
}

ScanPoses::Entry ScanPoses::ParseEntry(const std::string& line_text, long line) const {
  const auto fail = [&](const std::string& finding, const std::string& remedy) {
    return InputError(path_, LinePosition(line), finding, remedy);
  };
  std::istringstream words(line_text);
  Entry entry;
  entry.line = line;
  // A name with spaces stands in double quotes. '#' starts a comment at the beginning of a word;
  // inside a word it is part of a name ("room.ptx#2").
  if (!(words >> std::quoted(entry.name)) || entry.name.empty()) {
    throw fail("is " + Quoted(line_text) + ", which names no scan", kFormat);
  }
  std::vector<double> numbers;
  bool good = true, is_geo = false;
  for (std::string word; good && words >> word && word[0] != '#';) {
    if (word == "geo" && !is_geo && numbers.empty()) {
      is_geo = true;
      continue;
    }
    const std::optional<double> number = NumberFrom(word);
    good = number.has_value() && numbers.size() < 17;
    if (good) numbers.push_back(*number);
  }
  if (is_geo) {
    if (!good || numbers.size() != 4) {
      throw fail("is " + Quoted(line_text) + ", which is no surveyed station", kGeoFormat);
    }
    entry.station = SurveyedStation{{numbers[0], numbers[1], numbers[2]}, numbers[3]};
    std::vector<std::string> problems = entry.station->position.Problems();
    if (!(std::abs(numbers[3]) <= 360)) {
      problems.push_back("the heading must lie within -360 and 360 degrees");
    }
    if (!problems.empty()) {
      throw fail("is " + Quoted(line_text) + ", but " + problems[0], kGeoFormat);
    }
    return entry;
  }
  if (!good || (numbers.size() != 16 && numbers.size() != 7)) {
    throw fail("is " + Quoted(line_text) + ", which is no pose", kFormat);
  }
  const std::optional<Rigid> pose =
      numbers.size() == 16 ? PoseFromMatrix(numbers) : PoseFromQuaternion(numbers);
  if (!pose) {
    throw fail("the pose of " + entry.name + " is not a rotation with a translation",
               "A mirrored, scaled or sheared pose cannot be used");
  }
  entry.scan_from_station = *pose;
  return entry;
}

void ScanPoses::AddEntry(Entry entry) {
  const auto fail = [&](const std::string& finding, const std::string& remedy) {
    return InputError(path_, LinePosition(entry.line), finding, remedy);
  };
  const auto [same_name, is_new] = entry_of_name_.emplace(entry.name, entries_.size());
  if (!is_new) {
    throw fail("gives a second pose for " + entry.name + ", the first is in line " +
                   std::to_string(entries_[same_name->second].line),
               "Remove one of them");
  }
  if (!entries_.empty() && entry.station.has_value() != surveyed()) {
    const std::string first = std::to_string(entries_[0].line);
    throw fail(entry.station ? "is a surveyed station, but line " + first + " is a pose"
                             : "is a pose, but line " + first + " is a surveyed station",
               "Poses are given in the scan frame, stations on the Earth: write all scans in one "
               "way");
  }
  if (entry.station) {
    if (!enu_) enu_.emplace(entry.station->position);
    const double distance = HorizontalDistance(enu_->origin(), entry.station->position);
    if (!(distance <= kLargestSite)) {
      throw fail("the station lies " + std::to_string(std::lround(distance / 1000)) +
                     " km from that in line " + std::to_string(entries_[0].line),
                 "Check latitude and longitude: stations of one model lie within 100 km");
    }
  }
  entries_.push_back(std::move(entry));
}

// The path as it was given wins over the file name.
ScanPoses::Entry* ScanPoses::Find(const Asked& scan) {
  const std::string mark = "#" + std::to_string(scan.number);
  for (const std::string& name : {scan.path, FileName(scan.path)}) {
    const auto numbered = entry_of_name_.find(name + mark);
    if (numbered != entry_of_name_.end()) return &entries_[numbered->second];
    const auto bare = entry_of_name_.find(name);
    if (bare == entry_of_name_.end()) continue;
    Entry& entry = entries_[bare->second];
    if (scan.count > 1) {
      throw InputError(path_, LinePosition(entry.line),
                       entry.name + " holds " + std::to_string(scan.count) + " scans",
                       "Give a pose per scan: " + entry.name + "#1, " + entry.name + "#2 ...");
    }
    return &entry;
  }
  return nullptr;
}

std::optional<ScanPoses::Placement> ScanPoses::Take(const Asked& scan) {
  asked_for_.push_back(FileName(scan.path));
  Entry* const entry = Find(scan);
  if (entry == nullptr) {
    if (!unplaced_ && !IsPlaced(scan, std::nullopt)) unplaced_ = scan;
    return std::nullopt;
  }
  if (!entry->taken_by.empty()) {
    throw InputError(
        path_, LinePosition(entry->line),
        entry->name + " is the name of two scans, " + entry->taken_by + " and " + scan.path,
        "Write their paths, as they are given to the command");
  }
  entry->taken_by = scan.path;
  if (!entry->station) return Placement{entry->scan_from_station, std::nullopt};
  return Placement{enu_->EnuFromStation(*entry->station, scan.up_in_station), entry->station};
}

void ScanPoses::RequireAllTaken() const {
  for (const Entry& entry : entries_) {
    if (!entry.taken_by.empty()) continue;
    throw InputError(path_, LinePosition(entry.line),
                     entry.name + " is none of the scans given (" + Joined(asked_for_) + ")",
                     "Write the scan's path or file name, and each scan once");
  }
}

void ScanPoses::RequireAllPlaced() const {
  RequireAllTaken();
  if (!unplaced_ || (asked_for_.size() == 1 && !surveyed())) return;
  const std::string num_scans = std::to_string(asked_for_.size()) + " scans";
  if (path_.empty()) {
    throw InputError(unplaced_->path, "", "has no pose, but there are " + num_scans,
                     "Give each scan's pose with --scan_poses");
  }
  const std::string name = FileName(unplaced_->path) +
                           (unplaced_->count > 1 ? "#" + std::to_string(unplaced_->number) : "");
  std::vector<std::string> names;
  for (const Entry& entry : entries_) names.push_back(entry.name);
  throw InputError(path_, "",
                   std::string(surveyed() ? "gives no station" : "gives no pose") + " for " + name +
                       ", one of " + num_scans +
                       (names.empty() ? "" : "; it names " + Joined(names)),
                   "Add a line that begins with " + name);
}

void PlaceScan(const Rigid& scan_from_station, Scan* scan) {
  const Rigid moved = scan_from_station * scan->scan_from_station.Inverse();
  for (size_t i = 0; i < scan->points.size(); ++i) {
    if (!scan->IsMissing(static_cast<int>(i))) scan->points[i] = moved * scan->points[i];
  }
  for (Eigen::Vector3f& normal : scan->normals) {
    normal = moved.rotation.cast<float>() * normal;
  }
  scan->up = moved.rotation * scan->up;
  scan->scan_from_station = scan_from_station;
}

}  // namespace roomtex
