#include "core/photo_files.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "core/error.h"
#include "core/output_file.h"
#include "core/text.h"

namespace roomtex {
namespace fs = std::filesystem;

bool IsPhotoName(const std::string& path) {
  static const std::set<std::string> kExtensions = {".jpg",  ".jpeg", ".png", ".tif",
                                                    ".tiff", ".bmp",  ".webp"};
  const std::string extension = LowerCase(fs::path(path).extension().string());
  return kExtensions.count(extension) > 0;
}

namespace {

// Calls visit(name below the folder) for every file that is not hidden, in no order.
template <typename Visit>
void VisitFiles(const std::string& folder, bool below, std::error_code* error, const Visit& visit) {
  std::error_code unknown;
  for (fs::recursive_directory_iterator it(folder, *error), end; !*error && it != end;
       it.increment(*error)) {
    const bool is_hidden = BeginsWith(it->path().filename().string(), ".");
    if (is_hidden || !below) it.disable_recursion_pending();
    if (is_hidden || !it->is_regular_file(unknown)) continue;
    visit(it->path().lexically_relative(folder));
  }
}

}  // namespace

std::string NoteOnOtherPhotos(const std::string& folder) {
  static const std::set<std::string> kNotRead = {".heic", ".heif", ".hif", ".avif", ".dng", ".cr2",
                                                 ".cr3",  ".nef",  ".arw", ".raf",  ".orf", ".rw2"};
  std::set<std::string> read;  // without their endings: a camera writes the same as JPEG, too
  std::vector<fs::path> others;
  std::error_code error;
  VisitFiles(folder, true, &error, [&](const fs::path& name) {
    if (IsPhotoName(name.string())) read.insert(fs::path(name).replace_extension().string());
    if (kNotRead.count(LowerCase(name.extension().string())) > 0) others.push_back(name);
  });
  others.erase(std::remove_if(others.begin(), others.end(),
                              [&](const fs::path& name) {
                                return read.count(fs::path(name).replace_extension().string()) > 0;
                              }),
               others.end());
  if (others.empty()) return "";
  std::sort(others.begin(), others.end());
  return "photos in " + folder + " are not read (" + std::to_string(others.size()) + ", as " +
         others[0].string() + "): export them as JPEG";
}

std::vector<std::string> ListPhotoFiles(const std::string& folder, const std::string& remedy,
                                        bool below) {
  RequireFolder(folder, remedy);
  std::vector<std::string> names;
  std::error_code error;
  VisitFiles(folder, below, &error, [&](const fs::path& name) {
    if (IsPhotoName(name.string())) names.push_back(name.generic_string());
  });
  if (error)
    throw InputError(folder, "", "cannot be listed: " + error.message(), "Check its rights");
  if (names.empty()) {
    const std::string note = NoteOnOtherPhotos(folder);
    throw InputError(folder, "", "holds no photos (.jpg, .png, .tif, .bmp)",
                     note.empty() ? remedy : note);
  }
  std::sort(names.begin(), names.end());
  return names;
}

bool HasHiddenPhotos(const std::string& folder) {
  std::error_code error;
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end;
       it.increment(error)) {
    if (!IsPhotoName(it->path().filename().string())) continue;
    const fs::path name = it->path().lexically_relative(folder);
    if (std::any_of(name.begin(), name.end(),
                    [](const fs::path& part) { return BeginsWith(part.string(), "."); })) {
      return true;
    }
  }
  return false;
}

}  // namespace roomtex
