#include "colmap_ext/model_output.h"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>

#include <nlohmann/json.hpp>
#include <stdlib.h>

#include "colmap_ext/mapper_verdict.h"
#include "core/error.h"
#include "core/output_file.h"

namespace roomtex {
namespace fs = std::filesystem;

ScratchFolder::ScratchFolder(const std::string& parent) {
  std::string pattern = (fs::path(parent) / ".roomtex-partial-XXXXXX").string();
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

void RequireReplaceableOutput(const std::string& folder, const std::string& command) {
  std::error_code error;
  if (!fs::exists(fs::symlink_status(folder, error))) return;
  const char* const remedy = "Move it away or give another --output_path";
  if (!fs::is_directory(folder, error)) {
    throw InputError(folder, "", "is not a folder, and one is to be written there", remedy);
  }
  if (fs::is_empty(folder, error)) return;
  std::ifstream stream(folder + "/report.json");
  const auto report = nlohmann::json::parse(stream, nullptr, false);
  if (report.is_object() && report.value("command", "") == command) return;
  throw InputError(folder, "", "holds files that " + command + " did not write", remedy);
}

namespace {

std::string WithoutSlash(const std::string& folder) {
  const fs::path path = fs::absolute(folder).lexically_normal();
  return (path.has_filename() ? path : path.parent_path()).string();
}

}  // namespace

std::string ParentFolder(const std::string& folder) {
  const std::string parent = fs::path(WithoutSlash(folder)).parent_path().string();
  MakeFolder(parent);
  return parent;
}

void ReplaceFolder(const std::string& finished, const std::string& given_target,
                   const std::string& scratch) {
  const std::string target = WithoutSlash(given_target);
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
