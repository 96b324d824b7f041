#pragma once
// What roomtex-auto remembers of each step, so that a run goes on where the last one ended:
// steps.json in the output folder, written anew at every change.

#include <map>
#include <string>
#include <vector>

#include "core/report.h"

namespace roomtex {

// A file by its size and content, a large one by size and time; a folder by all files in it, but
// for those that are hidden or that programs which show folders leave there. "" = not there.
std::string Signature(const std::string& path);
// A folder of photos by these alone (IsPhotoName(), and the list of faces of panoramas): notes
// beside them change nothing. "" = not there.
std::string SignatureOfPhotos(const std::string& folder);
std::string HashText(const std::string& text);

// What a step was made from: name ("room.e57", "roomtex") and signature or text of it.
using MadeFrom = std::map<std::string, std::string>;
// The names that differ.
std::vector<std::string> Differences(const MadeFrom& before, const MadeFrom& now);

enum class StepState { kStarted, kDone, kUntrusted, kFailed };

struct StepRecord {
  StepState state = StepState::kStarted;
  MadeFrom made_from;
  // Path, as PathNames (made_from.h) has it, and signature, when it had ended.
  std::map<std::string, std::string> outputs;
  std::vector<std::string> commands, notes;
  std::string reason;  // why it is not to be trusted or has failed
  double seconds = 0, cpu_seconds = 0;
  long long peak_memory_bytes = 0;
};

// A record's outputs, whose paths lead to them from here, are there as it left them.
bool OutputsAreAsLeft(const StepRecord& record);

class RunState {
 public:
  // An unreadable file counts as none: everything is made again then.
  explicit RunState(const std::string& path);

  // The file is there and cannot be read.
  bool is_lost() const { return is_lost_; }

  const StepRecord* Find(const std::string& step) const;
  void Set(const std::string& step, const StepRecord& record);  // and writes; throws InputError

 private:
  std::string path_;
  std::map<std::string, StepRecord> records_;
  bool is_lost_ = false;
};

// With all but its made_from and outputs, for reports.
Json RecordToJson(const StepRecord& record);

}  // namespace roomtex
