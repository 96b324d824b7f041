#include "core/set_journal.h"

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/stays_inside.h"

namespace roomtex {
namespace fs = std::filesystem;
namespace {

// No file of a command has this name.
constexpr char kJournalName[] = ".roomtex-journal";

bool IsOfAnother(const std::string& path) {
  struct stat there {};
  return lstat(path.c_str(), &there) == 0 && there.st_uid != geteuid();
}

// A folder on the way from `folder` to the file is a link.
bool LeadsThroughLinks(const fs::path& folder, const fs::path& path) {
  fs::path way = folder;
  std::error_code ignored;
  for (const fs::path& part : path.lexically_normal().parent_path()) {
    way /= part;
    if (fs::is_symlink(way, ignored)) return true;
  }
  return false;
}

}  // namespace

// Each entry: 'm' or 'r', the path, a zero byte; at the end an 'e'.
void WriteSetJournal(const SetJournal& journal, const std::string& set) {
  std::string text;
  for (const std::string& path : journal.moves) text += 'm' + path + '\0';
  for (const std::string& path : journal.removes) text += 'r' + path + '\0';
  text += 'e';
  const std::string path = set + "/" + kJournalName;
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  const bool written = file >= 0 &&
                       write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size()) &&
                       fsync(file) == 0;
  const int error = errno;
  if (file >= 0) close(file);
  if (!written) throw std::system_error(error, std::generic_category());
}

int FinishMovedSet(const std::string& set, JournalOrigin origin) {
  const std::string list = set + "/" + kJournalName;
  if (origin == JournalOrigin::kFound && IsOfAnother(list)) return EPERM;
  std::ifstream stream(list, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  if (text.empty() || text.back() != 'e') return 0;
  const fs::path from(set), to = from.parent_path();
  int failure = 0;
  for (size_t begin = 0; begin + 1 < text.size();) {
    const size_t end = text.find('\0', begin);
    if (end == std::string::npos) break;
    const std::string path = text.substr(begin + 1, end - begin - 1);
    std::error_code error, ignored;
    const bool through_links = origin == JournalOrigin::kFound &&
                               (LeadsThroughLinks(to, path) || LeadsThroughLinks(from, path));
    if (path.empty() || !StaysInside(path) || through_links) {
      // Whoever wrote this wants to reach other files.
    } else if (text[begin] == 'r') {
      fs::remove(to / path, error);
    } else if (fs::exists(fs::symlink_status(from / path, ignored))) {
      fs::create_directories((to / path).parent_path(), ignored);
      fs::rename(from / path, to / path, error);
    }
    if (error && failure == 0) failure = error.value();
    begin = end + 1;
  }
  return failure;
}

}  // namespace roomtex
