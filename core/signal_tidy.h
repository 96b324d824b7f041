#pragma once
// A command that SIGINT, SIGTERM, SIGHUP or SIGPIPE ends leaves nothing half done, and says what is
// there.

#include <string>
#include <thread>

namespace roomtex {

// While this lives, one of these signals removes all that is being made (partial_path.h), tells the
// user what had been written, and ends the process as the signal would have. Who handles signals on
// the way (SignalGuard, LocalServer) does so in its place. Signals that were ignored stay ignored.
// Does nothing where no thread can be started.
class SignalTidy {
 public:
  explicit SignalTidy(const std::string& command);
  ~SignalTidy();
  SignalTidy(const SignalTidy&) = delete;
  SignalTidy& operator=(const SignalTidy&) = delete;

 private:
  int ends_[2] = {-1, -1};
  std::thread waiting_;
};

// Tells what had been written and ends the process.
[[noreturn]] void StopBySignal(const std::string& command, int signal);

}  // namespace roomtex
