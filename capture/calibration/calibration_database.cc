#include "capture/calibration/calibration_database.h"

#include <cstdint>
#include <filesystem>
#include <map>

#include "colmap_ext/database.h"
#include "core/camera_formulas.h"
#include "core/error.h"
#include "core/output_file.h"

namespace roomtex {
namespace {

std::string Size(const Camera& camera) {
  return std::to_string(camera.width) + "x" + std::to_string(camera.height);
}

bool HasShapeOf(const Camera& a, const Camera& b) {
  return static_cast<int64_t>(a.width) * b.height == static_cast<int64_t>(b.width) * a.height;
}

[[noreturn]] void RefuseSize(const std::string& path, const Camera& calibrated,
                             const Camera& other) {
  const bool turned = other.width == calibrated.height && other.height == calibrated.width;
  throw InputError(path, "table cameras",
                   "its photos are " + Size(other) + ", those of the board " + Size(calibrated),
                   turned
                       ? "They were turned by a program: extract features from the files as the "
                         "camera stored them"
                       : "Photograph the board with the resolution and the format of the photos, "
                         "uncropped");
}

}  // namespace

Camera ScaledCamera(const Camera& camera, int width, int height) {
  Camera scaled = camera;
  const double factor = static_cast<double>(width) / camera.width;
  // Positions in `img` start at the picture's border, so that everything in pixels scales alike.
  const int num_linear = camera_formulas::NumLinearParams(camera.model);
  for (int i = 0; i < num_linear; ++i) scaled.params[i] *= factor;
  scaled.width = width;
  scaled.height = height;
  return scaled;
}

void RequireNoLog(const std::string& output_path) {
  for (const char* ending : {"-wal", "-journal"}) {
    const std::string log = output_path + ending;
    std::error_code error;
    const auto size = std::filesystem::file_size(log, error);
    if (error) continue;
    if (size > 0) {
      throw InputError(log, "",
                       "is a log of changes to a database of this name: it is in use, or a program "
                       "that worked on it was killed",
                       "End the program, or remove the database and its log, or give another "
                       "--apply_output");
    }
    std::filesystem::remove(log, error);
  }
}

void RequireNothingNew(const std::string& output_path, const std::string& database_path) {
  if (!std::filesystem::exists(output_path)) return;
  const Database copy(output_path), database(database_path);
  const bool same_images = copy.ReadImages().size() == database.ReadImages().size();
  if (same_images && copy.CountKeypoints() == database.CountKeypoints() &&
      copy.CountPairs() <= database.CountPairs()) {
    return;
  }
  throw InputError(output_path, "",
                   "is there and has other photos, features or pairs than " + database_path +
                       ": something was made in it since",
                   "To replace it, name it with --apply_output; or give that another name");
}

AppliedCameras ApplyToDatabase(const Camera& calibrated, const std::string& database_path,
                               const std::string& output_path) {
  const Database database(database_path);
  AppliedCameras applied;
  std::map<uint32_t, Camera> cameras;
  const std::map<uint32_t, Camera> old_cameras = database.ReadCameras();
  if (old_cameras.empty()) {
    throw InputError(database_path, "table cameras", "holds no camera",
                     "Run colmap feature_extractor first");
  }
  for (const auto& [camera_id, old] : old_cameras) {
    const std::string who = "camera " + std::to_string(camera_id) + " (" + Size(old) + ")";
    if (!HasShapeOf(old, calibrated)) {
      applied.left.push_back(camera_id);
      applied.notes.push_back(who +
                              " keeps its parameters: its photos have another shape than "
                              "those of the board (" +
                              Size(calibrated) + ")");
      continue;
    }
    const bool same = old.width == calibrated.width;
    Camera camera = ScaledCamera(calibrated, old.width, old.height);
    camera.camera_id = camera_id;
    camera.has_prior_focal_length = true;
    cameras[camera_id] = camera;
    (same ? applied.same_size : applied.scaled).push_back(camera_id);
    if (!same) {
      applied.notes.push_back(who + " gets the calibration scaled from " + Size(calibrated) +
                              ": right if its photos were only resized, not if the camera was set "
                              "to another resolution that crops");
    }
  }
  if (cameras.empty()) RefuseSize(database_path, calibrated, old_cameras.begin()->second);
  applied.has_pairs = database.CountPairs() > 0;
  RequireNoLog(output_path);
  OutputFile file(output_path);
  database.CopyWithCameras(file.partial_path(), cameras);
  file.Commit();
  return applied;
}

}  // namespace roomtex
