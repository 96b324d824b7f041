#include "core/option_list.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <set>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include "core/csv.h"
#include "core/error.h"
#include "core/output_file.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr uintmax_t kMaxProjectBytes = 1 << 20;

[[noreturn]] void FailValue(const std::string& option, const std::string& text,
                            const std::string& expected) {
  throw UsageError("--" + option + " is \"" + text + "\", expected " + expected);
}

// Decimal number, the whole text; NaN if it is none. A leading + is allowed.
double Number(const std::string& text) {
  const char* begin = text.data();
  const char* end = text.data() + text.size();
  if (begin != end && *begin == '+') ++begin;
  double value = 0;
  const auto [stop, error] = std::from_chars(begin, end, value);
  return error == std::errc() && stop == end && begin != end ? value : std::nan("");
}

}  // namespace

bool ParseBool(const std::string& option, const std::string& text) {
  if (text == "1" || text == "true") return true;
  if (text == "0" || text == "false") return false;
  FailValue(option, text, "1 or 0");
}

int ParseInt(const std::string& option, const std::string& text) {
  const double value = Number(text);
  if (!(value >= INT32_MIN && value <= INT32_MAX) || value != std::floor(value)) {
    FailValue(option, text, "a whole number");
  }
  return static_cast<int>(value);
}

double ParseDouble(const std::string& option, const std::string& text) {
  const double value = Number(text);
  if (std::isnan(value)) FailValue(option, text, "a number");
  return value;
}

// One option as it was given; `where` begins messages about it.
struct OptionList::Given {
  std::string name;  // without "--"
  std::vector<std::string> values;
  std::string where;
};

const Option* OptionList::Find(const std::string& name) const {
  const auto found = std::find_if(options_.begin(), options_.end(),
                                  [&](const Option& option) { return option.name == name; });
  return found == options_.end() ? nullptr : &*found;
}

const PassedThrough* OptionList::FindPassed(const std::string& argument) const {
  const auto found = std::find_if(passed_.begin(), passed_.end(), [&](const PassedThrough& p) {
    return BeginsWith(argument, p.prefix);
  });
  return found == passed_.end() ? nullptr : &*found;
}

std::string OptionList::Unknown(const std::string& argument) const {
  std::string text = argument + " is not an option of " + command_;
  const std::string name =
      argument.substr(std::min(argument.find_first_not_of('-'), argument.size()));
  const Option* nearest = nullptr;
  size_t nearest_distance = 3;  // more different names are no slips of the finger
  for (const Option& option : options_) {
    const size_t distance = EditDistance(name, option.name);
    if (distance < nearest_distance) {
      nearest = &option;
      nearest_distance = distance;
    }
  }
  if (nearest != nullptr) return text + ". Did you mean --" + nearest->name + "?";
  // --image for --image_path, --input for what it needs.
  std::string needed;
  for (const Option& option : options_) {
    if (BeginsWith(option.name, name + "_")) return text + ". Did you mean --" + option.name + "?";
    if (option.type == "PATH" && option.name != "report_path" && option.name != "project_path") {
      needed += (needed.empty() ? "" : ", ") + ("--" + option.name);
    }
  }
  return needed.empty() ? text : text + ". Its files are " + needed + ".";
}

