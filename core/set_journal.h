#pragma once
// How OutputSet moves files one by one where folders cannot change places: what is to be moved
// stands in a list inside the set, so that a killed run can be continued.

#include <string>
#include <vector>

namespace roomtex {

struct SetJournal {
  std::vector<std::string> moves;    // below the set: to the same place below its upper folder
  std::vector<std::string> removes;  // files below the upper folder that the set does away with
};

// Writes the list to the disk. Throws std::system_error.
void WriteSetJournal(const SetJournal& journal, const std::string& set);

// Moves what the list of the set names and is still there; does nothing without a list. Gives the
// first error, 0 without one. Names that lead out of the upper folder are passed over. A list that
// was found may have come with somebody's folder: there links lead out, too, and that of another
// user is not followed (EPERM).
enum class JournalOrigin { kOurs, kFound };
int FinishMovedSet(const std::string& set, JournalOrigin origin);

}  // namespace roomtex
