#include "core/child_program.h"

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/error.h"
#include "core/text.h"

extern char** environ;

namespace roomtex {
namespace fs = std::filesystem;
namespace {

constexpr size_t kNumLastLines = 12;
constexpr size_t kMaxLineBytes = 4096;
constexpr int kWaitMs = 200;
constexpr double kPatienceSeconds = 5;  // between the first signal and SIGKILL

std::atomic<int> received_signal{0};
std::atomic<pid_t> running_group{0};
std::atomic<int> stop_signal{SIGKILL};

extern "C" void OnSignal(int signal) {
  const bool again = received_signal.exchange(signal) != 0;
  const pid_t group = running_group;
  if (group > 0) kill(-group, again ? SIGKILL : stop_signal.load());
}

constexpr int kSignals[] = {SIGINT, SIGTERM, SIGHUP};
struct sigaction previous_actions[3];

sigset_t GuardedSignals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : kSignals) sigaddset(&set, signal);
  return set;
}

std::vector<std::string> ChildEnvironment() {
  std::vector<std::string> environment;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    if (std::strncmp(*entry, "QT_QPA_PLATFORM=", 16) != 0) environment.emplace_back(*entry);
  }
  environment.emplace_back("QT_QPA_PLATFORM=offscreen");  // no display is needed
  return environment;
}

std::vector<char*> Pointers(std::vector<std::string>* texts) {
  std::vector<char*> pointers;
  for (std::string& text : *texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

// The first max_processors of those this process may use; all with -1.
cpu_set_t Processors(int max_processors) {
  cpu_set_t ours, result;
  CPU_ZERO(&ours);
  CPU_ZERO(&result);
  sched_getaffinity(0, sizeof(ours), &ours);
  int left = max_processors < 0 ? CPU_SETSIZE : max_processors;
  for (int i = 0; i < CPU_SETSIZE && left > 0; ++i) {
    if (!CPU_ISSET(i, &ours)) continue;
    CPU_SET(i, &result);
    --left;
  }
  return result;
}

// What the child does between fork and exec: only calls that are safe there.
[[noreturn]] void BecomeProgram(const char* path, char* const* argv, char* const* envp, int output,
                                const cpu_set_t& processors, int signal_of_our_end, pid_t parent) {
  sched_setaffinity(0, sizeof(processors), &processors);
  setpgid(0, 0);  // so that all it starts can be killed together
  prctl(PR_SET_PDEATHSIG, signal_of_our_end);
  if (getppid() != parent) _exit(127);  // ended before that: no signal will come
  for (const int signal : kSignals) ::signal(signal, SIG_DFL);
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  const int null = open("/dev/null", O_RDONLY);
  dup2(null, STDIN_FILENO);
  dup2(output, STDOUT_FILENO);
  dup2(output, STDERR_FILENO);
  execve(path, argv, envp);
  const char message[] = "cannot be executed\n";
  (void)!write(STDERR_FILENO, message, sizeof(message) - 1);
  _exit(127);
}

// Between reads: tells who waits, asks a program to stop, and kills one that was asked and does
// not.
class Waiting {
 public:
  Waiting(const ChildSettings& settings, pid_t child) : settings_(settings), child_(child) {}

  void operator()() {
    if (settings_.on_wait) settings_.on_wait();
    const bool should_stop = settings_.should_stop && settings_.should_stop();
    if (received_signal == 0 && !should_stop) return;
    const auto now = std::chrono::steady_clock::now();
    if (!asked_) {
      asked_ = true;
      asked_at_ = now;
      if (should_stop) kill(-child_, settings_.stop_signal);
    }
    const double seconds = std::chrono::duration<double>(now - asked_at_).count();
    if (seconds > kPatienceSeconds) kill(-child_, SIGKILL);
  }

 private:
  const ChildSettings& settings_;
  const pid_t child_;
  bool asked_ = false;
  std::chrono::steady_clock::time_point asked_at_;
};

// Splits what a pipe delivers into lines until it closes. Carriage returns end lines too.
void ReadLines(int input, const std::function<void(const std::string&)>& on_line,
               Waiting* waiting) {
  std::string line;
  char buffer[4096];
  for (;;) {
    pollfd ready{input, POLLIN, 0};
    const int num_ready = poll(&ready, 1, kWaitMs);
    (*waiting)();
    if (num_ready == 0 || (num_ready < 0 && errno == EINTR)) continue;
    const ssize_t count = read(input, buffer, sizeof(buffer));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    for (ssize_t i = 0; i < count; ++i) {
      if (buffer[i] != '\n' && buffer[i] != '\r') {
        if (line.size() < kMaxLineBytes) line += buffer[i];  // what goes on without end is cut
        continue;
      }
      on_line(line);
      line.clear();
    }
  }
  if (!line.empty()) on_line(line);
}

// Of a stack trace as glog prints it, behind the line that says what failed.
bool IsOfStackTrace(const std::string& line) {
  return BeginsWith(line, "    @ ") || BeginsWith(line, "*** ") || BeginsWith(line, "PC: @ ");
}

double Seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

ChildRun Describe(int status, const rusage& usage, const std::deque<std::string>& last) {
  ChildRun result;
  const bool killed = WIFSIGNALED(status);
  result.exit_code = killed ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  result.success = result.exit_code == 0;
  if (killed) {
    result.failure = "was killed by signal " + std::to_string(WTERMSIG(status));
  } else if (!result.success) {
    result.failure = "ended with exit code " + std::to_string(result.exit_code);
  }
  result.cpu_seconds = Seconds(usage.ru_utime) + Seconds(usage.ru_stime);
  result.peak_memory_bytes = 1024LL * usage.ru_maxrss;
  result.last.assign(last.begin(), last.end());
  return result;
}

}  // namespace

std::string ChildRun::LastLines() const {
  std::string joined;
  for (const std::string& line : last) joined += (joined.empty() ? "" : " | ") + line;
  return joined;
}

std::string FindProgram(const std::string& program, const std::string& remedy) {
  const auto runnable = [](const fs::path& path) {
    std::error_code error;
    return fs::is_regular_file(path, error) && ::access(path.c_str(), X_OK) == 0;
  };
  if (program.find('/') != std::string::npos) {
    std::error_code error;
    if (!fs::exists(program, error)) throw InputError(program, "", "does not exist", remedy);
    if (!runnable(program)) throw InputError(program, "", "is not a program", remedy);
    return program;
  }
  const char* path = std::getenv("PATH");
  std::string folders = path == nullptr ? "" : path;
  for (size_t begin = 0; begin <= folders.size();) {
    const size_t end = std::min(folders.find(':', begin), folders.size());
    const fs::path candidate = fs::path(folders.substr(begin, end - begin)) / program;
    if (runnable(candidate)) return candidate.string();
    begin = end + 1;
  }
  throw InputError(program, "", "is not on the PATH", remedy);
}

std::string BesideThisProgram(const std::string& name) {
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  const std::string beside = (self.parent_path() / name).string();
  return !error && access(beside.c_str(), X_OK) == 0 ? beside : name;
}

ChildRun RunChild(std::vector<std::string> arguments, const ChildSettings& settings) {
  ThrowIfInterrupted();
  std::vector<std::string> environment_texts = ChildEnvironment();
  std::ofstream log;
  if (!settings.log_path.empty()) {
    log.open(settings.log_path, std::ios::app);
    log << "\n$ " << CommandText(arguments) << std::endl;
  }
  const std::vector<char*> argv = Pointers(&arguments);
  const std::vector<char*> envp = Pointers(&environment_texts);
  const cpu_set_t processors = Processors(settings.max_processors);
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) throw std::runtime_error("no pipe can be made");
  // A signal between fork and the next line would miss the child.
  const sigset_t guarded = GuardedSignals();
  sigset_t before;
  sigprocmask(SIG_BLOCK, &guarded, &before);
  stop_signal = settings.stop_signal;
  const pid_t parent = getpid(), child = fork();
  if (child == 0)
    BecomeProgram(arguments[0].c_str(), argv.data(), envp.data(), ends[1], processors,
                  settings.stop_signal, parent);
  if (child > 0) {
    setpgid(child, child);
    running_group = child;
  }
  sigprocmask(SIG_SETMASK, &before, nullptr);
  close(ends[1]);
  if (child < 0) {
    close(ends[0]);
    throw std::runtime_error("no process can be started");
  }

  std::deque<std::string> last;
  Waiting waiting(settings, child);
  const auto take_line = [&](const std::string& line) {
    log << line << '\n';
    if (settings.on_line) settings.on_line(line);
    if (line.find_first_not_of(" \t=-") == std::string::npos || IsOfStackTrace(line)) return;
    last.push_back(line);
    if (last.size() > kNumLastLines) last.pop_front();
  };
  ReadLines(ends[0], take_line, &waiting);
  close(ends[0]);
  int status = 0;
  rusage usage{};
  while (wait4(child, &status, 0, &usage) < 0 && errno == EINTR) {
  }
  running_group = 0;
  log.flush();
  ThrowIfInterrupted();
  return Describe(status, usage, last);
}