// CLI11 splits the arguments; what it leaves over must be options of another program with their
// values.
std::vector<OptionList::Given> OptionList::ReadArguments(
    const std::vector<std::string>& arguments) const {
  CLI::App app;
  app.set_help_flag();
  app.allow_extras();
  std::vector<Given> all(options_.size());
  for (size_t i = 0; i < options_.size(); ++i) {
    all[i].name = options_[i].name;
    CLI::Option* option = app.add_option("--" + options_[i].name, all[i].values);
    option->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    // A vector takes all that follows; only repeatable options may list their values.
    if (!options_[i].repeatable) option->expected(1)->allow_extra_args(false);
  }
  std::vector<std::string> reversed;  // CLI11 takes them from the back
  for (size_t i = arguments.size(); i-- > 0;) {
    const std::string& argument = arguments[i];
    if (argument == "--") throw UsageError("\"--\" does not belong to an option");
    const bool is_last = i + 1 == arguments.size() || BeginsWith(arguments[i + 1], "--");
    const Option* alone =
        is_last && BeginsWith(argument, "--") ? Find(argument.substr(2)) : nullptr;
    if (alone != nullptr && !alone->may_stand_alone) throw UsageError(argument + " needs a value");
    if (BeginsWith(argument, "--") && argument.back() == '=') {
      // To CLI11 "--name=" has no value; to us an empty one.
      reversed.push_back("");
      reversed.push_back(argument.substr(0, argument.size() - 1));
    } else {
      reversed.push_back(alone != nullptr ? argument + "=1" : argument);
    }
  }
  try {
    app.parse(reversed);
  } catch (const CLI::ParseError& error) {
    throw UsageError(error.what());
  }
  all.erase(std::remove_if(all.begin(), all.end(),
                           [](const Given& given) { return given.values.empty(); }),
            all.end());
  const std::vector<Given> passed = ReadPassedThrough(app.remaining());
  all.insert(all.end(), passed.begin(), passed.end());
  return all;
}

std::vector<OptionList::Given> OptionList::ReadPassedThrough(
    const std::vector<std::string>& arguments) const {
  std::vector<Given> all;
  for (size_t i = 0; i < arguments.size(); ++i) {
    const std::string& argument = arguments[i];
    if (argument.size() < 2 || argument[0] != '-' || argument == "--") {
      throw UsageError("\"" + argument + "\" does not belong to an option");
    }
    const size_t equals = argument.find('=');
    const std::string name = argument.substr(0, equals);
    if (FindPassed(name) == nullptr) throw UsageError(Unknown(name));
    if (equals != std::string::npos) {
      all.push_back({name.substr(2), {argument.substr(equals + 1)}, ""});
    } else if (i + 1 < arguments.size() && !BeginsWith(arguments[i + 1], "--")) {
      all.push_back({name.substr(2), {arguments[++i]}, ""});
    } else {
      throw UsageError(name + " needs a value");
    }
  }
  return all;
}

// COLMAP's layout: keys before the first section are plain options, [Group] makes the keys below it
// --Group.key. A value reaches to the end of its line. Read here and not by CLI11 or Boost, because
// their messages do not name the line of an unknown or broken key.
std::vector<OptionList::Given> OptionList::ReadProjectFile(const std::string& path) const {
  RequireFile(path, "Check --project_path");
  std::error_code error;
  if (std::filesystem::file_size(path, error) > kMaxProjectBytes) {
    throw InputError(path, "", "is too large for an ini file", "Check --project_path");
  }
  std::ifstream stream(path);
  std::vector<Given> all;
  std::string line, section;
  for (long number = 1; std::getline(stream, line); ++number) {
    if (number == 1) DropByteOrderMark(&line);
    if (line.find('\0') != std::string::npos) {
      throw InputError(path, LinePosition(number), "holds a zero byte, as text in UTF-16 does",
                       "Save the file as UTF-8");
    }
    line = Trimmed(line);
    if (line.empty() || line[0] == '#' || line[0] == ';') continue;
    const size_t equals = line.find('=');
    if (line[0] == '[' && line.back() == ']') {
      section = Trimmed(line.substr(1, line.size() - 2)) + ".";
      continue;
    }
    if (line[0] == '[' || equals == std::string::npos || equals == 0) {
      throw InputError(path, LinePosition(number),
                       "is not a line of an ini file (\"" + line.substr(0, 60) + "\")",
                       "Expected key=value, [Section] or a line that starts with # or ;");
    }
    const std::string name = section + Trimmed(line.substr(0, equals));
    const std::string where = path + ": " + LinePosition(number) + ": ";
    if (name == "project_path") {
      throw UsageError(where + "project_path stands on the command line only");
    }
    if (Find(name) == nullptr && FindPassed("--" + name) == nullptr) {
      throw UsageError(where + Unknown(name));
    }
    all.push_back({name, {Trimmed(line.substr(equals + 1))}, where});
  }
  return all;
}

