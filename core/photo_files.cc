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

std::vector<std::string> ListPhotoFiles(const std::string& folder, const std::string& remedy,
                                        bool below) {
  RequireFolder(folder, remedy);
  std::vector<std::string> names;
  std::error_code error, unknown;
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end;
       it.increment(error)) {
    const std::string file = it->path().filename().string();
    const bool is_hidden = BeginsWith(file, ".");
    if (is_hidden || !below) it.disable_recursion_pending();
    if (is_hidden || !IsPhotoName(file) || !it->is_regular_file(unknown)) continue;
    names.push_back(it->path().lexically_relative(folder).generic_string());
  }
  if (error)
    throw InputError(folder, "", "cannot be listed: " + error.message(), "Check its rights");
  if (names.empty()) {
    throw InputError(folder, "", "holds no photos (.jpg, .png, .tif, .bmp)", remedy);
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
