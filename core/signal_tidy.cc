#include "core/signal_tidy.h"

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <system_error>
#include <vector>

#include <fcntl.h>
#include <unistd.h>

#include "core/child_program.h"
#include "core/input_guard.h"
#include "core/partial_path.h"

namespace roomtex {
namespace {

struct TidySignal {
  int number;
  const char* name;
  struct sigaction action_before;
};
// SIGPIPE: who read what we tell is gone.
TidySignal tidy_signals[] = {{SIGINT, "SIGINT", {}},
                             {SIGTERM, "SIGTERM", {}},
                             {SIGHUP, "SIGHUP", {}},
                             {SIGPIPE, "SIGPIPE", {}}};
std::atomic<int> tidy_descriptor{-1};

extern "C" void PassSignalOn(int signal) {
  const int saved = errno;
  const auto byte = static_cast<unsigned char>(signal);
  if (write(tidy_descriptor, &byte, 1) < 0) errno = saved;
  errno = saved;
}

}  // namespace

void StopBySignal(const std::string& command, int signal) {
  const std::vector<std::string> written = OutputsSoFar();
  std::string kept = written.empty() ? "nothing was written, and what was there is unchanged"
                                     : "written to its end before that:";
  for (const std::string& path : written) kept += " " + path;
  for (const std::string& path : LogsSoFar()) kept += ", but for the log " + path;
  const char* name = "a signal";
  for (const TidySignal& one : tidy_signals) {
    if (one.number == signal) name = one.name;
  }
  std::fprintf(stderr, "\n%s: stopped by %s; %s\n", command.c_str(), name, kept.c_str());
  DieBySignal(signal);
}

SignalTidy::SignalTidy(const std::string& command) {
  if (pipe2(ends_, O_CLOEXEC) != 0) return;
  try {
    waiting_ = std::thread([input = ends_[0], command] {
      unsigned char signal = 0;
      while (read(input, &signal, 1) < 0 && errno == EINTR) {
      }
      if (signal == 0) return;
      RemoveAllPartials();
      StopBySignal(command, signal);
    });
  } catch (const std::system_error&) {
    return;
  }
  tidy_descriptor = ends_[1];
  struct sigaction action {};
  action.sa_handler = PassSignalOn;
  sigemptyset(&action.sa_mask);
  for (TidySignal& one : tidy_signals) {
    // The second one kills; but what is told to nobody on the way must not cut tidying short.
    action.sa_flags = SA_RESTART | (one.number == SIGPIPE ? 0 : static_cast<int>(SA_RESETHAND));
    sigaction(one.number, nullptr, &one.action_before);
    if (one.action_before.sa_handler == SIG_IGN) continue;
    sigaction(one.number, &action, nullptr);
  }
}

SignalTidy::~SignalTidy() {
  if (waiting_.joinable()) {
    for (const TidySignal& one : tidy_signals) sigaction(one.number, &one.action_before, nullptr);
    const unsigned char none = 0;
    (void)!write(ends_[1], &none, 1);
    waiting_.join();
  }
  for (const int end : ends_) {
    if (end >= 0) close(end);
  }
}

}  // namespace roomtex
