#pragma once
// Progress and log on stderr: a redrawn bar on a terminal, a line per stage otherwise, nothing when
// quiet.

#include <chrono>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace roomtex {

class Progress {
 public:
  // quiet: prints nothing, only measures.
  explicit Progress(bool quiet);
  ~Progress();

  // Ends the running stage and starts the next one; `total` steps (0 = cannot be told).
  // The name, e.g. "read scan", is the key in the report's `seconds`.
  void Stage(const std::string& name, int total = 0);
  // One more of the steps is done. Safe from several threads.
  void Tick();
  // The share of the running stage that is done, and what else there is to say ("about 3 min
  // left"): drawn on a terminal, otherwise a line now and then. Negative: not known.
  void Share(double share, const std::string& text);
  // Ends the running stage.
  void Finish();

  void Note(const std::string& message);     // "  message"
  void Warning(const std::string& message);  // "warning: message"

  // Seconds (wall clock) per finished stage, in order.
  const std::vector<std::pair<std::string, double>>& stage_seconds() const { return stages_; }

 private:
  void Redraw();

  bool quiet_, terminal_;
  std::mutex mutex_;
  std::string stage_;
  int total_ = 0, done_ = 0;
  std::chrono::steady_clock::time_point started_, redrawn_, said_;
  std::vector<std::pair<std::string, double>> stages_;
};

}  // namespace roomtex
