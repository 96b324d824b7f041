#include "core/command_line.h"

#include <sys/resource.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <boost/property_tree/ini_parser.hpp>
#include <boost/property_tree/ptree.hpp>
#include <cstdio>
#include <iostream>
#include <new>
#include <set>

#include "core/error.h"
#include "core/output_file.h"
#include "core/version.h"

namespace roomtex {
namespace {

// Help as one list, an option a paragraph: name, value, default, then the text indented.
class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_option(const CLI::Option* option, bool) const override {
    std::string text = "  " + option->get_name();
    if (option->get_type_size() != 0) text += " " + option->get_type_name();
    if (option->get_required()) {
      text += " (required)";
    } else if (!option->get_default_str().empty()) {
      text += " (" + option->get_default_str() + ")";
    }
    return text + "\n      " + option->get_description() + "\n";
  }
};

bool ParseBool(const std::string& text, bool* value) {
  if (text == "1" || text == "true" || text.empty()) {
    *value = true;
  } else if (text == "0" || text == "false") {
    *value = false;
  } else {
    return false;
  }
  return true;
}

// "--Group.name value" pairs of an ini file, COLMAP's layout: keys before the first section are plain
// options, [Group] makes the keys below it --Group.key.
std::vector<std::pair<std::string, std::string>> ReadProjectFile(const std::string& path) {
  namespace pt = boost::property_tree;
  RequireFile(path, "Check --project_path");
  pt::ptree tree;
  try {
    pt::read_ini(path, tree);
  } catch (const pt::ini_parser_error& error) {
    throw InputError(path, LinePosition(static_cast<long>(error.line())),
                     "is not a line of an ini file (" + error.message() + ")",
                     "Expected key=value, [Section] or a line that starts with # or ;");
  }
  std::vector<std::pair<std::string, std::string>> options;
  for (const auto& [key, node] : tree) {
    if (node.empty()) options.emplace_back("--" + key, node.data());
    for (const auto& [name, leaf] : node) options.emplace_back("--" + key + "." + name, leaf.data());
  }
  return options;
}

std::string OptionName(const std::string& argument) {
  return argument.substr(0, argument.find('='));
}

}  // namespace

const char* Version() { return ROOMTEX_VERSION; }

struct Command::Impl {
  struct Effective {
    std::string name;
    std::function<Json()> value;
  };
  struct Input {
    std::string name;
    std::function<std::vector<std::string>()> paths;
  };
  struct Passed {
    std::string prefix, help;
    std::vector<std::string>* arguments;
  };

  std::string name, example;
  CLI::App app;
  std::shared_ptr<HelpFormatter> formatter = std::make_shared<HelpFormatter>();
  CommonOptions common;
  std::vector<Effective> effective;
  std::vector<Input> inputs;
  std::vector<Passed> passed;

  CLI::Option* Add(const std::string& option_name, const CLI::callback_t& callback,
                   const std::string& help, const std::string& type, const std::string& shown,
                   std::function<Json()> value, bool required = false) {
    CLI::Option* option = app.add_option("--" + option_name, callback, help);
    option->type_name(type)->default_str(shown)->required(required);
    option->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
    effective.push_back({option_name, std::move(value)});
    return option;
  }

  void AddText(const std::string& option_name, std::string* value, const std::string& help,
               const std::string& type, Kind kind) {
    Add(
        option_name,
        [value](const CLI::results_t& results) {
          *value = results.back();
          return true;
        },
        help, type, *value, [value] { return Json(*value); }, kind == Kind::kRequired)
        ->expected(1);
  }

  void AddTexts(const std::string& option_name, std::vector<std::string>* values,
                const std::string& help, Kind kind) {
    Add(
        option_name,
        [values](const CLI::results_t& results) {
          *values = results;
          return true;
        },
        help + " May be repeated.", "PATH", "", [values] { return Json(*values); },
        kind == Kind::kRequired)
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
        ->expected(1, 1 << 16);
  }

  std::vector<std::string> TakePassedThrough(std::vector<std::string> arguments) const;
  std::vector<std::string> AddProjectFile(std::vector<std::string> arguments) const;
  Json MakeReport(const Report& report, const Progress& progress) const;
  int Parse(int argc, char** argv);
};

Command::Command(const std::string& name, const std::string& summary, const std::string& example)
    : impl_(std::make_unique<Impl>()) {
  impl_->name = name;
  impl_->example = example;
  impl_->app.name(name);
  impl_->app.description(summary);
  impl_->app.formatter(impl_->formatter);
  impl_->app.set_help_flag();
  impl_->app.option_defaults()->always_capture_default(false);
}

Command::~Command() = default;

void Command::AddBool(const std::string& name, bool* value, const std::string& help) {
  impl_->Add(
             name,
             [value](const CLI::results_t& results) {
               return ParseBool(results.empty() ? "" : results.back(), value);
             },
             help, "1|0", *value ? "1" : "0", [value] { return Json(*value); })
      ->expected(0, 1);
}

