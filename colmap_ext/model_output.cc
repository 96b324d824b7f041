#include "colmap_ext/model_output.h"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <set>

#include <stdlib.h>

#include "colmap_ext/mapper_verdict.h"
#include "core/error.h"

namespace roomtex {
namespace fs = std::filesystem;

ScratchFolder::ScratchFolder(const std::string& parent) {
  std::string pattern = (fs::path(parent) / ".roomtex-mapper-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) {
    throw InputError(parent, "",
                     std::string("cannot be written into (") + std::strerror(errno) + ")",
                     "Check the rights of this folder and the space on the disk");
  }
  path_ = pattern;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
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

void ReplaceFolder(const std::string& finished, const std::string& target,
                   const std::string& scratch) {
  const fs::path old = fs::path(scratch) / ("replaced_" + fs::path(target).filename().string());
  std::error_code error;
  const bool had_old = fs::exists(target, error);
  if (had_old) fs::rename(target, old, error);
  if (!error) fs::rename(finished, target, error);
  if (!error) return;
  std::error_code ignored;
  if (had_old && !fs::exists(target, ignored)) fs::rename(old, target, ignored);
  throw InputError(target, "", "cannot be replaced (" + error.message() + ")",
                   "Check the rights of this folder");
}

}  // namespace roomtex
