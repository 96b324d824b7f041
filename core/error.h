#pragma once
// What a command says when it cannot go on, and the exit code that goes with it (docs/commands.md).

#include <stdexcept>
#include <string>
#include <vector>

namespace roomtex {

enum ExitCode {
  kExitDone = 0,
  kExitInternalError = 1,
  kExitUsage = 2,      // wrong usage or option
  kExitInput = 3,      // input that cannot be used
  kExitUntrusted = 4,  // it ran, but the answer is not to be trusted
};

// Input that cannot be used. Thrown where it is found. Caught by Command::Run (command_line.h), by
// servers (an answer 422), and where one photo or one trial of several may fail. The message reads
// "PATH: POSITION: FINDING. REMEDY", each part a plain phrase without a full stop at its end.
class InputError : public std::runtime_error {
 public:
  // path: file or folder as the user named it. position: "line 12", "byte 4711", or "" for all of
  // it. finding: what was found and what was expected. remedy: what to do about it ("" if the
  // finding says it).
  InputError(const std::string& path, const std::string& position, const std::string& finding,
             const std::string& remedy);
};

// Wrong usage: an option, or options that do not go together. Exit code 2.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Throws a UsageError that lists every problem, one a line. Does nothing without problems.
void ThrowIfProblems(const std::vector<std::string>& problems);
// Adds `more` behind `problems`.
void AppendProblems(const std::vector<std::string>& more, std::vector<std::string>* problems);

std::string LinePosition(long line);
std::string BytePosition(long long byte);

}  // namespace roomtex
