#include "core/error.h"

namespace roomtex {
namespace {

std::string Sentence(const std::string& path, const std::string& position,
                     const std::string& finding, const std::string& remedy) {
  std::string text = path;
  if (!position.empty()) text += ": " + position;
  text += ": " + finding + ".";
  if (!remedy.empty()) text += " " + remedy + ".";
  return text;
}

}  // namespace

InputError::InputError(const std::string& path, const std::string& position,
                       const std::string& finding, const std::string& remedy)
    : std::runtime_error(Sentence(path, position, finding, remedy)) {}

void ThrowIfProblems(const std::vector<std::string>& problems) {
  if (problems.empty()) return;
  std::string text;
  for (const std::string& problem : problems) text += (text.empty() ? "" : "\n") + problem;
  throw UsageError(text);
}

void AppendProblems(const std::vector<std::string>& more, std::vector<std::string>* problems) {
  problems->insert(problems->end(), more.begin(), more.end());
}

std::string LinePosition(long line) { return "line " + std::to_string(line); }
std::string BytePosition(long long byte) { return "byte " + std::to_string(byte); }

}  // namespace roomtex
