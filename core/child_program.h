#pragma once
// Other programs: found, run without a shell, followed line by line, ended when we are.

#include <csignal>
#include <functional>
#include <string>
#include <vector>

namespace roomtex {

struct ChildRun {
  bool success = false;
  int exit_code = 0;    // 128 + signal when killed
  std::string failure;  // "ended with exit code 1", "was killed by signal 6"; "" on success
  std::vector<std::string> last;    // last lines it printed, stack traces left out
  double cpu_seconds = 0;           // user and system, with all that it waited for
  long long peak_memory_bytes = 0;  // of the largest process among them
  std::string LastLines() const;    // joined by " | "
};

struct ChildSettings {
  std::string log_path;     // all that it prints is appended here; "" = nowhere
  int max_processors = -1;  // it sees no more than these; -1 = all
  // What it gets first when a signal or should_stop stops it, and when we are killed: SIGTERM for a
  // program that tidies up, which is killed when it is still there after some seconds.
  int stop_signal = SIGKILL;
  std::function<bool()> should_stop;                // asked some times a second
  std::function<void(const std::string&)> on_line;  // every line that it prints
  std::function<void()> on_wait;                    // some times a second
};

// The path of a program: looked for on PATH unless it has a slash. Throws InputError with `remedy`.
std::string FindProgram(const std::string& program, const std::string& remedy);
// A program of the folder that this one lies in; its bare name if it is not there.
std::string BesideThisProgram(const std::string& name);

// Runs arguments[0], a path, with the rest as its arguments, without a display and without input,
// and waits, in any thread. Throws Interrupted when a signal stops us: the program is ended first.
ChildRun RunChild(std::vector<std::string> arguments, const ChildSettings& settings);

// A line for a shell.
std::string CommandText(const std::vector<std::string>& arguments);

// Thrown where a signal asks the command to stop, so that destructors tidy up. Not a
// std::exception: only main() may swallow it.
struct Interrupted {
  int signal = 0;
};

// While this lives, SIGINT, SIGTERM and SIGHUP end the running program (with all it has started)
// and become Interrupted at the next ThrowIfInterrupted(). At most one at a time.
class SignalGuard {
 public:
  SignalGuard();
  ~SignalGuard();
  SignalGuard(const SignalGuard&) = delete;
  SignalGuard& operator=(const SignalGuard&) = delete;
};
void ThrowIfInterrupted();

// Ends this process the way the signal would have, so that a calling shell sees it.
[[noreturn]] void DieBySignal(int signal);

}  // namespace roomtex
