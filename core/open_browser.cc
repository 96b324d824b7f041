#include "core/open_browser.h"

#include <cstdlib>
#include <cstring>
#include <filesystem>

#include <fcntl.h>
#include <spawn.h>
#include <sys/stat.h>
#include <unistd.h>

extern char** environ;

namespace roomtex {
namespace {

const char kRemedy[] = "; open the address that was printed by hand";

std::string MakePrivateFolder() {
  std::error_code error;
  const std::filesystem::path base = std::filesystem::temp_directory_path(error);
  std::string name = ((error ? "/tmp" : base) / "roomtex-XXXXXX").string();
  return mkdtemp(name.data()) == nullptr ? "" : name;
}

std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '&' || c == '<' || c == '>' || c == '"') {
      escaped += "&#" + std::to_string(static_cast<int>(c)) + ";";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

bool WritePrivateFile(const std::string& path, const std::string& text) {
  const int fd = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (fd < 0) return false;
  const bool written = write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  return close(fd) == 0 && written;
}

// Gives 0 or the error. The program gets a process group of its own, so that Ctrl-C does not end
// the browser, and its output goes nowhere: stdout is for the answer only.
int Spawn(const char* program, const std::string& argument) {
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_init(&files);
  posix_spawnattr_init(&attributes);
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    posix_spawn_file_actions_addopen(&files, fd, "/dev/null", O_RDWR, 0);
  }
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setpgroup(&attributes, 0);
  std::string name = program, path = argument;
  char* const arguments[] = {name.data(), path.data(), nullptr};
  pid_t pid = 0;
  const int error = posix_spawnp(&pid, program, &files, &attributes, arguments, environ);
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&attributes);
  return error;
}

}  // namespace

OpenBrowser::OpenBrowser(const std::string& url) : folder_(MakePrivateFolder()) {
  const std::string page = folder_ + "/open.html";
  const std::string text =
      "<!doctype html><meta charset=\"utf-8\"><title>roomtex</title>"
      "<meta http-equiv=\"refresh\" content=\"0; url=" +
      Escaped(url) + "\"><a href=\"" + Escaped(url) + "\">roomtex</a>\n";
  if (folder_.empty() || !WritePrivateFile(page, text)) {
    problem_ = std::string("the temporary folder cannot be written into") + kRemedy;
    return;
  }
  const int error = Spawn("xdg-open", page);
  if (error == 0) return;
  problem_ =
      std::string("no browser could be started (xdg-open: ") + std::strerror(error) + ")" + kRemedy;
}

OpenBrowser::~OpenBrowser() {
  std::error_code ignored;
  if (!folder_.empty()) std::filesystem::remove_all(folder_, ignored);
}

}  // namespace roomtex
