#include "align/join/room_record.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include <fmt/core.h>

#include "colmap_ext/sparse_model.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/json_text.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;

// A number of millimetres or degrees; none where it is null or missing.
std::optional<double> NumberOf(const Json& json, const char* key) {
  const Json value = json.is_object() ? json.value(key, Json()) : Json();
  if (!value.is_number() || !(value.get<double>() > 0)) return std::nullopt;
  return value.get<double>();
}

struct Sigmas {
  double position = 0, rotation = 0;
};

// Of the report's roots of a trace, along one axis. Photos that took no part in the adjustment have
// none of their own: they are as exact as photos are there in the middle.
std::optional<Sigmas> SigmasOf(const Json& image, const Json& expected) {
  std::optional<double> mm = NumberOf(image, "position_sigma_mm");
  std::optional<double> degrees = NumberOf(image, "rotation_sigma_deg");
  if (!mm) mm = NumberOf(expected, "at_cameras_mm");
  if (!degrees) degrees = NumberOf(expected, "rotation_deg");
  if (!mm || !degrees) return std::nullopt;
  return Sigmas{*mm / 1000 / std::sqrt(3), RadFromDeg(*degrees) / std::sqrt(3)};
}

std::map<std::string, Sigmas> ReadSigmas(const Json& report) {
  std::map<std::string, Sigmas> sigmas;
  const Json expected = report.value("expected_error", Json());
  for (const Json& image : report.value("images", Json::array())) {
    if (!image.is_object() || !image.contains("name") || !image["name"].is_string()) continue;
    const std::optional<Sigmas> found = SigmasOf(image, expected);
    if (found) sigmas[image["name"].get<std::string>()] = *found;
  }
  return sigmas;
}

std::string ImagePathOf(const Json& report) {
  const Json options = report.value("options", Json());
  const Json path = options.is_object() ? options.value("image_path", Json()) : Json();
  return path.is_string() ? path.get<std::string>() : "";
}

// Up is a direction of the file; where a pose was given, only that of an RTPI is known.
std::optional<Eigen::Vector3d> UpOf(const AlignmentRecord& alignment) {
  for (const ScanRecord& scan : alignment.scans) {
    const std::string axis = scan.azimuth.empty() ? scan.up_axis : "y";
    const size_t letter = std::string("xyz").find(axis.empty() ? ' ' : axis.back());
    const bool is_given = !scan.poses.empty() && scan.poses[0].given;
    if (letter == std::string::npos || (is_given && scan.azimuth.empty())) continue;
    Eigen::Vector3d up = Eigen::Vector3d::Unit(static_cast<Eigen::Index>(letter));
    if (axis[0] == '-') up = -up;
    return is_given ? scan.poses[0].scan_from_station.rotation * up : up;
  }
  return std::nullopt;
}

}  // namespace

std::string RoomName(const std::string& model_folder) {
  const fs::path path = (fs::absolute(model_folder) / "").lexically_normal().parent_path();
  const bool is_inside = path.filename() == "aligned" && !path.parent_path().filename().empty();
  return (is_inside ? path.parent_path() : path).filename().string();
}

RoomRecord ReadRoom(const std::string& model_folder, const std::string& image_path,
                    const Command::Context& context) {
  RoomRecord room;
  room.name = RoomName(model_folder);
  room.alignment = ReadAlignmentRecord(model_folder);
  if (!room.alignment.found) {
    throw InputError(model_folder, "", "is no model of roomtex-align: it has no alignment.json",
                     "Give the folder that roomtex-align wrote, e.g. result/hall/aligned");
  }
  RequireAlignedModel(room.alignment);
  room.up = UpOf(room.alignment);
  const Json report = ReadJsonIfAny(room.alignment.path);
  std::map<std::string, Sigmas> sigmas;
  std::string folder = image_path;
  try {
    sigmas = ReadSigmas(report);
    if (folder.empty()) folder = ImagePathOf(report);
  } catch (const Json::exception&) {
    throw InputError(room.alignment.path, "", "is not as roomtex-align writes it", "Align anew");
  }
  const SparseModel model = ReadSparseModel(model_folder);
  for (const auto& [id, image] : model.images) {
    room.origin +=
        image.cam_from_model.TargetOriginInSource() / static_cast<double>(model.images.size());
  }
  const Rigid scan_from_room = room.RoomFromScan().Inverse();
  bool is_missing = false;
  size_t num_doubtful = 0, num_without_error = 0;
  for (const auto& [id, image] : model.images) {
    const auto at = sigmas.find(image.name);
    if (at == sigmas.end()) {
      ++num_without_error;
      continue;
    }
    if (room.alignment.doubtful_photos.count(image.name) > 0) {
      ++num_doubtful;
      continue;
    }
    RoomPhoto photo;
    photo.name = image.name;
    photo.path = (fs::path(folder) / image.name).string();
    photo.cam_from_room = image.cam_from_model * scan_from_room;
    photo.position_sigma = at->second.position;
    photo.rotation_sigma = at->second.rotation;
    std::error_code error;
    if (fs::is_regular_file(photo.path, error)) {
      room.photos.push_back(photo);
    } else {
      is_missing = true;
    }
  }
  std::sort(room.photos.begin(), room.photos.end(),
            [](const RoomPhoto& a, const RoomPhoto& b) { return a.name < b.name; });
  if (num_doubtful > 0) {
    context.Warn(fmt::format("photos of {} that are doubtful link it to no other room: {}, e.g. {}",
                             room.name, num_doubtful,
                             room.alignment.doubtful_photos.begin()->first));
  }
  if (num_without_error > 0) {
    context.Warn(fmt::format(
        "photos of {} of which {} does not say how exactly they stand link it to no other room: {}",
        room.name, room.alignment.path, num_without_error));
  }
  if (folder.empty()) {
    context.Warn(room.alignment.path +
                 " names no photos: what photos it shares with other rooms is not known. Give "
                 "their folder with --image_path, or align with --image_path");
  } else if (is_missing) {
    context.Warn(folder + " does not hold all photos of " + room.name +
                 ", and those that are missing link it to no other room. Run this where "
                 "roomtex-align ran, or give the folder with --image_path");
  }
  return room;
}

}  // namespace roomtex
