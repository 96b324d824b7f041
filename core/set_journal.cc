#include "core/set_journal.h"

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <system_error>
#include <tuple>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/disk_sync.h"
#include "core/stays_inside.h"
#include "core/text.h"

namespace roomtex {
namespace fs = std::filesystem;
namespace {

// No file of a command has this name.
constexpr char kJournalName[] = ".roomtex-journal";
constexpr char kRecordHead[] = "roomtex commit record\n";

// An entry of a list or record: what it is ('m', 'r', 'w'; 's' = a set), the path, a zero byte.
// Behind the last one stands an 'e'.
using Entry = std::pair<char, std::string>;

// 0, or the error.
int WriteWhole(int file, const std::string& text) {
  for (size_t done = 0; done < text.size();) {
    const ssize_t count = write(file, text.data() + done, text.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return count < 0 ? errno : ENOSPC;
    done += static_cast<size_t>(count);
  }
  return fsync(file) == 0 ? 0 : errno;
}

void WriteEntries(const std::vector<Entry>& entries, std::string text, const std::string& path,
                  int flags) {
  for (const auto& [kind, name] : entries) text += kind + name + '\0';
  text += 'e';
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_NOFOLLOW | O_CLOEXEC | flags, 0600);
  if (file < 0) throw std::system_error(errno, std::generic_category());
  const int error = WriteWhole(file, text);
  close(file);
  try {
    if (error != 0) throw std::system_error(error, std::generic_category());
    SyncFolder(fs::path(path).parent_path().string());
  } catch (const std::system_error&) {
    unlink(path.c_str());  // it may be whole all the same
    throw;
  }
}

// None unless the file is whole.
std::optional<std::vector<Entry>> ReadEntries(const std::string& path, const std::string& head) {
  std::error_code error;
  if (!fs::is_regular_file(fs::symlink_status(path, error))) return std::nullopt;
  std::ifstream stream(path, std::ios::binary);
  std::string text(head.size(), '\0');
  if (!stream.read(text.data(), static_cast<std::streamsize>(head.size())) || text != head) {
    return std::nullopt;
  }
  text.assign(std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>());
  // Not a path that was cut off behind an e.
  if (text.empty() || text.back() != 'e') return std::nullopt;
  if (text.size() > 1 && text[text.size() - 2] != '\0') return std::nullopt;
  std::vector<Entry> entries;
  for (size_t begin = 0; begin + 1 < text.size();) {
    const size_t end = text.find('\0', begin);
    if (end == std::string::npos) break;
    entries.emplace_back(text[begin], text.substr(begin + 1, end - begin - 1));
    begin = end + 1;
  }
  return entries;
}

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

// Does what a list says.
class SetMover {
 public:
  SetMover(const std::string& set, const SetJournal& journal, JournalOrigin origin)
      : from_(set), to_(from_.parent_path()), journal_(journal), origin_(origin) {
    (void)lstat((set + "/" + kJournalName).c_str(), &list_);
  }

  int Finish() {
    const std::set<std::string> moves(journal_.moves.begin(), journal_.moves.end());
    for (const std::string& path : journal_.removes) {
      // A folder of the set comes into the place of the file.
      const auto below = moves.lower_bound(path + "/");
      if (below != moves.end() && BeginsWith(*below, path + "/")) Remove(path);
    }
    for (const std::string& path : journal_.moves) Move(path);
    if (failure_ != 0) return failure_;  // nothing old goes before all new is there
    for (const std::string& path : journal_.removes) {
      if (moves.count(path) == 0) Remove(path);
    }
    try {
      for (const fs::path& folder : changed_) SyncFolder(folder.string());
    } catch (const std::system_error& error) {
      Note(error.code());
    }
    return failure_;
  }

 private:
  void Note(const std::error_code& error) {
    if (error && failure_ == 0) failure_ = error.value();
  }

  // Whoever wrote a name that leads elsewhere wants to reach other files.
  bool Stays(const std::string& path) const {
    if (path.empty() || !StaysInside(path)) return false;
    return origin_ == JournalOrigin::kOurs ||
           !(LeadsThroughLinks(to_, path) || LeadsThroughLinks(from_, path));
  }

