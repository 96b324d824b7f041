#include "core/input_guard.h"

#include <filesystem>
#include <map>
#include <mutex>
#include <set>
#include <system_error>

#include <unistd.h>

#include "core/error.h"
#include "core/partial_path.h"
#include "core/result_names.h"
#include "core/text.h"

namespace roomtex {
namespace fs = std::filesystem;

std::string FileOf(const std::string& path) {
  std::error_code error;
  if (fs::exists(path, error)) return path;
  for (size_t at = path.find('#'); at != std::string::npos; at = path.find('#', at + 1)) {
    const std::string file = path.substr(0, at);
    if (at + 1 < path.size() && fs::is_regular_file(file, error)) return file;
  }
  return path;
}

namespace {

struct Guard {
  std::mutex mutex;
  bool active = false;
  GuardedPaths paths;
  std::map<std::string, std::string> inputs;  // place of a file, what names it
  std::vector<std::string> written, logs;
};

Guard& TheGuard() {
  static Guard guard;
  return guard;
}

// Where the path leads, without links and "..", also if its last parts do not exist; "" = nowhere.
std::string Place(const std::string& path) {
  std::error_code error;
  const fs::path place = fs::weakly_canonical(fs::absolute(path, error), error);
  std::string text = place.lexically_normal().string();
  while (text.size() > 1 && text.back() == '/') text.pop_back();
  return error ? "" : text;
}

// A link's own place: that of its folder, and its name.
std::string PlaceOfEntry(const std::string& path) {
  const fs::path absolute = fs::path(path).lexically_normal();
  const std::string folder = absolute.parent_path().string();
  const std::string place = Place(folder.empty() ? "." : folder);
  return place.empty() ? "" : (place == "/" ? "" : place) + "/" + absolute.filename().string();
}

bool IsBelow(const std::string& place, const std::string& folder) {
  return place.size() > folder.size() && place.compare(0, folder.size(), folder) == 0 &&
         (place[folder.size()] == '/' || folder == "/");
}

bool IsSameFile(const std::string& a, const std::string& b) {
  std::error_code error;
  return fs::equivalent(a, b, error) && !error;
}

// What a folder of inputs holds that commands read from it.
bool LooksLikeInput(const std::string& path) {
  const std::string extension = LowerCase(fs::path(path).extension().string());
  static const std::set<std::string> photos = {".jpg", ".jpeg", ".png",  ".tif", ".tiff", ".bmp",
                                               ".ppm", ".pgm",  ".webp", ".jp2", ".exr",  ".hdr"};
  const std::string stem = fs::path(path).stem().string();
  static const std::set<std::string> models = {"cameras", "images", "points3D", "rigs", "frames"};
  return photos.count(extension) > 0 || fs::path(path).filename() == kAlignReportName ||
         ((extension == ".bin" || extension == ".txt") && models.count(stem) > 0);
}

[[noreturn]] void Refuse(const GuardedPaths::OptionPath& output, const std::string& reason) {
  throw UsageError("--" + output.first + " " + output.second + " " + reason + ". Give another --" +
                   output.first);
}

void CheckAgainstInputs(const GuardedPaths::OptionPath& output, const GuardedPaths& paths) {
  std::error_code error;
  const bool is_file = fs::is_regular_file(output.second, error);
  const std::string place = PlaceOfEntry(output.second), end_of_link = Place(output.second);
  for (const auto& [name, given] : paths.inputs) {
    const std::string path = FileOf(given);
    if (IsSameFile(output.second, path) && (is_file || fs::is_directory(path, error))) {
      // A folder may get results beside what it holds; one that is a model may not become another.
      if (!is_file) continue;
      Refuse(output, "is the input --" + name + " " + given + ": inputs are never changed");
    }
    if (!is_file || !fs::is_directory(path, error) || !LooksLikeInput(output.second)) continue;
    const std::string folder = Place(path);
    if (IsBelow(place, folder) || IsBelow(end_of_link, folder)) {
      Refuse(output,
             "is a file of the input --" + name + " " + given + ": inputs are never changed");
    }
  }
}

void CheckAgainstOutputs(const GuardedPaths::OptionPath& output, size_t index,
                         const GuardedPaths& paths) {
  std::error_code error;
  if (fs::exists(output.second, error) && !fs::is_regular_file(output.second, error)) return;
  for (size_t i = 0; i < index; ++i) {
    const auto& [name, path] = paths.outputs[i];
    if (PlaceOfEntry(path) != PlaceOfEntry(output.second) && !IsSameFile(path, output.second)) {
      continue;
    }
    Refuse(output,
           name == output.first ? "is given twice" : "is the same file as --" + name + " " + path);
  }
}

// The option that names the path or a folder above it; with its path.
const GuardedPaths::OptionPath* OptionOf(const std::string& place,
                                         const std::vector<GuardedPaths::OptionPath>& options) {
  for (const GuardedPaths::OptionPath& option : options) {
    const std::string named = Place(FileOf(option.second));
    if (named == place || IsBelow(place, named)) return &option;
  }
  return nullptr;
}

}  // namespace

InputGuard::InputGuard(GuardedPaths paths) {
  for (size_t i = 0; i < paths.outputs.size(); ++i) {
    CheckAgainstInputs(paths.outputs[i], paths);
    CheckAgainstOutputs(paths.outputs[i], i, paths);
  }
  Guard& guard = TheGuard();
  const std::lock_guard<std::mutex> lock(guard.mutex);
  guard.active = true;
  guard.written.clear();
  guard.logs.clear();
  guard.inputs.clear();
  for (const auto& [name, path] : paths.inputs) {
    std::error_code error;
    if (fs::is_directory(path, error)) continue;
    guard.inputs.emplace(Place(FileOf(path)), "--" + name + " " + path);
  }
  guard.paths = std::move(paths);
}

InputGuard::~InputGuard() {
  Guard& guard = TheGuard();
  const std::lock_guard<std::mutex> lock(guard.mutex);
  guard.active = false;
  guard.inputs.clear();
  guard.paths = {};
}

void RequireOutsidePhotos(const std::string& output_path, const std::string& photos) {
  std::error_code error;
  if (!fs::is_directory(photos, error)) return;
  const std::string place = Place(output_path), folder = Place(photos);
  if (place.empty() || folder.empty() || (place != folder && !IsBelow(place, folder))) return;
  throw UsageError("--output_path " + output_path + " lies in the folder of the photos, " + photos +
                   ": give one outside of it");
}

void NoteInput(const std::string& path) {
  Guard& guard = TheGuard();
  const std::lock_guard<std::mutex> lock(guard.mutex);
  if (!guard.active) return;
  const std::string place = Place(path);
  const GuardedPaths::OptionPath* const option = OptionOf(PlaceOfEntry(path), guard.paths.inputs);
  if (option == nullptr || IsPartial(place)) return;
  guard.inputs.emplace(place, path + ", which --" + option->first + " names");
  guard.inputs.emplace(PlaceOfEntry(path), path + ", which --" + option->first + " names");
}

void NoteInput(const std::string& path, const std::string& named_by) {
  Guard& guard = TheGuard();
  const std::lock_guard<std::mutex> lock(guard.mutex);
  if (guard.active)
    guard.inputs.emplace(Place(FileOf(path)), path + ", which " + named_by + " names");
}

void RefuseToReplaceInput(const std::string& path) {
  Guard& guard = TheGuard();
  const std::lock_guard<std::mutex> lock(guard.mutex);
  if (!guard.active || IsPartial(path)) return;
  const std::string entry = PlaceOfEntry(path);
  auto found = guard.inputs.find(entry);
  if (found == guard.inputs.end()) found = guard.inputs.find(Place(path));
  if (found == guard.inputs.end()) return;
  const GuardedPaths::OptionPath* const output = OptionOf(entry, guard.paths.outputs);
  const std::string option = output == nullptr ? "the output" : "--" + output->first;
  throw UsageError(option + " would replace " + path + ", which is an input (" + found->second +
                   "): inputs are never changed. Give another path");
}

void RequireReplaceable(const std::string& path) {
  RefuseToReplaceInput(path);
  std::error_code error;
  const fs::file_status status = fs::symlink_status(path, error);
  if (fs::is_directory(path, error)) {
    throw InputError(path, "", "is a folder, expected a file to write",
                     "Give the path of a file that may be written, or move the folder away");
  }
  if (fs::is_regular_file(status) && ::access(path.c_str(), W_OK) != 0) {
    throw InputError(path, "", "is write-protected", "Give another path or change its rights");
  }
}

void NoteOutput(const std::string& path) {
  if (IsPartial(path)) return;
  Guard& guard = TheGuard();
  const std::lock_guard<std::mutex> lock(guard.mutex);
  if (guard.active) guard.written.push_back(path);
}

std::vector<std::string> OutputsSoFar() {
  Guard& guard = TheGuard();
  const std::lock_guard<std::mutex> lock(guard.mutex);
  return guard.written;
}

void NoteLog(const std::string& path) {
  Guard& guard = TheGuard();
  const std::lock_guard<std::mutex> lock(guard.mutex);
  if (guard.active) guard.logs.push_back(path);
}

std::vector<std::string> LogsSoFar() {
  Guard& guard = TheGuard();
  const std::lock_guard<std::mutex> lock(guard.mutex);
  return guard.logs;
}

}  // namespace roomtex
