#pragma once
// Files that belong together appear together.

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "core/partial_path.h"

namespace roomtex {

// Files being written for a folder. They are made in a folder beside it; Commit() puts that one in
// the place of the old folder in one step (renameat2), with everything else that the old one holds.
// So a run that is killed, at whatever moment, leaves all files as they were or all new ones. Where
// folders cannot change places (a mount point, no rights beside it, no such call), the files are
// moved one by one, and what a run killed meanwhile has not moved, or could not move, the next one
// moves.
class OutputSet {
 public:
  // Makes the folder. Throws InputError if nothing can be written there.
  explicit OutputSet(const std::string& folder);
  ~OutputSet();  // removes what was not committed
  OutputSet(const OutputSet&) = delete;
  OutputSet& operator=(const OutputSet&) = delete;

  // Where to write the file that will be folder/name; makes the folders of the name. UsageError if
  // it is an input of this command, InputError if it cannot be replaced.
  std::string Path(const std::string& name);
  // The folder in which all is written; files put there without Path() belong to the set, too.
  const std::string& aside() const { return aside_->path(); }
  // What the old folder `name` holds is not kept.
  void ReplaceFolder(const std::string& name) { replaced_.insert(name); }
  // The old file `name` is not kept.
  void Remove(const std::string& name) { removed_.insert(name); }
  // Nothing of the old folder is kept, but what other runs are making there. Throws InputError
  // unless it is missing, empty, or what this command left there (its report.json names the
  // command, and as `entries` what Entries() gave): what is not ours stays.
  void ReplaceAllOf(const std::string& command);
  // The files and folders of the set, without what lies in the folders, and report.json.
  std::vector<std::string> Entries() const;

  // How the path is called in the folder; "" = it lies elsewhere.
  std::string NameOf(const std::string& path) const;
  // Whether Commit() will put a file there.
  bool WillHold(const std::string& path) const;
  // In the order of the calls of Path().
  const std::vector<std::string>& names() const { return names_; }
  const std::string& folder() const { return folder_; }

  // The files of the set. Throws InputError or UsageError if one cannot be replaced.
  std::vector<std::string> Check() const;
  // Throws as Check() does before anything is moved. With `waiting`, folders of files elsewhere
  // that belong to this set (CommitTogether), a commit record of them at RecordPath() comes with
  // it; the caller moves them and removes it. If only some files could be moved it throws, too, and
  // keeps the others for the next command: stays() is true then, and the set counts as committed.
  void Commit(const std::vector<std::string>& waiting = {});
  bool stays() const { return stays_; }
  std::string RecordPath() const { return place_ + "/" + record_; }

 private:
  void RequireFoldersTo(const std::string& name) const;
  bool Exchange();
  void MoveOneByOne(const std::vector<std::string>& files);

  std::string folder_, place_;  // place_: the folder without links
  const std::string record_;    // its name
  std::unique_ptr<PartialFolder> aside_;
  std::vector<std::string> names_;
  std::set<std::string> replaced_, removed_;
  bool stays_ = false;
};

// The report of this command is the last file of the set: Command::Run writes it and commits, once
// the command has run to its end (exit 0 or 4); otherwise nothing of the set appears.
struct SetWithReport {
  std::string report_name;
  std::shared_ptr<OutputSet> set;
};
void CommitWithReport(const std::string& report_name, std::shared_ptr<OutputSet> set);
// The same for a set that holds no report: report_name is "".
void CommitAtEnd(std::shared_ptr<OutputSet> set);
// For Command::Run: all that were named since the last call.
std::vector<SetWithReport> TakeSetsWithReport();

// Puts the folder or file `finished` in the place of `target`, which may be missing, in one step;
// what stood there is at `finished` afterwards. False if this is not possible here.
bool ChangePlaces(const std::string& finished, const std::string& target);

}  // namespace roomtex
