#include "colmap_ext/model_output.h"

#include <filesystem>
#include <set>
#include <system_error>

#include "colmap_ext/mapper_verdict.h"
#include "core/error.h"
#include "core/output_file.h"
#include "core/result_names.h"

namespace roomtex {
namespace fs = std::filesystem;

ScratchFolder::ScratchFolder(const std::string& parent) try : folder_(parent) {
} catch (const std::system_error& error) {
  throw InputError(parent, "", "cannot be written into (" + error.code().message() + ")",
                   "Check the rights of this folder and the space on the disk");
}

void RequireReplaceableModel(const std::string& folder) {
  std::error_code error;
  const fs::file_status status = fs::symlink_status(folder, error);
  if (!fs::exists(status)) return;
  if (!fs::is_directory(status)) {
    throw InputError(folder, "", "is not a folder, and a model is to be written there",
                     "Remove it or give another --output_path");
  }
  static const std::set<std::string> model_files = {
      "cameras.bin", "images.bin",  "points3D.bin", "rigs.bin",
      "frames.bin",  "cameras.txt", "images.txt",   "points3D.txt",
      "rigs.txt",    "frames.txt",  "project.ini",  kMapperReportName};
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (model_files.count(name) > 0) continue;
    throw InputError(folder, "", "holds " + name + ", which is no part of a COLMAP model",
                     "This folder would be replaced: move it away or give another --output_path");
  }
}

void RequireNoRigs(const std::string& folder) {
  for (const char* file : {"rigs.bin", "frames.bin"}) {
    const std::string path = (fs::path(folder) / file).string();
    std::error_code error;
    if (!fs::exists(path, error)) continue;
    throw InputError(path, "", "belongs to a COLMAP 4 model, which the new one would contradict",
                     "Give an empty --output_path");
  }
}

}  // namespace roomtex