void Command::AddInt(const std::string& name, int* value, const std::string& help) {
  impl_->Add(
             name,
             [value](const CLI::results_t& results) {
               return CLI::detail::lexical_cast(results.back(), *value);
             },
             help, "INT", std::to_string(*value), [value] { return Json(*value); })
      ->expected(1);
}

void Command::AddDouble(const std::string& name, double* value, const std::string& help) {
  impl_->Add(
             name,
             [value](const CLI::results_t& results) {
               double parsed = 0;
               if (!CLI::detail::lexical_cast(results.back(), parsed)) return false;
               if (!(parsed == parsed)) return false;
               *value = parsed;
               return true;
             },
             help, "NUMBER", Json(*value).dump(), [value] { return Json(*value); })
      ->expected(1);
}

void Command::AddString(const std::string& name, std::string* value, const std::string& help,
                        Kind kind) {
  impl_->AddText(name, value, help, "TEXT", kind);
}

void Command::AddChoice(const std::string& name, std::string* value,
                        const std::vector<std::string>& choices, const std::string& help) {
  std::string type;
  for (const std::string& choice : choices) type += (type.empty() ? "" : "|") + choice;
  impl_->Add(
             name,
             [value, choices](const CLI::results_t& results) {
               if (std::find(choices.begin(), choices.end(), results.back()) == choices.end()) {
                 return false;
               }
               *value = results.back();
               return true;
             },
             help, type, *value, [value] { return Json(*value); })
      ->expected(1);
}

void Command::AddInputPath(const std::string& name, std::string* value, const std::string& help,
                           Kind kind) {
  impl_->AddText(name, value, help, "PATH", kind);
  impl_->inputs.push_back({name, [value] {
                             return value->empty() ? std::vector<std::string>()
                                                   : std::vector<std::string>{*value};
                           }});
}

void Command::AddInputPaths(const std::string& name, std::vector<std::string>* values,
                            const std::string& help, Kind kind) {
  impl_->AddTexts(name, values, help, kind);
  impl_->inputs.push_back({name, [values] { return *values; }});
}

void Command::AddOutputPath(const std::string& name, std::string* value, const std::string& help,
                            Kind kind) {
  impl_->AddText(name, value, help, "PATH", kind);
}

void Command::AddOutputPaths(const std::string& name, std::vector<std::string>* values,
                             const std::string& help, Kind kind) {
  impl_->AddTexts(name, values, help, kind);
}

void Command::PassThrough(const std::string& prefix, std::vector<std::string>* arguments,
                          const std::string& help) {
  impl_->passed.push_back({prefix, help, arguments});
  impl_->effective.push_back({prefix.substr(2) + "*", [arguments] { return Json(*arguments); }});
}

void Command::Context::Warn(const std::string& message) const {
  progress.Warning(message);
  report.AddWarning(message);
}

std::vector<std::string> Command::Impl::TakePassedThrough(
    std::vector<std::string> arguments) const {
  std::vector<std::string> own;
  for (size_t i = 0; i < arguments.size(); ++i) {
    const auto taker = std::find_if(passed.begin(), passed.end(), [&](const Passed& p) {
      return arguments[i].rfind(p.prefix, 0) == 0;
    });
    if (taker == passed.end()) {
      own.push_back(arguments[i]);
      continue;
    }
    const size_t equals = arguments[i].find('=');
    taker->arguments->push_back(OptionName(arguments[i]));
    if (equals != std::string::npos) {
      taker->arguments->push_back(arguments[i].substr(equals + 1));
    } else if (i + 1 < arguments.size() && arguments[i + 1].rfind("--", 0) != 0) {
      taker->arguments->push_back(arguments[++i]);
    } else {
      throw UsageError(arguments[i] + " needs a value");
    }
  }
  return own;
}

// Options of --project_path come first, so that those of the command line, which stand later, win.
std::vector<std::string> Command::Impl::AddProjectFile(std::vector<std::string> arguments) const {
  std::string path;
  std::set<std::string> given;
  for (size_t i = 0; i < arguments.size(); ++i) {
    given.insert(OptionName(arguments[i]));
    if (arguments[i] == "--project_path" && i + 1 < arguments.size()) path = arguments[i + 1];
    if (arguments[i].rfind("--project_path=", 0) == 0) path = arguments[i].substr(15);
  }
  if (path.empty()) return arguments;
  std::vector<std::string> all;
  for (const auto& [option, value] : ReadProjectFile(path)) {
    if (given.count(option) > 0) continue;
    const bool known =
        app.get_option_no_throw(option) != nullptr ||
        std::any_of(passed.begin(), passed.end(),
                    [&, name = option](const Passed& p) { return name.rfind(p.prefix, 0) == 0; });
    if (!known) {
      throw UsageError(path + ": " + option.substr(2) + " is not an option of " + name +
                       ". See " + name + " --help");
    }
    all.push_back(option + "=" + value);
  }
  all.insert(all.end(), arguments.begin(), arguments.end());
  return all;
}

