#pragma once
// The options of one command: names, values, help. command_line.h is what commands use.

#include <functional>
#include <string>
#include <vector>

#include "core/report.h"

namespace roomtex {

struct Option {
  std::string name;  // without the leading "--"
  std::string type;  // of its value, as the help shows it
  std::string help;
  std::string default_text;  // as the help shows it; "" = none
  bool required = false;
  bool may_stand_alone = false;  // "--quiet" means "--quiet 1"
  bool may_be_empty = false;     // an empty value is a value
  bool repeatable = false;
  // Takes all values given; throws UsageError for one that is no value of this option.
  std::function<void(const std::vector<std::string>&)> set = {};
  std::function<Json()> value = {};  // in effect, for the report
};

// Every option whose name starts with `prefix` ("--Mapper.") goes with its value into `arguments`.
struct PassedThrough {
  std::string prefix, help;
  std::vector<std::string>* arguments;
};

class OptionList {
 public:
  explicit OptionList(const std::string& command) : command_(command) {}

  void Add(Option option) { options_.push_back(std::move(option)); }
  void Add(PassedThrough passed) { passed_.push_back(std::move(passed)); }

  // Sets the options from "--name value" and "--name=value", first those of the ini file that
  // --project_path names (COLMAP's layout), then those of `arguments`, which win. Throws UsageError
  // for what is wrong with an option, InputError for a file that is no ini file.
  void Parse(const std::vector<std::string>& arguments) const;

  // The value that `arguments`, or else the ini file they name, give to an option, where Parse()
  // has thrown; "" if there is none or they give several.
  std::string GivenAs(const std::string& name, const std::vector<std::string>& arguments) const;

  // One paragraph per option: name, type, default, help.
  std::string Help() const;
  // Name to value in effect.
  Json Effective() const;

 private:
  struct Given;
  const Option* Find(const std::string& name) const;
  const PassedThrough* FindPassed(const std::string& argument) const;
  std::string Unknown(const std::string& argument) const;
  std::vector<Given> ReadArguments(const std::vector<std::string>& arguments) const;
  std::vector<Given> ReadPassedThrough(const std::vector<std::string>& arguments) const;
  std::vector<Given> ReadProjectFile(const std::string& path) const;

  std::string command_;
  std::vector<Option> options_;
  std::vector<PassedThrough> passed_;
};

// The value of a text; UsageError that names the option when it has none. Numbers are decimal; a
// whole number may be written 1e6; a number may be inf, but not nan.
bool ParseBool(const std::string& option, const std::string& text);
int ParseInt(const std::string& option, const std::string& text);
double ParseDouble(const std::string& option, const std::string& text);

}  // namespace roomtex
