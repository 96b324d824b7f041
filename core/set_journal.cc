#include "core/set_journal.h"

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/stays_inside.h"

namespace roomtex {
namespace fs = std::filesystem;
namespace {

// No file of a command has this name.
constexpr char kJournalName[] = ".roomtex-journal";
constexpr char kRecordHead[] = "roomtex commit record\n";

// An entry of a list or record: what it is ('m', 'r', 'w'; 's' = a set), the path, a zero byte.
// Behind the last one stands an 'e'.
using Entry = std::pair<char, std::string>;

void WriteEntries(const std::vector<Entry>& entries, std::string text, const std::string& path,
                  int flags) {
  for (const auto& [kind, name] : entries) text += kind + name + '\0';
  text += 'e';
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_NOFOLLOW | O_CLOEXEC | flags, 0600);
  const ssize_t size = file >= 0 ? write(file, text.data(), text.size()) : -1;
  const bool cut = size >= 0 && size < static_cast<ssize_t>(text.size());
  const bool written = size >= 0 && !cut && fsync(file) == 0;
  const int error = cut ? ENOSPC : errno;
  if (file >= 0) close(file);
  if (!written) throw std::system_error(error, std::generic_category());
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

}  // namespace

void WriteSetJournal(const SetJournal& journal, const std::string& set) {
  std::vector<Entry> entries;
  if (!journal.waits_for.empty()) entries.emplace_back('w', journal.waits_for);
  for (const std::string& path : journal.moves) entries.emplace_back('m', path);
  for (const std::string& path : journal.removes) entries.emplace_back('r', path);
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

int FinishMovedSet(const std::string& set, JournalOrigin origin) {
  const bool found = origin == JournalOrigin::kFound;
  if (found && IsOfAnother(set + "/" + kJournalName)) return EPERM;
  const std::optional<SetJournal> journal = ReadSetJournal(set);
  if (!journal) return found ? 0 : ENOENT;
  // Our own record need not be looked at: where files belong to whom the disk says, not to who
  // makes them (network disks, FAT), it would pass for another user's.
  if (found && !journal->waits_for.empty() && !ReadCommitRecord(journal->waits_for)) return 0;
  const fs::path from(set), to = from.parent_path();
  int failure = 0;
  // Whoever wrote a name that leads elsewhere wants to reach other files.
  const auto stays = [&](const std::string& path) {
    const bool through_links =
        found && (LeadsThroughLinks(to, path) || LeadsThroughLinks(from, path));
    return !path.empty() && StaysInside(path) && !through_links;
  };
  std::error_code error, ignored;
  const std::set<std::string> moves(journal->moves.begin(), journal->moves.end());
  for (const std::string& path : journal->removes) {
    error.clear();
    if (stays(path) && moves.count(path) == 0) fs::remove(to / path, error);
    if (error && failure == 0) failure = error.value();
  }
  for (const std::string& path : journal->moves) {
    if (!stays(path)) continue;
    if (!fs::exists(fs::symlink_status(from / path, ignored))) {
      if (!found && failure == 0) failure = ENOENT;
      continue;
    }
    fs::create_directories((to / path).parent_path(), ignored);
    fs::rename(from / path, to / path, error);
    if (error && failure == 0) failure = error.value();
  }
  return failure;
}

}  // namespace roomtex
