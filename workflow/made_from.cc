#include "workflow/made_from.h"

#include <filesystem>
#include <map>
#include <set>

#include "core/child_program.h"
#include "core/input_guard.h"
#include "core/text.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;

constexpr char kResult[] = "{result}";
constexpr char kOptions[] = "options";  // begins the names of command lines in MadeFrom

bool EndsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

bool IsInside(const std::string& place, const std::string& folder) {
  return place == folder || BeginsWith(place, folder == "/" ? folder : folder + "/");
}

// Absolute, without links and "..", also of what is not there (yet).
std::string PlaceOfFile(const std::string& path) {
  std::error_code error;
  const fs::path absolute = fs::absolute(path, error);
  fs::path place = fs::weakly_canonical(absolute, error);
  if (error) place = absolute.lexically_normal();
  std::string text = place.string();
  while (text.size() > 1 && text.back() == '/') text.pop_back();
  return text;
}

bool IsThreads(const std::string& option) {
  return option == "--num_threads" || EndsWith(option, ".num_threads");
}

// The list that it leads to counts by its content (Step::files).
bool IsList(const std::string& option) { return option == "--image_list_path"; }

bool TakesPath(const std::string& option) {
  return EndsWith(option, "_path") || option == "--scan_poses";
}

// Of a step without a command of its own the text is how to run it alone: roomtex-auto with all
// options of the run. Those that cut pictures out of a video:
bool CountsForFrames(const std::string& option) {
  return option == "--video_path" || option == "--video_frames" || option == "--quality";
}

// Options and their values, in order of the options' names; "" for words that belong to none.
std::map<std::string, CommandLine> ValuesByOption(const CommandLine& words) {
  std::map<std::string, CommandLine> values;
  std::string option;
  for (size_t i = 1; i < words.size(); ++i) {
    if (BeginsWith(words[i], "--")) {
      option = words[i];
      values[option].emplace_back();  // one that is given alone counts, too
    } else {
      values[option].push_back(words[i]);
    }
  }
  return values;
}

// " (--image_path, --near)"; "" where no option tells it.
std::string DifferentOptions(const std::string& before, const std::string& now) {
  const auto old_values = ValuesByOption(CommandWords(before));
  const auto new_values = ValuesByOption(CommandWords(now));
  std::set<std::string> names;
  const auto add = [&names](const auto& values, const auto& others) {
    for (const auto& [name, value] : values) {
      const auto other = others.find(name);
      if (!name.empty() && (other == others.end() || other->second != value)) names.insert(name);
    }
  };
  add(old_values, new_values);
  add(new_values, old_values);
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? " (" : ", ") + name;
  return text.empty() ? text : text + ")";
}

}  // namespace

std::string FileName(const std::string& path) {
  std::error_code error;
  const fs::path normal = fs::absolute(path, error).lexically_normal();
  return (normal.has_filename() ? normal : normal.parent_path()).filename().string();
}

CommandLine CommandWords(const std::string& text) {
  CommandLine words;
  std::string word;
  bool has_word = false, is_quoted = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '\'') {
      is_quoted = !is_quoted;
      has_word = true;
    } else if (c == ' ' && !is_quoted) {
      if (has_word) words.push_back(word);
      word.clear();
      has_word = false;
    } else {
      word += c == '\\' && !is_quoted && i + 1 < text.size() ? text[++i] : c;
      has_word = true;
    }
  }
  if (has_word) words.push_back(word);
  return words;
}

PathNames::PathNames(const std::string& output_path)
    : output_path_(output_path), output_place_(PlaceOfFile(output_path)) {}

std::string PathNames::Of(const std::string& path) const {
  if (path.empty() || BeginsWith(path, kResult)) return path;
  const std::string file = FileOf(path);  // without the scan in it
  const std::string place = PlaceOfFile(file), part = path.substr(file.size());
  if (!IsInside(place, output_place_)) return place + part;
  return kResult + place.substr(output_place_.size()) + part;
}

std::string PathNames::PlaceOf(const std::string& name) const {
  return BeginsWith(name, kResult) ? output_path_ + name.substr(sizeof kResult - 1) : name;
}

std::string PathNames::Essential(const CommandLine& line) const {
  if (line.empty()) return "";
  const bool is_file_tool = line[0] == "cp" || line[0] == "mv" || line[0] == "rm";
  const bool is_frames = line[0] == "roomtex-auto";
  const auto is_program = [](const std::string& word) {
    return word.find('/') != std::string::npos;  // else it is found on the PATH
  };
  CommandLine essential = {is_program(line[0]) ? Of(line[0]) : line[0]};
  for (size_t i = 1; i < line.size(); ++i) {
    const bool is_option = BeginsWith(line[i], "-");
    const bool has_value = is_option && !is_file_tool && i + 1 < line.size();
    if (is_option &&
        (IsThreads(line[i]) || IsList(line[i]) || (is_frames && !CountsForFrames(line[i])))) {
      ++i;
    } else if (has_value && TakesPath(line[i])) {
      essential.push_back(line[i]);
      essential.push_back(Of(line[++i]));
    } else if (has_value && line[i] == "--colmap" && is_program(line[i + 1])) {
      essential.push_back(line[i]);
      essential.push_back(Of(line[++i]));
    } else {
      essential.push_back(is_file_tool && !is_option ? Of(line[i]) : line[i]);
    }
  }
  return CommandText(essential);
}

MadeFrom PathNames::Named(const MadeFrom& from) const {
  MadeFrom named;
  for (const auto& [name, value] : from) {
    if (BeginsWith(name, kOptions)) {
      named[name] = Essential(CommandWords(value));
    } else if (name == "." || name == "..") {
      named[FileName(name)] = value;  // as typed
    } else {
      // The second of two files of one name goes by its path.
      named[name.find('/') == std::string::npos ? name : Of(name)] = value;
    }
  }
  return named;
}

std::vector<std::string> PathNames::Changes(const MadeFrom& before, const MadeFrom& now) const {
  const MadeFrom old = Named(before), fresh = Named(now);
  std::vector<std::string> changes = Differences(old, fresh);
  for (std::string& change : changes) {
    const auto was = old.find(change), is = fresh.find(change);
    if (!BeginsWith(change, kOptions) || was == old.end() || is == fresh.end()) continue;
    change += DifferentOptions(was->second, is->second);
  }
  return changes;
}

}  // namespace roomtex
