#include "core/partial_path.h"

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <map>
#include <mutex>
#include <set>
#include <system_error>
#include <vector>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/set_journal.h"
#include "core/text.h"

namespace roomtex {
namespace fs = std::filesystem;
namespace {

constexpr size_t kLongestExtension = 16;

// What this process is making, and the folders that it has tidied up.
std::mutex paths_mutex;
std::map<std::string, int>& LivingPaths() {  // with the descriptor that locks it
  static std::map<std::string, int> paths;
  return paths;
}
std::set<std::string>& TidyFolders() {
  static std::set<std::string> folders;
  return folders;
}
std::recursive_mutex commit_mutex;

std::string RandomDigits() {
  unsigned char bytes[8];
  size_t filled = 0;
  while (filled < sizeof(bytes)) {
    const ssize_t count = getrandom(bytes + filled, sizeof(bytes) - filled, 0);
    if (count < 0 && errno != EINTR) throw std::system_error(errno, std::generic_category());
    filled += static_cast<size_t>(std::max<ssize_t>(count, 0));
  }
  std::string digits;
  for (const unsigned char byte : bytes) {
    digits += "0123456789abcdef"[byte >> 4];
    digits += "0123456789abcdef"[byte & 15];
  }
  return digits;
}

int OpenToLock(const std::string& path) {
  return open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
}

// The path still is what the descriptor was opened as.
bool IsStill(int descriptor, const std::string& path) {
  struct stat opened {
  }, there{};
  return fstat(descriptor, &opened) == 0 && lstat(path.c_str(), &there) == 0 &&
         opened.st_ino == there.st_ino && opened.st_dev == there.st_dev;
}

void Lock(int descriptor) {
  while (flock(descriptor, LOCK_EX) != 0 && errno == EINTR) {
  }
}

// Removes what a killed process left, once finish() has moved what is to be kept of it and says so.
// Whether nothing is left of it; false also if it belongs to a living process.
template <typename Finish>
bool TidyUp(const std::string& path, const Finish& finish) {
  const int descriptor = OpenToLock(path);
  if (descriptor < 0) return errno == ENOENT;
  std::error_code error;
  const bool goes =
      flock(descriptor, LOCK_EX | LOCK_NB) == 0 && IsStill(descriptor, path) && finish();
  if (goes) fs::remove_all(path, error);
  close(descriptor);
  return goes && !error;
}

// What moves the sets of one folder may bring further ones there: the record of others.
constexpr int kMostRounds = 4;

class Leftovers {
 public:
  void Tidy(const std::string& folder) {
    if (!tidied_.insert(folder).second) return;
    std::set<std::string> seen;
    for (int round = 0; round < kMostRounds; ++round) {
      bool is_new = false;
      for (const std::string& path : PartialsIn(folder)) {
        if (!seen.insert(path).second) continue;
        is_new = true;
        TidyOne(path);
      }
      if (!is_new) return;
    }
  }
  // What stays although it should be moved.
  const std::vector<std::string>& stuck() const { return stuck_; }

 private:
  static std::vector<std::string> PartialsIn(const std::string& folder) {
    std::error_code error;
    std::vector<std::string> paths;
    fs::directory_iterator entry(folder, error), end;
    for (; !error && entry != end; entry.increment(error)) {
      const std::string name = entry->path().filename().string();
      if (BeginsWith(name, kPartialPrefix)) paths.push_back(entry->path().string());
    }
    return paths;
  }

  void TidyOne(const std::string& path) {
    std::error_code error;
    if (!fs::is_directory(fs::symlink_status(path, error))) {
      TidyUp(path, [&] { return FinishSetsOf(path); });
      return;
    }
    // The record may still lie in a set that was to bring it.
    const std::string record = RecordWaitedFor(path);
    if (!record.empty() && !fs::exists(record, error)) Tidy(fs::path(record).parent_path());
    TidyUp(path, [&] { return FinishSet(path); });
  }

