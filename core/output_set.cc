#include "core/output_set.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>
#include <sys/xattr.h>
#include <unistd.h>

#include "core/disk_sync.h"
#include "core/error.h"
#include "core/input_guard.h"
#include "core/json_text.h"
#include "core/output_file.h"
#include "core/set_journal.h"
#include "core/text.h"

namespace roomtex {
namespace fs = std::filesystem;
namespace {

InputError CannotBeFilled(const std::string& folder, const std::string& reason) {
  return {folder, "", "cannot be written into (" + reason + ")",
          "Check the rights of this folder and the space on the disk"};
}

bool IsPartialName(const std::string& name) { return BeginsWith(name, kPartialPrefix); }

// A folder that changes places must be an ordinary one: where somebody works in it, where another
// disk begins or where access lists hang on it, it stays.
bool MayChangePlaces(const fs::path& folder) {
  struct stat here {
  }, above{};
  if (stat(folder.c_str(), &here) != 0 || stat(folder.parent_path().c_str(), &above) != 0) {
    return false;
  }
  std::error_code error;
  const std::string work = fs::current_path(error).string() + "/";
  const bool works_here = error || BeginsWith(work, folder.string() + "/");
  const bool has_lists = getxattr(folder.c_str(), "system.posix_acl_default", nullptr, 0) > 0 ||
                         getxattr(folder.c_str(), "system.posix_acl_access", nullptr, 0) > 0;
  return here.st_dev == above.st_dev && !works_here && !has_lists &&
         ::access(folder.parent_path().c_str(), W_OK | X_OK) == 0;
}

// Paths below the folder of all that is no folder; none if it is a link to one.
std::vector<std::string> FilesBelow(const fs::path& folder) {
  std::vector<std::string> files;
  std::error_code error;
  if (fs::is_symlink(folder, error)) return files;
  fs::recursive_directory_iterator entry(folder, error), end;
  for (; !error && entry != end; entry.increment(error)) {
    if (entry->is_directory(error) && !entry->is_symlink(error)) continue;
    files.push_back(entry->path().lexically_relative(folder).generic_string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

// Gives the new folder what only the old one has: a second name of the same file, not a copy.
// False where that is not possible.
class Keeping {
 public:
  Keeping(fs::path from, fs::path to, const std::set<std::string>& replaced,
          const std::set<std::string>& removed)
      : from_(std::move(from)), to_(std::move(to)), replaced_(replaced), removed_(removed) {}

  bool Link(const fs::path& below = {}) const {
    std::error_code error;
    fs::directory_iterator entry(from_ / below, error), end;
    for (; !error && entry != end; entry.increment(error)) {
      const fs::path path = below / entry->path().filename();
      const std::string name = path.generic_string();
      if (removed_.count(name) > 0 || replaced_.count(name) > 0) continue;
      if (!LinkOne(path, entry->symlink_status(error).type())) return false;
    }
    return !error;
  }

 private:
  bool LinkOne(const fs::path& path, fs::file_type type) const {
    std::error_code error;
    const fs::file_status there = fs::symlink_status(to_ / path, error);
    if (type == fs::file_type::directory) {
      // Something of another command is being made in it.
      if (IsPartialName(path.filename().string())) return false;
      if (fs::exists(there)) return !fs::is_directory(there) || Link(path);
      fs::create_directory(to_ / path, from_ / path, error);
      return !error && Link(path);
    }
    if (fs::exists(there)) return true;
    if (type == fs::file_type::symlink) {
      fs::copy_symlink(from_ / path, to_ / path, error);
    } else if (type == fs::file_type::regular) {
      fs::create_hard_link(from_ / path, to_ / path, error);
    } else {
      return false;
    }
    return !error;
  }

  fs::path from_, to_;
  const std::set<std::string>&replaced_, &removed_;
};

std::vector<SetWithReport>& SetsWithReport() {
  static std::vector<SetWithReport> sets;
  return sets;
}

}  // namespace

void OutputSet::ReplaceAllOf(const std::string& command) {
  std::error_code error;
  std::vector<fs::directory_entry> old;
  for (fs::directory_iterator entry(folder_, error), end; !error && entry != end;
       entry.increment(error)) {
    // The set itself may lie there, and what others are making.
    if (!IsPartialName(entry->path().filename().string())) old.push_back(*entry);
  }
  const Json report = old.empty() ? Json() : ReadJsonIfAny(folder_ + "/report.json");
  const auto named = report.is_object() ? report.find("command") : report.end();
  if (!old.empty() && (!report.is_object() || named == report.end() || *named != command)) {
    throw InputError(folder_, "", "holds files that " + command + " did not write",
                     "Move it away or give another --output_path");
  }
  const Json written = report.is_object() ? report.value("entries", Json()) : Json();
  for (const fs::directory_entry& entry : old) {
    const std::string name = entry.path().filename().string();
    if (!written.is_array() || std::count(written.begin(), written.end(), Json(name)) > 0) continue;
    throw InputError(folder_, "", "holds " + name + ", which " + command + " did not write",
                     "Move it away or give another --output_path");
  }
  for (const fs::directory_entry& entry : old) {
    const bool is_folder = fs::is_directory(entry.symlink_status(error));
    (is_folder ? replaced_ : removed_).insert(entry.path().filename().string());
  }
}

void CommitWithReport(const std::string& report_name, std::shared_ptr<OutputSet> set) {
  SetsWithReport().push_back({report_name, std::move(set)});
}

void CommitAtEnd(std::shared_ptr<OutputSet> set) { CommitWithReport("", std::move(set)); }

std::vector<SetWithReport> TakeSetsWithReport() { return std::exchange(SetsWithReport(), {}); }

bool ChangePlaces(const std::string& finished, const std::string& target) {
  if (renameat2(AT_FDCWD, finished.c_str(), AT_FDCWD, target.c_str(), RENAME_EXCHANGE) == 0) {
    return true;
  }
  return errno == ENOENT && std::rename(finished.c_str(), target.c_str()) == 0;
}

OutputSet::OutputSet(const std::string& folder) : folder_(folder), record_(PartialName()) {
  MakeFolder(folder);
  try {
    place_ = fs::canonical(folder).string();
    const std::string beside =
        MayChangePlaces(place_) ? fs::path(place_).parent_path().string() : place_;
    RemoveLeftovers(place_);
    aside_ = std::make_unique<PartialFolder>(beside);
  } catch (const std::system_error& error) {
    throw CannotBeFilled(folder, error.code().message());
  }
}

OutputSet::~OutputSet() = default;

std::vector<std::string> OutputSet::Entries() const {
  std::vector<std::string> names = {"report.json"};
  std::error_code error;
  for (fs::directory_iterator entry(aside(), error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name != names[0]) names.push_back(name);
  }
  std::sort(names.begin(), names.end());
  return names;
}

// A file of the user's does not make room for a folder.
void OutputSet::RequireFoldersTo(const std::string& name) const {
  fs::path below;
  for (const fs::path& part : fs::path(name).parent_path()) {
    below /= part;
    const std::string path = (fs::path(folder_) / below).string();
    std::error_code error;
    const fs::file_status status = fs::status(path, error);
    if (!fs::exists(status) || fs::is_directory(status)) continue;
    if (removed_.count(below.generic_string()) > 0) continue;
    throw InputError(path, "", "is not a folder, and one is to be written there",
                     "Move it away or give another folder");
  }
}

std::string OutputSet::Path(const std::string& name) {
  RequireFoldersTo(name);
  RequireReplaceable((fs::path(folder_) / name).string());
  const fs::path path = fs::path(aside()) / name;
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  if (error) throw CannotBeFilled(folder_, error.message());
  names_.push_back(name);
  return path.string();
}

std::string OutputSet::NameOf(const std::string& path) const {
  std::error_code error;
  const fs::path absolute = fs::absolute(path, error);
  // A link at the end would be replaced, not followed.
  const fs::path parent = fs::weakly_canonical(absolute.parent_path(), error);
  const fs::path name = (parent / absolute.filename()).lexically_relative(place_);
  return error || name.empty() || *name.begin() == ".." ? "" : name.string();
}

bool OutputSet::WillHold(const std::string& path) const {
  const std::string name = NameOf(path);
  std::error_code error;
  return !name.empty() && fs::is_regular_file(fs::path(aside()) / name, error);
}

std::vector<std::string> OutputSet::Check() const {
  std::vector<std::string> files = FilesBelow(aside());
  for (const std::string& name : files) {
    RequireFoldersTo(name);
    RequireReplaceable((fs::path(folder_) / name).string());
  }
  for (const std::string& name : removed_) {
    RefuseToReplaceInput((fs::path(folder_) / name).string());
  }
  for (const std::string& name : replaced_) {
    for (const std::string& file : FilesBelow(fs::path(folder_) / name)) {
      RefuseToReplaceInput((fs::path(folder_) / name / file).string());
    }
  }
  return files;
}

bool OutputSet::Exchange() {
  if (!MayChangePlaces(place_)) return false;
  if (!Keeping(place_, aside(), replaced_, removed_).Link()) return false;
  struct stat old {};
  if (stat(place_.c_str(), &old) != 0) return false;
  (void)!chown(aside().c_str(), old.st_uid, old.st_gid);
  if (chmod(aside().c_str(), old.st_mode & 07777) != 0) return false;
  SyncFoldersBelow(aside());
  if (renameat2(AT_FDCWD, aside().c_str(), AT_FDCWD, place_.c_str(), RENAME_EXCHANGE) != 0) {
    return false;
  }
  // What came into the old folder in the last moment.
  (void)Keeping(aside(), place_, replaced_, removed_).Link();
  try {
    SyncFolder(fs::path(place_).parent_path());
  } catch (const std::system_error&) {
    // It is there all the same.
  }
  return true;
}

void OutputSet::MoveOneByOne(const std::vector<std::string>& files) {
  SetJournal journal;
  const auto is_of_set = [&](const std::string& name) {
    return std::binary_search(files.begin(), files.end(), name);
  };
  // What waits for the record can be moved as soon as it is there.
  if (is_of_set(record_)) journal.moves.push_back(record_);
  for (const std::string& name : files) {
    if (name != record_) journal.moves.push_back(name);
  }
  for (const std::string& name : removed_) {
    if (!is_of_set(name)) journal.removes.push_back(name);
  }
  for (const std::string& name : replaced_) {
    for (const std::string& file : FilesBelow(fs::path(place_) / name)) {
      const std::string path = name + "/" + file;
      if (!is_of_set(path)) journal.removes.push_back(path);
    }
  }
  // What could not be linked to its end is no part of the set.
  if (fs::path(aside()).parent_path() != fs::path(place_)) aside_->MoveInto(place_);
  SyncFoldersBelow(aside());
  WriteSetJournal(journal, aside());
  const int failure = FinishMovedSet(aside(), JournalOrigin::kOurs);
  if (failure == 0) return;
  stays_ = true;
  const std::string where = aside();
  aside_->Keep();
  throw CannotBeFilled(folder_, std::string(std::strerror(failure)) +
                                    "; what is not there yet is kept in " + where +
                                    ", and the next command that writes there moves it");
}

void OutputSet::Commit(const std::vector<std::string>& waiting) {
  std::vector<std::string> files = Check();
  try {
    SyncFiles(aside(), files);
    if (!waiting.empty()) WriteCommitRecord(waiting, aside() + "/" + record_);
    files = Check();
    const CommitLock lock;
    if (!Exchange()) MoveOneByOne(files);
  } catch (const std::system_error& error) {
    throw CannotBeFilled(folder_, error.code().message());
  }
  for (const std::string& name : files) NoteOutput((fs::path(folder_) / name).string());
  aside_.reset();
}

}  // namespace roomtex
