#include "core/standard_files.h"

#include <cstdio>
#include <filesystem>
#include <iostream>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

#include "core/error.h"

namespace roomtex {
namespace {

struct Answer {
  std::string at_end, at_any_end;
};

Answer& TheAnswer() {
  static Answer answer;
  return answer;
}

}  // namespace

void AnswerAtEnd(const std::string& text) { TheAnswer().at_end += text; }

void AnswerAtAnyEnd(const std::string& text) { TheAnswer().at_any_end += text; }

std::string TakeAnswer(bool ran_to_end) {
  const Answer answer = std::exchange(TheAnswer(), Answer());
  return ran_to_end ? answer.at_any_end + answer.at_end : answer.at_any_end;
}

void OpenStandardFiles() {
  int file = 0;
  do {
    file = open("/dev/null", O_RDWR);
  } while (file >= 0 && file <= STDERR_FILENO);
  if (file >= 0) close(file);
}

bool FlushAnswer(const std::string& command) {
  std::cout.flush();
  if (std::cout.good() && std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return true;
  std::cerr << command << ": standard output: the answer could not be written to its end. Check "
            << "the space on the disk that it goes to; files that were asked for are written\n";
  return false;
}

void RequireWorkingFolder(const GuardedPaths& paths) {
  std::error_code error;
  const std::filesystem::path folder = std::filesystem::current_path(error);
  if (!error && !folder.empty()) return;
  for (const auto* options : {&paths.inputs, &paths.outputs}) {
    for (const auto& [name, path] : *options) {
      if (path.empty() || path[0] == '/') continue;
      throw InputError(
          path, "",
          "is looked for in the folder that you work in, which is gone (" + error.message() + ")",
          "Go to a folder that is there, or give all paths from / on");
    }
  }
}

}  // namespace roomtex