void OptionList::Parse(const std::vector<std::string>& arguments) const {
  std::vector<Given> on_command_line = ReadArguments(arguments);
  std::set<std::string> names;
  std::vector<Given> all;
  for (const Given& given : on_command_line) {
    names.insert(given.name);
    if (given.name != "project_path" || given.values.back().empty()) continue;
    all = ReadProjectFile(given.values.back());
  }
  all.erase(std::remove_if(all.begin(), all.end(),
                           [&](const Given& given) { return names.count(given.name) > 0; }),
            all.end());
  std::move(on_command_line.begin(), on_command_line.end(), std::back_inserter(all));

  for (const Given& given : all) {
    if (Find(given.name) != nullptr) continue;
    std::vector<std::string>* passed = FindPassed("--" + given.name)->arguments;
    passed->push_back("--" + given.name);
    passed->push_back(given.values[0]);
  }
  std::vector<std::string> problems;
  for (const Option& option : options_) {
    std::vector<std::string> values;
    std::string where;
    for (const Given& given : all) {
      if (given.name != option.name) continue;
      if (values.size() + given.values.size() > 1 && !option.repeatable) {
        throw UsageError(given.where + "--" + option.name + " is given twice");
      }
      values.insert(values.end(), given.values.begin(), given.values.end());
      where = given.where;
    }
    if (values.empty()) {
      if (option.required) problems.push_back("--" + option.name + " is required");
      continue;
    }
    if (!option.may_be_empty && std::count(values.begin(), values.end(), "") > 0) {
      problems.push_back(where + "--" + option.name + " needs a value");
      continue;
    }
    try {
      option.set(values);
    } catch (const UsageError& error) {
      problems.push_back(where + error.what());
    }
  }
  ThrowIfProblems(problems);
}

std::string OptionList::GivenAs(const std::string& name,
                                const std::vector<std::string>& arguments) const {
  const std::string option = "--" + name, with_equals = option + "=";
  std::vector<std::string> values;
  for (size_t i = 0; i < arguments.size(); ++i) {
    if (BeginsWith(arguments[i], with_equals)) {
      values.push_back(arguments[i].substr(with_equals.size()));
    } else if (arguments[i] == option && i + 1 < arguments.size() &&
               !BeginsWith(arguments[i + 1], "--")) {
      values.push_back(arguments[++i]);
    }
  }
  if (!values.empty()) return values.size() == 1 ? values[0] : "";
  const std::string project = name == "project_path" ? "" : GivenAs("project_path", arguments);
  std::error_code error;
  if (project.empty() || !std::filesystem::is_regular_file(project, error) ||
      std::filesystem::file_size(project, error) > kMaxProjectBytes) {
    return "";
  }
  std::ifstream stream(project);
  for (std::string line; std::getline(stream, line);) {
    const size_t equals = line.find('=');
    if (BeginsWith(Trimmed(line), "[")) break;
    if (equals != std::string::npos && Trimmed(line.substr(0, equals)) == name) {
      return Trimmed(line.substr(equals + 1));
    }
  }
  return "";
}

std::string OptionList::Help() const {
  std::string text;
  for (const Option& option : options_) {
    text += "  --" + option.name;
    if (!option.type.empty()) text += " " + option.type;
    if (option.required) {
      text += " (required)";
    } else if (!option.default_text.empty()) {
      text += " (" + option.default_text + ")";
    }
    text += "\n      " + option.help + (option.repeatable ? " May be repeated." : "") + "\n";
  }
  for (const PassedThrough& p : passed_) text += "  " + p.prefix + "*\n      " + p.help + "\n";
  return text;
}

Json OptionList::Effective() const {
  Json json = Json::object();
  for (const Option& option : options_) json[option.name] = option.value();
  for (const PassedThrough& p : passed_) {
    const std::vector<std::string>& words = *p.arguments;
    for (size_t i = 0; i + 1 < words.size(); i += 2) {
      if (BeginsWith(words[i], p.prefix)) json[words[i].substr(2)] = words[i + 1];
    }
  }
  return json;
}

}  // namespace roomtex
