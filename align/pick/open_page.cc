#include "align/pick/open_page.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ;

namespace roomtex {
namespace {

constexpr int kPatienceMs = 1000;

std::string WriteRedirect(const std::string& path, const std::string& url) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (file < 0) return std::strerror(errno);
  const std::string page =
      "<!doctype html><meta charset=\"utf-8\"><title>roomtex</title>"
      "<meta http-equiv=\"refresh\" content=\"0; url=" +
      url +
      "\">"
      "<a href=\"" +
      url + "\">roomtex</a>\n";
  const ssize_t written = write(file, page.data(), page.size());
  close(file);
  return written == static_cast<ssize_t>(page.size()) ? "" : "the disk is full";
}

// 0 or what posix_spawn says.
int StartBrowser(const std::string& path, pid_t* child) {
  std::string program = "xdg-open", argument = path;
  char* arguments[] = {program.data(), argument.data(), nullptr};
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  // What a browser prints is not this command's answer.
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  // Its own group: Ctrl-C ends this command, not the browser.
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  const int failed =
      posix_spawnp(child, program.c_str(), &actions, &attributes, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  return failed;
}

}  // namespace

OpenedPage OpenPage(const std::string& url) {
  const auto refuse = [](const std::string& why, const std::string& folder) {
    return OpenedPage{"The browser was not opened: " + why + "; open the address above by hand.",
                      folder};
  };
  std::error_code error;
  std::string folder = (std::filesystem::temp_directory_path(error) / "roomtex-XXXXXX").string();
  if (error || mkdtemp(folder.data()) == nullptr) {  // mode 0700
    return refuse("no temporary folder could be made", "");
  }
  const std::string path = folder + "/open.html";
  const std::string problem = WriteRedirect(path, url);
  if (!problem.empty()) return refuse(path + ": " + problem, folder);
  pid_t child = 0;
  const int failed = StartBrowser(path, &child);
  if (failed != 0) return refuse(std::string("xdg-open: ") + std::strerror(failed), folder);
  // xdg-open ends at once where there is no browser, later or never where it becomes one.
  for (int waited = 0; waited < kPatienceMs; waited += 50) {
    int status = 0;
    if (waitpid(child, &status, WNOHANG) == child) {
      if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return {"", folder};
      return refuse("xdg-open found none", folder);
    }
    usleep(50000);
  }
  return {"", folder};
}

}  // namespace roomtex
