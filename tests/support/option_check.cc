#include "tests/support/option_check.h"

#include <cmath>
#include <iomanip>
#include <map>
#include <optional>
#include <regex>
#include <sstream>

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/support/run_command.h"

namespace roomtex {
namespace {

// Name (without "--") to type, as in --help.
std::map<std::string, std::string> ListOptions(const std::string& help) {
  std::map<std::string, std::string> types;
  std::istringstream lines(help);
  const std::regex heading("  --([A-Za-z0-9_.]+)( (\\S+).*)?");
  std::smatch match;
  for (std::string line; std::getline(lines, line);) {
    if (std::regex_match(line, match, heading)) types[match[1]] = match[3];
  }
  return types;
}

std::vector<std::string> NamesIn(const std::string& text) {
  std::vector<std::string> names;
  const std::regex name("--([A-Za-z][A-Za-z0-9_]*(\\.[A-Za-z0-9_]+)*)");
  for (std::sregex_iterator i(text.begin(), text.end(), name), end; i != end; ++i) {
    names.push_back((*i)[1]);
  }
  return names;
}

// A value beyond one of the bounds, if there is such a bound.
std::optional<double> Beyond(const OptionField& field, double bound, double direction) {
  if (!std::isfinite(bound)) return std::nullopt;
  const bool whole = std::holds_alternative<int*>(field.value());
  for (const double step : {0.0, whole ? 1.0 : 0.5, 2.0}) {
    if (!field.Allows(bound + direction * step)) return bound + direction * step;
  }
  return std::nullopt;
}

void ExpectRefusesBeyond(const std::string& line, const std::vector<OptionFields>& fields,
                         double direction) {
  std::ostringstream options;
  options << std::setprecision(15);
  std::vector<std::string> sentences;
  for (const OptionFields& some : fields) {
    for (const OptionField& field : some.fields()) {
      const auto value = Beyond(field, direction < 0 ? field.low() : field.high(), direction);
      if (!value || field.internal()) continue;
      options << " --" << field.name() << " " << *value;
      sentences.push_back(field.Sentence());
    }
  }
  if (sentences.empty()) return;
  const CommandResult result = RunCommandLine(line + options.str());
  EXPECT_EQ(result.exit_code, kExitUsage) << line << options.str() << "\n" << result.err;
  for (const std::string& sentence : sentences) {
    EXPECT_NE(result.err.find(sentence), std::string::npos) << sentence << "\nnot in\n"
                                                            << result.err;
  }
}

}  // namespace

void ExpectChecksItsOptions(const std::string& command, const std::string& arguments,
                            const std::vector<OptionFields>& fields) {
  const std::map<std::string, std::string> listed =
      ListOptions(RunCommandLine(command + " --help").out);
  for (const OptionFields& some : fields) {
    for (const OptionField& field : some.fields()) {
      if (field.internal()) continue;
      EXPECT_EQ(listed.count(field.name()), 1u) << field.name();
      for (const std::string& name : NamesIn(field.help())) {
        EXPECT_EQ(listed.count(name), 1u) << name << " in the help of " << field.name();
      }
    }
    for (const std::string& sentence : some.Sentences()) {
      for (const std::string& name : NamesIn(sentence)) {
        EXPECT_EQ(listed.count(name), 1u) << sentence;
      }
    }
  }
  const std::string line = command + " " + arguments;
  ExpectRefusesBeyond(line, fields, -1);
  ExpectRefusesBeyond(line, fields, 1);
  // One run for all of them: starting a command takes longer than all that it says here.
  std::string nonsense = line;
  std::vector<std::string> refused;
  for (const auto& [name, type] : listed) {
    if (type.empty() || type == "TEXT" || type == "PATH") continue;
    nonsense.append(" --").append(name).append(" nonsense");
    refused.push_back("--" + name + " is \"nonsense\", expected");
  }
  const CommandResult result = RunCommandLine(nonsense);
  EXPECT_EQ(result.exit_code, kExitUsage) << nonsense;
  for (const std::string& sentence : refused) {
    EXPECT_NE(result.err.find(sentence), std::string::npos) << sentence << "\nnot in\n"
                                                            << result.err;
  }
}

}  // namespace roomtex
