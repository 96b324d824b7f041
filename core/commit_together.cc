#include "core/commit_together.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <exception>
#include <filesystem>
#include <map>
#include <optional>
#include <system_error>
#include <utility>

#include "core/disk_sync.h"
#include "core/error.h"
#include "core/input_guard.h"
#include "core/output_set.h"
#include "core/partial_path.h"
#include "core/set_journal.h"

namespace roomtex {
namespace fs = std::filesystem;
namespace {

std::atomic<CommitTogether*> living{nullptr};

InputError CannotBeReplaced(const std::string& path, const std::string& reason) {
  return {path, "", "cannot be replaced (" + reason + ")", "Check that you may write this file"};
}

void Rename(const std::string& from, const fs::path& to, const std::string& path) {
  std::error_code error;
  fs::rename(from, to, error);
  if (error) throw CannotBeReplaced(path, error.message());
  ReleasePartial(from);
}

fs::path PlaceOf(const std::string& path) {
  std::error_code error;
  const fs::path absolute = fs::absolute(path, error);
  return fs::weakly_canonical(absolute.parent_path(), error) / absolute.filename();
}

std::unique_ptr<CommitTogether>& AtEnd() {
  static std::unique_ptr<CommitTogether> files;
  return files;
}

}  // namespace

// Files of one folder on their way to it.
struct CommitTogether::Folder {
  std::vector<WholeFile> files;
  std::unique_ptr<PartialFolder> aside;

  // Throws InputError, and keeps them, if they could not be moved.
  void Move() const {
    const int failure = FinishMovedSet(aside->path(), JournalOrigin::kOurs);
    if (failure == 0) {
      for (const WholeFile& file : files) NoteOutput(file.path);
      return;
    }
    const std::string where = aside->path();
    aside->Keep();
    throw CannotBeReplaced(files.front().path,
                           std::string(std::strerror(failure)) +
                               "; what is not there yet is kept in " + where +
                               ", and the next command that writes there moves it");
  }
};

void MoveToPlace(const WholeFile& file) {
  const CommitLock lock;
  Rename(file.partial_path, file.target, file.path);
  NoteOutput(file.path);
  if (IsPartial(file.target)) return;  // its set brings all names to the disk
  try {
    SyncFolder(fs::path(file.target).parent_path().string());
  } catch (const std::system_error& error) {
    throw CannotBeReplaced(file.path, error.code().message());
  }
}

CommitTogether::CommitTogether() { living = this; }

CommitTogether::~CommitTogether() {
  living = nullptr;
  for (const WholeFile& file : files_) RemovePartial(file.partial_path);
}

bool CommitTogether::Take(const WholeFile& file) {
  CommitTogether* const taking = living;
  if (taking == nullptr || IsPartial(file.target)) return false;
  const std::lock_guard<std::mutex> lock(taking->mutex_);
  taking->files_.push_back(file);
  return true;
}

bool CommitTogether::Holds(const std::string& path) const {
  const fs::path place = PlaceOf(path);
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::any_of(files_.begin(), files_.end(),
                     [&](const WholeFile& file) { return PlaceOf(file.target) == place; });
}

void CommitTogether::GiveToSets(const std::vector<std::shared_ptr<OutputSet>>& sets) {
  for (const auto& set : sets) {
    const auto is_of_set = [&](const WholeFile& file) {
      const std::string name = set->NameOf(file.target);
      if (name.empty()) return false;
      Rename(file.partial_path, set->Path(name), file.path);
      return true;
    };
    files_.erase(std::remove_if(files_.begin(), files_.end(), is_of_set), files_.end());
  }
}

std::vector<CommitTogether::Folder> CommitTogether::MakeLists(const std::string& record) const {
  std::map<fs::path, std::vector<WholeFile>> files_of;
  for (const WholeFile& file : files_) files_of[PlaceOf(file.target).parent_path()].push_back(file);
  std::vector<Folder> folders;
  for (const auto& [parent, files] : files_of) {
    Folder& folder = folders.emplace_back();
    folder.files = files;
    folder.aside = std::make_unique<PartialFolder>(parent.string());
    SetJournal journal;
    journal.waits_for = record;
    for (const WholeFile& file : files) {
      const std::string name = fs::path(file.target).filename().string();
      Rename(file.partial_path, *folder.aside / name, file.path);
      journal.moves.push_back(name);
    }
    WriteSetJournal(journal, folder.aside->path());
  }
  return folders;
}

void CommitTogether::RequireAllReplaceable(
    const std::vector<std::shared_ptr<OutputSet>>& sets) const {
  for (const auto& set : sets) (void)set->Check();
  for (const WholeFile& file : files_) RequireReplaceable(file.path);
}

void CommitTogether::MoveAll(const std::vector<std::shared_ptr<OutputSet>>& sets) {
  RequireAllReplaceable(sets);
  // With a set its folder brings the record along.
  const std::string first = PlaceOf(files_.front().target).parent_path().string();
  std::optional<Partial> own_record;
  if (sets.empty()) own_record.emplace(first, PartialKind::kFile);
  const std::string record = sets.empty() ? own_record->path() : sets.back()->RecordPath();
  const std::vector<Folder> folders = MakeLists(record);
  std::vector<std::string> asides;
  for (const Folder& one : folders) asides.push_back(one.aside->path());
  const CommitLock lock;
  std::exception_ptr failure;  // the first one that all the rest is moved in spite of
  for (const auto& set : sets) {
    try {
      set->Commit(set == sets.back() ? asides : std::vector<std::string>());
    } catch (const InputError&) {
      if (!set->stays()) throw;
      if (!failure) failure = std::current_exception();
    }
  }
  if (sets.empty()) WriteCommitRecord(asides, record);
  bool record_may_go = true;
  for (const Folder& one : folders) {
    try {
      one.Move();
    } catch (const InputError&) {
      record_may_go = false;
      if (!failure) failure = std::current_exception();
    }
  }
  if (record_may_go) {
    RemovePartial(record);
  } else if (own_record) {
    own_record->Keep();
  }
  if (failure) std::rethrow_exception(failure);
}

void CommitTogether::Finish(const std::vector<std::shared_ptr<OutputSet>>& sets) {
  living = nullptr;
  GiveToSets(sets);
  if (files_.empty()) {
    if (sets.size() > 1) RequireAllReplaceable(sets);
    for (const auto& set : sets) set->Commit();
  } else if (sets.empty() && files_.size() == 1) {
    MoveToPlace(files_.front());
  } else {
    try {
      MoveAll(sets);
    } catch (const std::system_error& error) {
      throw CannotBeReplaced(files_.front().path, error.code().message());
    }
  }
  files_.clear();
}

void CommitFilesAtEnd() { AtEnd() = std::make_unique<CommitTogether>(); }

std::unique_ptr<CommitTogether> TakeFilesAtEnd() { return std::exchange(AtEnd(), nullptr); }

}  // namespace roomtex
