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

// Writes the list to the disk. Throws std::system_error.
void WriteSetJournal(const SetJournal& journal, const std::string& set);
// None where there is no whole list.
std::optional<SetJournal> ReadSetJournal(const std::string& set);

// Does away with what the list of the set names, and moves what it names and is still there. Gives
// the first error, 0 without one; what could not be moved is still in the set then. Names that lead
// out of the upper folder are passed over. Of a list that was just written all must be there
// (ENOENT). One that was found may have come with somebody's folder: there links lead out, too,
// that of another user is not followed (EPERM), and without a list, or without the record that it
// waits for, nothing is done.
enum class JournalOrigin { kOurs, kFound };
int FinishMovedSet(const std::string& set, JournalOrigin origin);

// The remedy where not all could be moved.
inline constexpr char kNextMovesThem[] =
    "Check the rights of the folder: the next command that writes there moves them";

// A file by whose appearance several sets, in several folders, are to be moved: it names them, so
// that whoever finds it moves them first. Throws std::system_error.
void WriteCommitRecord(const std::vector<std::string>& sets, const std::string& path);
// The sets; none if the file is no whole record, or another user's.
std::optional<std::vector<std::string>> ReadCommitRecord(const std::string& path);

}  // namespace roomtex
