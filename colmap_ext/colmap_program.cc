#include "colmap_ext/colmap_program.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <filesystem>
#include <fstream>

#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/error.h"

extern char** environ;

namespace roomtex {
namespace fs = std::filesystem;
namespace {

constexpr char kInstallRemedy[] =
    "Install COLMAP (apt install colmap), or name the program with --colmap";
constexpr size_t kNumLastLines = 12;

std::atomic<int> received_signal{0};
std::atomic<pid_t> running_group{0};

extern "C" void OnSignal(int signal) {
  received_signal = signal;
  const pid_t group = running_group;
  if (group > 0) kill(-group, SIGKILL);
}

constexpr int kSignals[] = {SIGINT, SIGTERM, SIGHUP};
struct sigaction previous_actions[3];

sigset_t GuardedSignals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : kSignals) sigaddset(&set, signal);
  return set;
}

std::string FindProgram(const std::string& program) {
  const auto runnable = [](const fs::path& path) {
    std::error_code error;
    return fs::is_regular_file(path, error) && ::access(path.c_str(), X_OK) == 0;
  };
  if (program.find('/') != std::string::npos) {
    std::error_code error;
    if (!fs::exists(program, error))
      throw InputError(program, "", "does not exist", kInstallRemedy);
    if (!runnable(program)) throw InputError(program, "", "is not a program", kInstallRemedy);
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
  throw InputError(program, "", "is not on the PATH", kInstallRemedy);
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
                                const cpu_set_t& processors) {
  sched_setaffinity(0, sizeof(processors), &processors);
  setpgid(0, 0);                     // so that all it starts can be killed together
  prctl(PR_SET_PDEATHSIG, SIGKILL);  // and it does not outlive us
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

// Splits what a pipe delivers into lines until it closes. Carriage returns end lines too.
void ReadLines(int input, const std::function<void(const std::string&)>& on_line) {
  std::string line;
  char buffer[4096];
  for (;;) {
    const ssize_t count = read(input, buffer, sizeof(buffer));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    for (ssize_t i = 0; i < count; ++i) {
      if (buffer[i] != '\n' && buffer[i] != '\r') {
        line += buffer[i];
        continue;
      }
      on_line(line);
      line.clear();
    }
  }
  if (!line.empty()) on_line(line);
}

std::string DescribeStatus(int status) {
  if (WIFSIGNALED(status)) return "was killed by signal " + std::to_string(WTERMSIG(status));
  return "ended with exit code " + std::to_string(WEXITSTATUS(status));
}

}  // namespace

std::string ColmapRun::LastLines() const {
  std::string joined;
  for (const std::string& line : last) joined += (joined.empty() ? "" : " | ") + line;
  return joined;
}

ColmapProgram::ColmapProgram(const std::string& program, const std::string& log_path)
    : path_(FindProgram(program)), log_path_(log_path) {
  const ColmapRun help = RunArguments({"help"}, -1, [&](const std::string& line) {
    if (version_.empty() && line.rfind("COLMAP ", 0) == 0) version_ = line;
  });
  if (!help.success || version_.empty()) {
    throw InputError(path_, "", "does not answer `help` as COLMAP does (" + help.LastLines() + ")",
                     kInstallRemedy);
  }
}

int ColmapProgram::VersionNumber() const {
  int major = 0, minor = 0;
  if (std::sscanf(version_.c_str(), "COLMAP %d.%d", &major, &minor) != 2) return 0;
  return 100 * major + minor;
}

const std::set<std::string>& ColmapProgram::Options(const std::string& command) {
  const auto found = options_of_command_.find(command);
  if (found != options_of_command_.end()) return found->second;
  std::set<std::string> options;
  RunArguments({command, "-h"}, -1, [&](const std::string& line) {
    const size_t begin = line.find("--");
    if (begin == std::string::npos || line.find_first_not_of(" \t") != begin) return;
    options.insert(line.substr(begin, line.find_first_of(" \t=", begin) - begin));
  });
  if (options.count("--input_path") == 0) {
    throw InputError(path_, "", "has no command `" + command + "` (" + version_ + ")",
                     "Use COLMAP 3.7 or newer");
  }
  return options_of_command_[command] = options;
}

ColmapRun ColmapProgram::Run(const std::string& command, const ColmapOptions& options,
                             int max_processors,
                             const std::function<void(const std::string&)>& on_line) {
  std::vector<std::string> arguments = {command};
  for (const auto& [name, value] : options) {
    arguments.push_back(name);
    arguments.push_back(value);
  }
  return RunArguments(arguments, max_processors, on_line);
}

ColmapRun ColmapProgram::RunArguments(const std::vector<std::string>& arguments, int max_processors,
                                      const std::function<void(const std::string&)>& on_line) {
  ThrowIfInterrupted();
  std::vector<std::string> argument_texts = {path_};
  argument_texts.insert(argument_texts.end(), arguments.begin(), arguments.end());
  std::vector<std::string> environment_texts = ChildEnvironment();
  const std::vector<char*> argv = Pointers(&argument_texts);
  const std::vector<char*> envp = Pointers(&environment_texts);
  std::ofstream log(log_path_, std::ios::app);
  log << "\n$";
  for (const std::string& text : argument_texts) log << ' ' << text;
  log << std::endl;

  const cpu_set_t processors = Processors(max_processors);
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) throw std::runtime_error("no pipe can be made");
  // A signal between fork and the next line would miss the child.
  const sigset_t guarded = GuardedSignals();
  sigset_t before;
  sigprocmask(SIG_BLOCK, &guarded, &before);
  const pid_t child = fork();
  if (child == 0) BecomeProgram(path_.c_str(), argv.data(), envp.data(), ends[1], processors);
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
  ReadLines(ends[0], [&](const std::string& line) {
    log << line << '\n';
    if (on_line) on_line(line);
    if (line.find_first_not_of(" \t=-") == std::string::npos) return;
    last.push_back(line);
    if (last.size() > kNumLastLines) last.pop_front();
  });
  close(ends[0]);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  running_group = 0;
  log.flush();
  ThrowIfInterrupted();
  ColmapRun result;
  result.success = WIFEXITED(status) && WEXITSTATUS(status) == 0;
  if (!result.success) result.failure = DescribeStatus(status);
  result.last.assign(last.begin(), last.end());
  return result;
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