  bool FinishSet(const std::string& set) {
    const int failure = FinishMovedSet(set, JournalOrigin::kFound);
    if (failure > 0) {
      stuck_.push_back(set + ": finished files of an earlier run, which cannot be moved to their " +
                       "places (" + std::generic_category().message(failure) +
                       "); the next command that works there tries again");
    }
    return failure == 0;
  }

  // Moves the sets that wait for this file, if it is a commit record; whether it may go then.
  bool FinishSetsOf(const std::string& path) {
    const auto sets = ReadCommitRecord(path);
    if (!sets) return true;
    std::error_code error;
    const std::string record = fs::canonical(path, error).string();
    bool may_go = true;
    for (const std::string& set : *sets) {
      if (!BeginsWith(fs::path(set).filename().string(), kPartialPrefix)) continue;
      if (RecordWaitedFor(set) == record) may_go &= TidyUp(set, [&] { return FinishSet(set); });
    }
    return may_go;
  }

  std::set<std::string> tidied_;
  std::vector<std::string> stuck_;
};

}  // namespace

std::string PartialName() { return kPartialPrefix + RandomDigits(); }

std::string MakePartial(const std::string& parent, PartialKind kind, const std::string& extension) {
  const std::string folder = parent.empty() ? "." : parent;
  std::unique_lock<std::mutex> lock(paths_mutex);
  if (TidyFolders().insert(folder).second) {
    lock.unlock();
    RemoveLeftovers(folder);
    lock.lock();
  }
  const std::string start = folder == "." ? "" : folder.back() == '/' ? folder : folder + "/";
  for (;;) {
    const std::string path =
        start + PartialName() + (extension.size() > kLongestExtension ? "" : extension);
    int descriptor = -1;
    if (kind == PartialKind::kFile) {
      descriptor = open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
    } else if (mkdir(path.c_str(), 0777) == 0) {
      descriptor = OpenToLock(path);
    }
    if (descriptor < 0 && errno == EEXIST) continue;
    if (descriptor < 0) throw std::system_error(errno, std::generic_category());
    Lock(descriptor);
    // Between making and locking, another command may have taken it for a leftover.
    if (IsStill(descriptor, path)) {
      LivingPaths()[path] = descriptor;
      return path;
    }
    close(descriptor);
  }
}

void ReleasePartial(const std::string& path) {
  const std::lock_guard<std::mutex> lock(paths_mutex);
  const auto found = LivingPaths().find(path);
  if (found == LivingPaths().end()) return;
  close(found->second);
  LivingPaths().erase(found);
}

void RemovePartial(const std::string& path) {
  if (path.empty()) return;
  std::error_code ignored;
  fs::remove_all(path, ignored);
  ReleasePartial(path);
}

void PartialFolder::MoveInto(const std::string& parent) {
  const std::string moved = (fs::path(parent) / fs::path(path_).filename()).string();
  const std::lock_guard<std::mutex> lock(paths_mutex);
  fs::rename(path_, moved);
  LivingPaths()[moved] = LivingPaths()[path_];
  LivingPaths().erase(path_);
  path_ = moved;
}

bool IsPartial(const std::string& path) { return path.find(kPartialPrefix) != std::string::npos; }

std::vector<std::string> RemoveLeftovers(const std::string& folder) {
  Leftovers leftovers;
  leftovers.Tidy(folder.empty() ? "." : folder);
  return leftovers.stuck();
}

void RemoveAllPartials() {
  commit_mutex.lock();  // for good: what ends now begins no move
  paths_mutex.lock();
  for (const auto& [path, descriptor] : LivingPaths()) {
    // Other threads may still be writing into it.
    for (int attempt = 0; attempt < 3; ++attempt) {
      std::error_code error;
      fs::remove_all(path, error);
      if (!error) break;
    }
  }
}

CommitLock::CommitLock() { commit_mutex.lock(); }
CommitLock::~CommitLock() { commit_mutex.unlock(); }

}  // namespace roomtex
