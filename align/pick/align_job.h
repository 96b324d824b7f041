#pragma once
// roomtex-align as the page runs it: a process of its own on the saved picks, followed by what it
// prints, its report put into plain words.

#include <atomic>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "core/report.h"

namespace roomtex {

struct AlignVerdict {
  std::string verdict;   // "trusted", "untrusted" or "failed"
  std::string headline;  // one short sentence
  std::vector<std::string> sentences;
  std::vector<std::pair<std::string, std::string>> facts;  // name, value with its unit
};
// report: alignment.json, null if the exit code says that there is none; errors: what was printed
// beside the progress. exit_code as docs/commands.md, 128 + signal for a killed process.
AlignVerdict JudgeRun(int exit_code, const Json& report, const std::vector<std::string>& errors);

// One run at a time. Safe from several threads.
class AlignJob {
 public:
  // The report of a run that came to its end, and the folder that it has written. Gives a sentence
  // to say beside the verdict, or "".
  using TakeReport = std::function<std::string(const std::string& folder, const Json& report)>;

  // program: the executable. aligned_path: where it writes.
  AlignJob(std::string program, std::string aligned_path, TakeReport take_report);
  ~AlignJob();  // ends a running one

  // arguments: all options. searches: for want of picks. Throws UsageError if it runs already,
  // InputError if there is no such program.
  void Start(std::vector<std::string> arguments, bool searches);
  // Ends a running one (SIGTERM, after some seconds SIGKILL) and waits for it.
  void Cancel();
  // As GET align of align/pick/README.md.
  Json State();
  // Path of an overlay of the last run; "" for any other name.
  std::string OverlayPath(const std::string& name);

 private:
  void Follow(const std::vector<std::string>& line);
  void TakeLine(const std::string& line);
  void Finish(int exit_code);

  const std::string program_;
  const std::string aligned_path_;
  const TakeReport take_report_;
  std::mutex starting_;  // Start, Cancel: one at a time
  std::thread follower_;
  std::atomic<bool> cancelled_{false};

  std::mutex mutex_;  // of all that follows
  std::string state_ = "idle";
  std::vector<std::string> arguments_;    // of the last run
  bool searches_ = false;                 // the last run
  int stages_done_ = 0;                   // of the model that is aligned now
  int models_done_ = 0, num_models_ = 1;  // of several
  std::deque<std::string> log_;
  std::vector<std::string> errors_;
  int exit_code_ = 0;
  AlignVerdict verdict_;
  std::vector<std::string> overlays_;
  std::string written_path_;  // of the last run: the folder asked for, or the one beside it
};

}  // namespace roomtex