int Command::Impl::Parse(int argc, char** argv) {
  std::vector<std::string> arguments(argv + 1, argv + argc);
  for (const std::string& argument : arguments) {
    if (argument == "--help" || argument == "-h") {
      std::cout << "Example:\n  " << example << "\n\n" << app.get_description() << "\n\nOptions:\n";
      for (const CLI::Option* option : app.get_options()) {
        std::cout << formatter->make_option(option, false);
      }
      for (const Passed& p : passed) std::cout << "  " << p.prefix << "*\n      " << p.help << "\n";
      return -2;
    }
    if (argument == "--version") {
      std::cout << name << " " << Version() << "\n";
      return -2;
    }
  }
  arguments = TakePassedThrough(AddProjectFile(std::move(arguments)));
  std::reverse(arguments.begin(), arguments.end());  // CLI11 takes them from the back
  try {
    app.parse(arguments);
  } catch (const CLI::ParseError& error) {
    throw UsageError(std::string(error.what()));
  }
  return 0;
}

Json Command::Impl::MakeReport(const Report& report, const Progress& progress) const {
  Json json;
  json["command"] = name;
  json["version"] = Version();
  json["options"] = Json::object();
  for (const Effective& option : effective) json["options"][option.name] = option.value();
  json["inputs"] = Json::object();
  for (const Input& input : inputs) {
    const std::vector<std::string> paths = input.paths();
    if (!paths.empty()) json["inputs"][input.name] = paths.size() == 1 ? Json(paths[0]) : Json(paths);
  }
  for (const auto& [key, value] : report.inputs().items()) json["inputs"][key] = value;
  json["seconds"] = Json::object();
  for (const auto& [stage, seconds] : progress.stage_seconds()) {
    json["seconds"][stage] = json["seconds"].value(stage, 0.0) + seconds;
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  json["peak_memory_bytes"] = static_cast<int64_t>(usage.ru_maxrss) * 1024;
  json["warnings"] = report.warnings();
  json["trusted"] = report.trusted();
  json["reason"] = report.reason();
  for (const auto& [key, value] : report.keys().items()) json[key] = value;
  return json;
}

int Command::Run(int argc, char** argv, const std::function<void(const Context&)>& body) {
  CommonOptions& common = impl_->common;
  AddBool("quiet", &common.quiet, "No progress and no log on stderr.");
  AddInt("num_threads", &common.num_threads, "Threads to use; -1 = all of the machine.");
  AddInt("random_seed", &common.random_seed, "Same seed, same input: same output.");
  impl_->AddText("project_path", &common.project_path,
                 "Ini file with options (COLMAP's layout); the command line wins.", "PATH",
                 Kind::kOptional);
  impl_->AddText("report_path", &common.report_path, "Where to write the report (JSON).", "PATH",
                 Kind::kOptional);
  impl_->app.add_flag("--version", "Prints the version.");
  impl_->app.add_flag("--help", "Prints this help.");

  Report report;
  try {
    if (impl_->Parse(argc, argv) == -2) return kExitDone;
    if (common.num_threads == 0 || common.num_threads < -1) {
      throw UsageError("--num_threads must be -1 (all) or positive");
    }
  } catch (const UsageError& error) {
    std::cerr << impl_->name << ": " << error.what() << "\nSee " << impl_->name << " --help\n";
    return kExitUsage;
  } catch (const InputError& error) {
    std::cerr << impl_->name << ": " << error.what() << "\n";
    return kExitInput;
  }

  Progress progress(common.quiet);
  int exit_code = kExitDone;
  std::string failure;
  try {
    body({common, progress, report});
    progress.Finish();
    if (!report.trusted()) {
      exit_code = kExitUntrusted;
      failure = "the result is not to be trusted: " + report.reason();
    }
  } catch (const UsageError& error) {
    exit_code = kExitUsage;
    failure = error.what();
  } catch (const InputError& error) {
    exit_code = kExitInput;
    failure = error.what();
  } catch (const std::bad_alloc&) {
    exit_code = kExitInternalError;
    failure = "out of memory";
  } catch (const std::exception& error) {
    exit_code = kExitInternalError;
    failure = std::string("internal error: ") + error.what();
  }
  progress.Finish();
  if (exit_code != kExitDone) {
    std::cerr << impl_->name << ": " << failure << "\n";
    if (report.trusted()) report.SetUntrusted(failure);
  }
  const bool ran = exit_code == kExitDone || exit_code == kExitUntrusted;
  std::vector<std::string> paths = ran ? report.copies() : std::vector<std::string>();
  if (!common.report_path.empty()) paths.push_back(common.report_path);
  if (!paths.empty()) {
    try {
      const Json json = impl_->MakeReport(report, progress);
      for (const std::string& path : paths) WriteJson(path, json);
    } catch (const std::exception& error) {
      std::cerr << impl_->name << ": " << error.what() << "\n";
      if (exit_code == kExitDone) exit_code = kExitInput;
    }
  }
  return exit_code;
}

}  // namespace roomtex
