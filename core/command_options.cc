// Options of a Command: from C++ variables and declared fields to entries of its OptionList.

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "core/command_impl.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/option_fields.h"
#include "core/option_list.h"

namespace roomtex {
namespace {

std::string NumberText(double value) {
  if (std::isinf(value)) return value > 0 ? "inf" : "-inf";
  return Json(value).dump();
}

}  // namespace

void Command::Impl::AddText(const std::string& option_name, std::string* value,
                            const std::string& help, const std::string& type, Kind kind) {
  Option option{option_name, type, help, *value};
  option.required = kind == Kind::kRequired;
  option.may_be_empty = type == "TEXT";
  option.set = [value](const std::vector<std::string>& texts) { *value = texts.back(); };
  option.value = [value] { return Json(*value); };
  options.Add(std::move(option));
}

void Command::Impl::AddTexts(const std::string& option_name, std::vector<std::string>* values,
                             const std::string& help, Kind kind) {
  Option option{option_name, "PATH", help, ""};
  option.required = kind == Kind::kRequired;
  option.repeatable = true;
  option.set = [values](const std::vector<std::string>& texts) { *values = texts; };
  option.value = [values] { return Json(*values); };
  options.Add(std::move(option));
}

void Command::Impl::AddIntOrWord(const OptionField& field, int* value) {
  const std::string word = field.word_of_zero();
  const auto text = [value, word] { return *value == 0 ? word : std::to_string(*value); };
  Option option{field.name(), "TEXT", field.help(), text()};
  option.may_be_empty = true;
  option.set = [name = field.name(), value, word](const std::vector<std::string>& texts) {
    *value = texts.back() == word ? 0 : ParseInt(name, texts.back());
  };
  option.value = [text] { return Json(text()); };
  options.Add(std::move(option));
}

Command::Impl::PathOption Command::Impl::OnePath(const std::string& option_name,
                                                 const std::string* value) {
  return {option_name, [value] {
            return value->empty() ? std::vector<std::string>() : std::vector<std::string>{*value};
          }};
}

void Command::Impl::AddField(const OptionField& field, Command* command) {
  const std::string &option_name = field.name(), &help = field.help();
  const Kind kind = field.required() ? Kind::kRequired : Kind::kOptional;
  if (const auto* const flag = std::get_if<bool*>(&field.value())) {
    command->AddBool(option_name, *flag, help);
  } else if (const auto* const number = std::get_if<double*>(&field.value())) {
    command->AddDouble(option_name, *number, help);
  } else if (const auto* const integer = std::get_if<int*>(&field.value())) {
    if (field.word_of_zero().empty()) {
      command->AddInt(option_name, *integer, help);
    } else {
      AddIntOrWord(field, *integer);
    }
  } else {
    std::string* const text = std::get<std::string*>(field.value());
    if (!field.choices().empty()) {
      command->AddChoice(option_name, text, field.choices(), help);
    } else if (field.kind() == OptionField::Kind::kInputPath) {
      command->AddInputPath(option_name, text, help, kind);
    } else {
      command->AddString(option_name, text, help, kind);
    }
  }
}

void Command::Impl::AddCommonOptions(Command* command) {
  command->AddBool("quiet", &common.quiet, "No progress and no log on stderr.");
  command->AddInt("num_threads", &common.num_threads, "Threads to use; -1 = all of the machine.");
  command->AddInt("random_seed", &common.random_seed, "Same seed, same input: same output.");
  AddText("project_path", &common.project_path,
          "Ini file with options (COLMAP's layout); the command line wins.", "PATH",
          Kind::kOptional);
  AddText("report_path", &common.report_path, "Where to write the report (JSON).", "PATH",
          Kind::kOptional);
}

GuardedPaths Command::Impl::PathsToGuard() const {
  GuardedPaths guarded;
  const auto collect = [](const std::vector<PathOption>& from,
                          std::vector<GuardedPaths::OptionPath>* to) {
    for (const PathOption& option : from) {
      for (const std::string& path : option.paths()) to->emplace_back(option.name, path);
    }
  };
  collect(inputs, &guarded.inputs);
  if (!common.project_path.empty()) {
    guarded.inputs.emplace_back("project_path", common.project_path);
  }
  collect(outputs, &guarded.outputs);
  if (!common.report_path.empty()) {
    guarded.outputs.emplace_back("report_path", common.report_path);
  }
  return guarded;
}

void Command::AddBool(const std::string& name, bool* value, const std::string& help) {
  Option option{name, "1|0", help, *value ? "1" : "0"};
  option.may_stand_alone = true;
  option.may_be_empty = true;
  option.set = [name, value](const std::vector<std::string>& texts) {
    *value = ParseBool(name, texts.back());
  };
  option.value = [value] { return Json(*value); };
  impl_->options.Add(std::move(option));
}

void Command::AddInt(const std::string& name, int* value, const std::string& help) {
  Option option{name, "INT", help, std::to_string(*value)};
  option.may_be_empty = true;
  option.set = [name, value](const std::vector<std::string>& texts) {
    *value = ParseInt(name, texts.back());
  };
  option.value = [value] { return Json(*value); };
  impl_->options.Add(std::move(option));
}

void Command::AddDouble(const std::string& name, double* value, const std::string& help) {
  Option option{name, "NUMBER", help, NumberText(*value)};
  option.may_be_empty = true;
  option.set = [name, value](const std::vector<std::string>& texts) {
    *value = ParseDouble(name, texts.back());
  };
  option.value = [value] {
    return std::isfinite(*value) ? Json(*value) : Json(NumberText(*value));
  };
  impl_->options.Add(std::move(option));
}

void Command::AddString(const std::string& name, std::string* value, const std::string& help,
                        Kind kind) {
  impl_->AddText(name, value, help, "TEXT", kind);
}

void Command::AddChoice(const std::string& name, std::string* value,
                        const std::vector<std::string>& choices, const std::string& help) {
  std::string type, list;
  for (size_t i = 0; i < choices.size(); ++i) {
    type += (i == 0 ? "" : "|") + choices[i];
    list += (i == 0 ? "" : i + 1 == choices.size() ? " or " : ", ") + choices[i];
  }
  Option option{name, type, help, *value};
  option.may_be_empty = true;
  option.set = [name, value, choices, list](const std::vector<std::string>& texts) {
    if (std::find(choices.begin(), choices.end(), texts.back()) == choices.end()) {
      throw UsageError("--" + name + " is \"" + texts.back() + "\", expected " + list);
    }
    *value = texts.back();
  };
  option.value = [value] { return Json(*value); };
  impl_->options.Add(std::move(option));
}

void Command::AddInputPath(const std::string& name, std::string* value, const std::string& help,
                           Kind kind) {
  impl_->AddText(name, value, help, "PATH", kind);
  impl_->inputs.push_back(Impl::OnePath(name, value));
}

void Command::AddInputPaths(const std::string& name, std::vector<std::string>* values,
                            const std::string& help, Kind kind) {
  impl_->AddTexts(name, values, help, kind);
  impl_->inputs.push_back({name, [values] { return *values; }});
}

void Command::AddOutputPath(const std::string& name, std::string* value, const std::string& help,
                            Kind kind) {
  impl_->AddText(name, value, help, "PATH", kind);
  impl_->outputs.push_back(Impl::OnePath(name, value));
}

void Command::AddOutputPaths(const std::string& name, std::vector<std::string>* values,
                             const std::string& help, Kind kind) {
  impl_->AddTexts(name, values, help, kind);
  impl_->outputs.push_back({name, [values] { return *values; }});
}

void Command::Add(const OptionFields& fields) {
  for (const OptionField& field : fields.fields()) {
    if (!field.internal()) impl_->AddField(field, this);
  }
}

void Command::PassThrough(const std::string& prefix, std::vector<std::string>* arguments,
                          const std::string& help) {
  impl_->options.Add(PassedThrough{prefix, help, arguments});
}

}  // namespace roomtex
