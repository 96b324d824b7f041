#pragma once
// How files get to their places where no single rename puts all of them there: what is to be moved
// stands in a list beside them, so that a killed run can be continued.

#include <optional>
#include <string>
#include <vector>

namespace roomtex {

// Of a folder with files that belong into the folder above it.
struct SetJournal {
  std::vector<std::string> moves;    // below the set: to the same place below its upper folder
  std::vector<std::string> removes;  // files below the upper folder that the set does away with
  std::string waits_for = {};        // nothing is moved before this commit record is there
};

// Writes the list to the disk; the files it names must be there. Throws std::system_error, and
// leaves no list then.
void WriteSetJournal(const SetJournal& journal, const std::string& set);
// None where there is no whole list.
std::optional<SetJournal> ReadSetJournal(const std::string& set);

// Moves what the list of the set names, then removes what it names, and brings that to the disk.
// Gives 0 if nothing is left to be done, so that the set may go; else the first error: it is to be
// kept, with the record that it waits for.
//
// kOurs: the list of this process, which waits for nothing any more; all of it must be there.
// kFound: what a killed run left, and perhaps had moved in part. Without a whole list, or without
// the record that it waits for, that run had changed nothing, and nothing is to be done. It may
// have come with somebody's folder: names that lead out of the upper folder, also by links, are
// passed over, and the list of another user is not followed. A file that was written since the list
// was is kept as "file.other", or not removed.
enum class JournalOrigin { kOurs, kFound };
inline constexpr int kOfAnotherUser = -1;
int FinishMovedSet(const std::string& set, JournalOrigin origin);

// A file by whose appearance several sets, in several folders, are to be moved: it names them, so
// that whoever finds it moves them first. Throws std::system_error, and leaves no record then.
void WriteCommitRecord(const std::vector<std::string>& sets, const std::string& path);
// The sets; none if the file is no whole record, or another user's.
std::optional<std::vector<std::string>> ReadCommitRecord(const std::string& path);
// The record that a found list waits for; "" = none, or the list is another user's.
std::string RecordWaitedFor(const std::string& set);

}  // namespace roomtex
