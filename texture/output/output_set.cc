#include "texture/output/output_set.h"

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>

#include <unistd.h>

#include "core/error.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;

const char kPrefix[] = ".roomtex-partial-";

// What processes that are no more left behind.
void RemoveLeftovers(const std::string& folder) {
  std::error_code error;
  std::vector<fs::path> leftovers;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind(kPrefix, 0) != 0 || !entry.is_directory(error)) continue;
    const long pid = std::strtol(name.c_str() + sizeof kPrefix - 1, nullptr, 10);
    if (pid > 0 && ::kill(static_cast<pid_t>(pid), 0) != 0 && errno == ESRCH) {
      leftovers.push_back(entry.path());
    }
  }
  for (const fs::path& path : leftovers) fs::remove_all(path, error);
}

}  // namespace

OutputSet::OutputSet(const std::string& folder) : folder_(folder) {
  RemoveLeftovers(folder);
  const fs::path aside = fs::path(folder) / (kPrefix + std::to_string(::getpid()));
  std::error_code error;
  fs::create_directories(aside, error);
  if (error) {
    throw InputError(folder, "", "cannot be written into (" + error.message() + ")",
                     "Check the rights of this folder and the space on the disk");
  }
  aside_ = aside.string();
}

OutputSet::~OutputSet() {
  std::error_code ignored;
  fs::remove_all(aside_, ignored);
}

std::string OutputSet::Path(const std::string& name) {
  names_.push_back(name);
  return (fs::path(aside_) / name).string();
}

void OutputSet::Commit() {
  std::error_code error;
  for (const std::string& name : names_) {
    const fs::path target = fs::path(folder_) / name;
    if (fs::is_directory(target, error)) {
      throw InputError(target.string(), "", "is a folder, expected a file to write",
                       "Move it away or give another --output_path");
    }
  }
  for (const std::string& name : names_) {
    const fs::path from = fs::path(aside_) / name;
    fs::path target = fs::path(folder_) / name;
    if (fs::is_symlink(target, error)) {
      const fs::path end_of_link = fs::canonical(target, error);
      if (!error) target = end_of_link;
    }
    fs::rename(from, target, error);
    if (error) {  // the link leads to another disk
      error.clear();
      fs::copy_file(from, target, fs::copy_options::overwrite_existing, error);
    }
    if (error) {
      throw InputError(target.string(), "", "cannot be replaced (" + error.message() + ")",
                       "Check that you may write this file");
    }
  }
  names_.clear();
}

}  // namespace roomtex