  // Written by somebody after the run was killed: not lost.
  bool IsNewerThanList(const fs::path& path) const {
    struct stat there {};
    if (origin_ == JournalOrigin::kOurs || lstat(path.c_str(), &there) != 0) return false;
    return S_ISREG(there.st_mode) && std::tie(there.st_mtim.tv_sec, there.st_mtim.tv_nsec) >
                                         std::tie(list_.st_mtim.tv_sec, list_.st_mtim.tv_nsec);
  }

  void NoteFoldersTo(const fs::path& path) {
    for (fs::path way = path.parent_path(); !way.empty(); way = way.parent_path()) {
      changed_.insert(to_ / way);
    }
    changed_.insert(to_);
  }

  void Move(const std::string& path) {
    std::error_code error, ignored;
    if (!Stays(path)) return;
    if (origin_ == JournalOrigin::kFound && !fs::exists(fs::symlink_status(from_ / path, ignored)))
      return;  // has been moved
    fs::create_directories((to_ / path).parent_path(), ignored);
    if (IsNewerThanList(to_ / path)) fs::rename(to_ / path, to_ / (path + ".other"), ignored);
    fs::rename(from_ / path, to_ / path, error);
    Note(error);
    NoteFoldersTo(path);
  }

  void Remove(const std::string& path) {
    std::error_code error;
    if (!Stays(path) || fs::is_directory(fs::symlink_status(to_ / path, error))) return;
    if (IsNewerThanList(to_ / path)) return;
    fs::remove(to_ / path, error);
    Note(error);
    NoteFoldersTo(path);
  }

  const fs::path from_, to_;
  const SetJournal& journal_;
  const JournalOrigin origin_;
  struct stat list_ {};
  std::set<fs::path> changed_;
  int failure_ = 0;
};

}  // namespace

void WriteSetJournal(const SetJournal& journal, const std::string& set) {
  std::vector<Entry> entries;
  if (!journal.waits_for.empty()) entries.emplace_back('w', journal.waits_for);
  for (const std::string& path : journal.moves) entries.emplace_back('m', path);
  for (const std::string& path : journal.removes) entries.emplace_back('r', path);
  SyncFolder(fs::path(set).parent_path().string());
  WriteEntries(entries, "", set + "/" + kJournalName, O_EXCL);
}

std::optional<SetJournal> ReadSetJournal(const std::string& set) {
  const auto entries = ReadEntries(set + "/" + kJournalName, "");
  if (!entries) return std::nullopt;
  SetJournal journal;
  for (const auto& [kind, path] : *entries) {
    if (kind == 'w') journal.waits_for = path;
    if (kind == 'm') journal.moves.push_back(path);
    if (kind == 'r') journal.removes.push_back(path);
  }
  return journal;
}

void WriteCommitRecord(const std::vector<std::string>& sets, const std::string& path) {
  std::vector<Entry> entries;
  for (const std::string& set : sets) entries.emplace_back('s', set);
  WriteEntries(entries, kRecordHead, path, O_TRUNC);
}

std::optional<std::vector<std::string>> ReadCommitRecord(const std::string& path) {
  if (IsOfAnother(path)) return std::nullopt;
  const auto entries = ReadEntries(path, kRecordHead);
  if (!entries) return std::nullopt;
  std::vector<std::string> sets;
  for (const auto& [kind, set] : *entries) sets.push_back(set);
  return sets;
}

std::string RecordWaitedFor(const std::string& set) {
  if (IsOfAnother(set + "/" + kJournalName)) return "";
  const std::optional<SetJournal> journal = ReadSetJournal(set);
  return journal ? journal->waits_for : "";
}

int FinishMovedSet(const std::string& set, JournalOrigin origin) {
  const bool found = origin == JournalOrigin::kFound;
  const std::string list = set + "/" + kJournalName;
  if (found && IsOfAnother(list)) return kOfAnotherUser;
  const std::optional<SetJournal> journal = ReadSetJournal(set);
  if (!journal) {
    if (!found) return ENOENT;
    return access(list.c_str(), F_OK) == 0 && access(list.c_str(), R_OK) != 0 ? errno : 0;
  }
  if (found && !journal->waits_for.empty()) {
    if (IsOfAnother(journal->waits_for)) return EPERM;
    if (!ReadCommitRecord(journal->waits_for)) return 0;
  }
  return SetMover(set, *journal, origin).Finish();
}

}  // namespace roomtex
