#pragma once
// What a Command holds. For its own files: command_options.cc declares options, command_line.cc
// runs it.

#include <functional>
#include <string>
#include <vector>

#include "core/command_line.h"
#include "core/input_guard.h"
#include "core/option_list.h"

namespace roomtex {

class OptionField;

struct Command::Impl {
  struct PathOption {
    std::string name;
    std::function<std::vector<std::string>()> paths;  // none if it is not given
  };

  std::string name, summary, example;
  OptionList options;
  CommonOptions common;
  std::vector<PathOption> inputs, outputs;

  explicit Impl(const std::string& command) : name(command), options(command) {}

  // Options of the kinds that several of Command's have in common.
  void AddText(const std::string& option_name, std::string* value, const std::string& help,
               const std::string& type, Kind kind);
  void AddTexts(const std::string& option_name, std::vector<std::string>* values,
                const std::string& help, Kind kind);
  // An integer whose 0 has a word.
  void AddIntOrWord(const OptionField& field, int* value);
  static PathOption OnePath(const std::string& option_name, const std::string* value);
  void AddField(const OptionField& field, Command* command);
  void AddCommonOptions(Command* command);

  GuardedPaths PathsToGuard() const;
  // What --help and --version print; "" when neither is asked for.
  std::string Answer(const std::vector<std::string>& arguments) const;
  void Parse(const std::vector<std::string>& arguments) const;
  Json MakeReport(const Report& report, const Progress& progress) const;
  // Ends a command that cannot begin: says why, also in --report_path, so that nobody takes the
  // report of the run before for this one's.
  int EndEarly(int exit_code, const std::string& failure,
               const std::vector<std::string>& arguments) const;
};

}  // namespace roomtex
