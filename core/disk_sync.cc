#include "core/disk_sync.h"

#include <cerrno>
#include <filesystem>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

namespace roomtex {
namespace fs = std::filesystem;
namespace {

// What cannot be opened or has no such call is left to the system.
void Sync(const std::string& path, int flags, int (*sync)(int)) {
  const int descriptor = open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC | flags);
  if (descriptor < 0) return;
  const int error = sync(descriptor) == 0 ? 0 : errno;
  close(descriptor);
  if (error == EIO || error == ENOSPC || error == EDQUOT) {
    throw std::system_error(error, std::generic_category());
  }
}

}  // namespace

void SyncFolder(const std::string& folder) { Sync(folder + "/.", O_DIRECTORY, fsync); }

void SyncFoldersBelow(const std::string& folder) {
  std::error_code error;
  fs::recursive_directory_iterator entry(folder, error), end;
  for (; !error && entry != end; entry.increment(error)) {
    const fs::file_status status = entry->symlink_status(error);
    if (fs::is_directory(status)) SyncFolder(entry->path().string());
  }
  SyncFolder(folder);
}

void SyncFiles(const std::string& folder, const std::vector<std::string>& files) {
  std::error_code error;
  for (const std::string& file : files) {
    const fs::path path = fs::path(folder) / file;
    // A pipe would be waited for.
    if (fs::is_regular_file(fs::symlink_status(path, error))) Sync(path.string(), 0, fdatasync);
  }
}

}  // namespace roomtex