std::string CommandText(const std::vector<std::string>& arguments) {
  std::string line;
  for (const std::string& argument : arguments) {
    const bool plain = !argument.empty() && argument[0] != '#' &&
                       std::all_of(argument.begin(), argument.end(), [](unsigned char c) {
                         return std::isalnum(c) || std::strchr("-_./=+,:@%#", c) != nullptr;
                       });
    if (!line.empty()) line += ' ';
    if (plain) {
      line += argument;
      continue;
    }
    line += '\'';
    for (const char c : argument) line += c == '\'' ? std::string("'\\''") : std::string(1, c);
    line += '\'';
  }
  return line;
}

SignalGuard::SignalGuard() {
  received_signal = 0;
  struct sigaction action {};
  action.sa_handler = OnSignal;
  sigemptyset(&action.sa_mask);
  for (int i = 0; i < 3; ++i) {
    sigaction(kSignals[i], nullptr, &previous_actions[i]);
    // Who started us under nohup or in the background does not want us to stop.
    if (previous_actions[i].sa_handler == SIG_IGN) continue;
    sigaction(kSignals[i], &action, nullptr);
  }
}

SignalGuard::~SignalGuard() {
  for (int i = 0; i < 3; ++i) sigaction(kSignals[i], &previous_actions[i], nullptr);
}

void ThrowIfInterrupted() {
  if (received_signal != 0) throw Interrupted{received_signal};
}

void DieBySignal(int signal) {
  struct sigaction action {};
  action.sa_handler = SIG_DFL;
  sigaction(signal, &action, nullptr);
  kill(getpid(), signal);
  _exit(128 + signal);
}

}  // namespace roomtex
