#include "core/output_file.h"

#include <cerrno>
#include <cstring>
#include <filesystem>

#include <unistd.h>

#include "core/error.h"

namespace roomtex {
namespace fs = std::filesystem;

OutputFile::OutputFile(const std::string& path) : path_(path) {
  std::error_code error;
  fs::path target(path);
  if (fs::is_symlink(target, error)) {
    const fs::path end_of_link = fs::canonical(target, error);
    if (!error) target = end_of_link;
  }
  if (fs::is_directory(target, error)) {
    throw InputError(path, "", "is a folder, expected a file to write",
                     "Give the path of a file that may be written");
  }
  fs::path partial = target.parent_path();
  partial /=
      target.stem().string() + ".partial-" + std::to_string(getpid()) + target.extension().string();
  direct_ = fs::exists(target, error) && !fs::is_regular_file(target, error);
  target_ = target.string();
  partial_path_ = direct_ ? target_ : partial.string();
  stream_.open(partial_path_, std::ios::binary | std::ios::trunc);
  if (!stream_) {
    throw InputError(path, "", std::string("cannot be written (") + std::strerror(errno) + ")",
                     "Check that the folder exists and that you may write in it");
  }
}

OutputFile::~OutputFile() {
  if (partial_path_.empty()) return;
  stream_.close();
  if (direct_) return;
  std::error_code ignored;
  fs::remove(partial_path_, ignored);
}

std::ostream& OutputFile::stream() { return stream_; }

void OutputFile::Commit() {
  stream_.flush();
  const bool whole = stream_.good();
  stream_.close();
  if (!whole) {
    throw InputError(path_, "", "could not be written to its end", "Check the space on the disk");
  }
  if (direct_) return;
  std::error_code error;
  fs::rename(partial_path_, target_, error);
  if (error) {
    throw InputError(path_, "", "cannot be replaced (" + error.message() + ")",
                     "Check that you may write this file");
  }
  partial_path_.clear();
}

void MakeFolder(const std::string& path) {
  std::error_code error;
  if (fs::exists(path, error) && !fs::is_directory(path, error)) {
    throw InputError(path, "", "is a file, expected a folder to write into",
                     "Give another --output_path");
  }
  fs::create_directories(path, error);
  if (error) {
    throw InputError(path, "", "cannot be made a folder (" + error.message() + ")",
                     "Check the path and that you may write there");
  }
  if (::access(path.c_str(), W_OK | X_OK) != 0) {
    throw InputError(path, "", "cannot be written into", "Check the rights of this folder");
  }
}

std::string PathInside(const std::string& folder, const std::string& name) {
  const fs::path inside = fs::path(name).lexically_normal();
  if (name.empty() || inside.is_absolute() || *inside.begin() == "..") {
    throw InputError(folder + "/" + name, "", "leads out of the folder to write into",
                     "Rename the image in the model");
  }
  const fs::path path = fs::path(folder) / inside;
  MakeFolder(path.parent_path().string());
  return path.string();
}

void RequireFile(const std::string& path, const std::string& remedy) {
  std::error_code error;
  if (fs::is_directory(path, error)) {
    throw InputError(path, "", "is a folder, expected a file", remedy);
  }
  if (!fs::exists(path, error)) throw InputError(path, "", "does not exist", remedy);
  if (!fs::is_regular_file(path, error)) {
    throw InputError(path, "", "is not a regular file", remedy);
  }
  if (::access(path.c_str(), R_OK) != 0) {
    throw InputError(path, "", "may not be read", "Check the rights of this file");
  }
}

void RequireFolder(const std::string& path, const std::string& remedy) {
  std::error_code error;
  if (!fs::exists(path, error)) throw InputError(path, "", "does not exist", remedy);
  if (!fs::is_directory(path, error)) {
    throw InputError(path, "", "is a file, expected a folder", remedy);
  }
}

}  // namespace roomtex
