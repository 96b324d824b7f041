#pragma once
// Outputs of one answer appear together, also in several folders.

#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace roomtex {

class OutputSet;

// Made whole beside its place, not there yet.
struct WholeFile {
  std::string path;          // as the user named it
  std::string target;        // the same, absolute
  std::string partial_path;  // where it is (partial_path.h)
};
// Throws InputError for a file that cannot be replaced any more.
void MoveToPlace(const WholeFile& file);

// While this lives, files that OutputFile has made whole wait beside their places, those of an
// OutputSet excepted; Finish() puts all in their places, without it none appears. One at a time; a
// device is written to as before.
//
// More than one file cannot appear in one step. So each folder gets a list of what is to be moved
// (set_journal.h), and all lists wait for one commit record. From the moment when that is there, a
// killed run counts as done: what it has not moved, the next command moves that writes into one of
// these folders, and so it does with what could not be moved. A run killed before has changed
// nothing.
class CommitTogether {
 public:
  CommitTogether();
  ~CommitTogether();
  CommitTogether(const CommitTogether&) = delete;
  CommitTogether& operator=(const CommitTogether&) = delete;

  // A file of this path waits.
  bool Holds(const std::string& path) const;
  // With the sets, which appear first; the record comes with the last of them. A file that belongs
  // into the folder of a set becomes one of its files. Throws InputError or UsageError for what
  // cannot be replaced any more: then nothing appears; if only the moving failed, all the rest, and
  // the sentence says where the others are kept.
  void Finish(const std::vector<std::shared_ptr<OutputSet>>& sets = {});

  // For OutputFile: false if the file is to go to its place by itself.
  static bool Take(const WholeFile& file);

 private:
  struct Folder;
  void GiveToSets(const std::vector<std::shared_ptr<OutputSet>>& sets);
  void RequireAllReplaceable(const std::vector<std::shared_ptr<OutputSet>>& sets) const;
  std::vector<Folder> MakeLists(const std::string& record) const;
  void MoveAll(const std::vector<std::shared_ptr<OutputSet>>& sets);

  mutable std::mutex mutex_;
  std::vector<WholeFile> files_;
};

// From now on all outputs of this command appear at its end, with its sets and its report.
void CommitFilesAtEnd();
// For Command::Run: null if that was not asked for.
std::unique_ptr<CommitTogether> TakeFilesAtEnd();

}  // namespace roomtex
