#include "core/command_line.h"

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <new>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include <opencv2/core.hpp>
#include <sys/resource.h>

#include "core/child_program.h"
#include "core/commit_together.h"
#include "core/error.h"
#include "core/input_guard.h"
#include "core/json_text.h"
#include "core/option_fields.h"
#include "core/option_list.h"
#include "core/output_file.h"
#include "core/output_set.h"
#include "core/parallel.h"
#include "core/partial_path.h"
#include "core/resource_limits.h"
#include "core/signal_tidy.h"
#include "core/standard_files.h"
#include "core/text.h"
#include "core/version.h"

namespace roomtex {
namespace {

std::string NumberText(double value) {
  if (std::isinf(value)) return value > 0 ? "inf" : "-inf";
  return Json(value).dump();
}

// Whether `path`, which has been written, holds this report anyway.
bool HoldsReport(const std::string& path, const std::vector<SetWithReport>& sets) {
  return std::any_of(sets.begin(), sets.end(), [&](const SetWithReport& one) {
    return !one.report_name.empty() &&
           path == (std::filesystem::path(one.set->folder()) / one.report_name).string();
  });
}

// In the set whose folder it belongs into, which may not be there yet.
std::string PlaceToWrite(const std::string& path,
                         const std::vector<std::shared_ptr<OutputSet>>& sets) {
  for (const auto& set : sets) {
    const std::string name = set->NameOf(path);
    if (!name.empty()) return set->Path(name);
  }
  return path;
}

constexpr char kOutOfMemory[] = "out of memory";

std::string Megabytes(uintmax_t bytes) {
  return std::to_string((bytes + 999999) / 1000000) + " MB";
}

// "--scan_path room.e57 (340 MB), --image_path photos (24 files, 120 MB)"
std::string WithSizes(const std::vector<GuardedPaths::OptionPath>& inputs) {
  namespace fs = std::filesystem;
  std::string text;
  for (const auto& [name, path] : inputs) {
    std::error_code error;
    uintmax_t bytes = 0, count = 0;
    if (fs::is_directory(path, error)) {
      for (fs::directory_iterator entry(path, error), end; !error && entry != end;
           entry.increment(error)) {
        std::error_code no_file;
        if (!entry->is_regular_file(no_file)) continue;
        const uintmax_t size = entry->file_size(no_file);
        if (no_file) continue;
        bytes += size;
        ++count;
      }
      text += (text.empty() ? "" : ", ") + ("--" + name + " " + path) + " (" +
              std::to_string(count) + " files, " + Megabytes(bytes) + ")";
    } else if (const std::string file = FileOf(path); fs::is_regular_file(file, error)) {
      text += (text.empty() ? "" : ", ") + ("--" + name + " " + path) + " (" +
              Megabytes(fs::file_size(file, error)) + ")";
    }
  }
  return text;
}

// Who ran out of it, at what, with which inputs, and what to do.
std::string TellMemory(const Progress& progress,
                       const std::vector<GuardedPaths::OptionPath>& inputs) {
  const std::vector<std::pair<std::string, double>>& stages = progress.stage_seconds();
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const std::string read = WithSizes(inputs);
  return std::string(kOutOfMemory) +
         (stages.empty() ? "" : " in the stage \"" + stages.back().first + "\"") + ": " +
         std::to_string(usage.ru_maxrss / 1024) + " MB were in use and more was needed, " +
         std::to_string(AvailableMemory() / 1000000) + " MB are free" +
         (read.empty() ? "" : "; read were " + read) +
         ". Give it more memory, a scan with fewer samples or smaller photos, or "
         "fewer threads (--num_threads)";
}

// Finishes what killed runs began in the folders of inputs and outputs, before anything there is
// read. Sentences about what cannot be finished.
std::vector<std::string> TidyFoldersOf(const GuardedPaths& paths) {
  std::set<std::string> folders;
  for (const auto* const some : {&paths.inputs, &paths.outputs}) {
    for (const auto& [name, path] : *some) {
      std::error_code error;
      const std::filesystem::path file = FileOf(path);
      const auto folder = std::filesystem::is_directory(file, error) ? file : file.parent_path();
      folders.insert(folder.empty() ? "." : folder.string());
    }
  }
  std::vector<std::string> stuck;
  for (const std::string& folder : folders) {
    for (std::string& sentence : RemoveLeftovers(folder)) stuck.push_back(std::move(sentence));
  }
  return stuck;
}

// How a piece of work ended.
struct Outcome {
  int exit_code = kExitDone;
  std::string failure;
  int signal = 0;  // that stopped it
};

Outcome RunBody(const std::function<void()>& body) {
  try {
    body();
    return {};
  } catch (const UsageError& error) {
    return {kExitUsage, error.what()};
  } catch (const InputError& error) {
    return {kExitInput, error.what()};
  } catch (const Interrupted& interrupted) {
    return {kExitInternalError, "", interrupted.signal};
  } catch (const std::bad_alloc&) {
    return {kExitInput, kOutOfMemory};
  } catch (const std::length_error&) {
    return {kExitInput, kOutOfMemory};
  } catch (const std::filesystem::filesystem_error& error) {
    return {kExitInput, error.path1().string() + ": cannot be looked at (" +
                            error.code().message() + "). Check the path and its links"};
  } catch (const cv::Exception& error) {
    if (error.code == cv::Error::StsNoMem) return {kExitInput, kOutOfMemory};
    return {kExitInternalError, "internal error: " + error.err};
  } catch (const std::exception& error) {
    // std::system_error of ours, std::runtime_error of Embree's and OpenCV's threads.
    if (std::string(error.what()).find("Resource temporarily unavailable") != std::string::npos) {
      return {kExitInput,
              "the system does not give the threads that are needed: raise ulimit -u, or the "
              "container's limit"};
    }
    return {kExitInternalError, std::string("internal error: ") + error.what()};
  } catch (...) {
    return {kExitInternalError, "internal error of an unknown kind"};
  }
}

}  // namespace

const char* Version() { return ROOMTEX_VERSION; }

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

  void AddText(const std::string& option_name, std::string* value, const std::string& help,
               const std::string& type, Kind kind) {
    Option option{option_name, type, help, *value};
    option.required = kind == Kind::kRequired;
    option.may_be_empty = type == "TEXT";
    option.set = [value](const std::vector<std::string>& texts) { *value = texts.back(); };
    option.value = [value] { return Json(*value); };
    options.Add(std::move(option));
  }

  void AddTexts(const std::string& option_name, std::vector<std::string>* values,
                const std::string& help, Kind kind) {
    Option option{option_name, "PATH", help, ""};
    option.required = kind == Kind::kRequired;
    option.repeatable = true;
    option.set = [values](const std::vector<std::string>& texts) { *values = texts; };
    option.value = [values] { return Json(*values); };
    options.Add(std::move(option));
  }

  // An integer whose 0 has a word.
  void AddIntOrWord(const OptionField& field, int* value) {
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

  static PathOption OnePath(const std::string& option_name, const std::string* value) {
    return {option_name, [value] {
              return value->empty() ? std::vector<std::string>() : std::vector<std::string>{*value};
            }};
  }

  GuardedPaths PathsToGuard() const;
  void AddField(const OptionField& field, Command* command);
  void AddCommonOptions(Command* command);
  // What --help and --version print; "" when neither is asked for.
  std::string Answer(const std::vector<std::string>& arguments) const;
  void Parse(const std::vector<std::string>& arguments) const;
  Json MakeReport(const Report& report, const Progress& progress) const;
  [[noreturn]] void RefuseReportPath() const;
  void RequireReplaceableReport() const;
  void CheckReportPath(const std::vector<SetWithReport>& sets, const CommitTogether& files) const;
  // Whether a file may become the report of a command that could not read its options, and so does
  // not know what is an input: none, or an earlier report of this command that lies in no folder
  // which the arguments name. There it belongs to results, which a slip does not change.
  bool MayReportTo(const std::string& path, const std::vector<std::string>& arguments) const;
  bool IsOwnReport(const std::string& path) const;
  // Ends a command that cannot begin: says why, also in --report_path, so that nobody takes the
  // report of the run before for this one's.
  int EndEarly(int exit_code, const std::string& failure,
               const std::vector<std::string>& arguments) const;
  // Puts the sets and copies of a command that ran to its end in their places, and --report_path.
  void WriteReports(int exit_code, const Report& report, const Progress& progress) const;
};

Command::Command(const std::string& name, const std::string& summary, const std::string& example)
    : impl_(std::make_unique<Impl>(name)) {
  impl_->summary = summary;
  impl_->example = example;
}

Command::~Command() = default;

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

void Command::Context::Warn(const std::string& message) const {
  progress.Warning(message);
  report.AddWarning(message);
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

std::string Command::Impl::Answer(const std::vector<std::string>& arguments) const {
  for (const std::string& argument : arguments) {
    if (argument == "--help" || argument == "-h") {
      return "Example:\n  " + example + "\n\n" + summary + "\n\nOptions:\n" + options.Help() +
             "  --version\n      Prints the version.\n  --help\n      Prints this help.\n";
    }
    if (argument == "--version") return name + " " + Version() + "\n";
  }
  return "";
}

void Command::Impl::Parse(const std::vector<std::string>& arguments) const {
  options.Parse(arguments);
  if (common.num_threads == 0 || common.num_threads < -1) {
    throw UsageError("--num_threads must be -1 (all) or positive");
  }
}

Json Command::Impl::MakeReport(const Report& report, const Progress& progress) const {
  Json json;
  json["command"] = name;
  json["version"] = Version();
  json["options"] = options.Effective();
  json["inputs"] = Json::object();
  for (const PathOption& input : inputs) {
    const std::vector<std::string> paths = input.paths();
    if (!paths.empty())
      json["inputs"][input.name] = paths.size() == 1 ? Json(paths[0]) : Json(paths);
  }
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

void Command::Impl::RefuseReportPath() const {
  throw UsageError("--report_path " + common.report_path +
                   " is a result of this command, which is kept. Give another --report_path");
}

// A slip of the finger must not put a report in the place of somebody's work.
void Command::Impl::RequireReplaceableReport() const {
  const std::string& path = common.report_path;
  if (path.empty()) return;
  RequireReplaceable(path);
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return;
  const int first = std::ifstream(path, std::ios::binary).get();
  if (first == '{' || first == std::ifstream::traits_type::eof()) return;
  throw UsageError("--report_path " + path +
                   " is there already and is no report. Give another --report_path");
}

// Before anything is put in its place.
void Command::Impl::CheckReportPath(const std::vector<SetWithReport>& sets,
                                    const CommitTogether& files) const {
  const std::string& path = common.report_path;
  if (path.empty() || HoldsReport(path, sets)) return;
  for (const SetWithReport& one : sets) {
    if (one.set->WillHold(path)) RefuseReportPath();
  }
  if (files.Holds(path)) RefuseReportPath();
  for (const std::string& other : OutputsSoFar()) {
    std::error_code error;
    if (std::filesystem::equivalent(path, other, error) && !error) RefuseReportPath();
  }
}

void Command::Impl::WriteReports(int exit_code, const Report& report,
                                 const Progress& progress) const {
  const bool ran = exit_code == kExitDone || exit_code == kExitUntrusted;
  std::vector<SetWithReport> sets = TakeSetsWithReport();
  std::unique_ptr<CommitTogether> files = TakeFilesAtEnd();
  if (!ran) sets.clear();
  if (!ran || files == nullptr) {
    files.reset();  // what waited in vain goes before another is made
    files = std::make_unique<CommitTogether>();
  }
  CheckReportPath(sets, *files);
  const Json json = MakeReport(report, progress);
  std::vector<std::shared_ptr<OutputSet>> folders;
  for (const SetWithReport& one : sets) {
    if (!one.report_name.empty()) WriteJson(one.set->Path(one.report_name), json);
    folders.push_back(one.set);
  }
  std::vector<std::string> paths = report.copies_of_any_end();
  if (ran) paths.insert(paths.end(), report.copies().begin(), report.copies().end());
  if (!common.report_path.empty()) paths.push_back(common.report_path);
  for (const std::string& path : paths) {
    if (!HoldsReport(path, sets)) WriteJson(PlaceToWrite(path, folders), json);
  }
  files->Finish(folders);
}

bool Command::Impl::MayReportTo(const std::string& path,
                                const std::vector<std::string>& arguments) const {
  namespace fs = std::filesystem;
  std::error_code error;
  const auto place_of = [&error](const std::string& file) {
    fs::path place = fs::weakly_canonical(fs::absolute(file, error), error);
    return place.has_filename() ? place : place.parent_path();
  };
  const fs::path place = place_of(path);
  size_t num_times = 0;
  for (const std::string& argument : arguments) {
    const size_t equals = BeginsWith(argument, "--") ? argument.find('=') : std::string::npos;
    const std::string value =
        FileOf(equals == std::string::npos ? argument : argument.substr(equals + 1));
    const fs::path other = place_of(value);
    if (value.empty() || other == other.root_path()) continue;
    if (other == place) ++num_times;
    const bool is_inside =
        std::mismatch(other.begin(), other.end(), place.begin(), place.end()).first == other.end();
    if (is_inside && other != place) return false;
  }
  if (num_times > 1) return false;
  return !fs::exists(fs::symlink_status(path, error)) || IsOwnReport(path);
}

bool Command::Impl::IsOwnReport(const std::string& path) const {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return false;
  const Json report = ReadJsonIfAny(path);
  return report.is_object() && report.value("command", Json()) == name;
}

int Command::Impl::EndEarly(int exit_code, const std::string& failure,
                            const std::vector<std::string>& arguments) const {
  std::cerr << name << ": " << failure << "\n";
  if (exit_code == kExitUsage) std::cerr << "See " << name << " --help\n";
  const std::string path = options.GivenAs("report_path", arguments);
  if (path.empty()) return exit_code;
  if (!MayReportTo(path, arguments)) {
    if (IsOwnReport(path)) {
      std::cerr << name << ": " << path << " stays as it was, the report of an earlier run\n";
    }
    return exit_code;
  }
  Report report;
  report.SetUntrusted(failure);
  const Outcome written =
      RunBody([&] { WriteJson(path, MakeReport(report, Progress(/*quiet=*/true))); });
  if (written.exit_code != kExitDone) std::cerr << name << ": " << written.failure << "\n";
  return exit_code;
}

int Command::Run(int argc, char** argv, const std::function<void(const Context&)>& body) {
  OpenStandardFiles();
  CommonOptions& common = impl_->common;
  impl_->AddCommonOptions(this);
  const std::vector<std::string> arguments(argv + std::min(argc, 1), argv + argc);
  const std::string answer = impl_->Answer(arguments);
  if (!answer.empty()) {
    std::cout << answer;
    return FlushAnswer(impl_->name) ? kExitDone : kExitInput;
  }
  Report report;
  std::optional<InputGuard> guard;
  GuardedPaths paths;
  std::vector<std::string> stuck;
  try {
    impl_->Parse(arguments);
    paths = impl_->PathsToGuard();
    RequireWorkingFolder(paths);
    stuck = TidyFoldersOf(paths);
    guard.emplace(paths);
    impl_->RequireReplaceableReport();
  } catch (const UsageError& error) {
    return impl_->EndEarly(kExitUsage, error.what(), arguments);
  } catch (const InputError& error) {
    return impl_->EndEarly(kExitInput, error.what(), arguments);
  }

  std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is an error of writing, not the end
  Progress progress(common.quiet);
  const SignalTidy tidy(impl_->name);
  for (const std::string& sentence : stuck) Context{common, progress, report}.Warn(sentence);
  const Outcome outcome = RunBody([&] {
    ProbeThreads(EffectiveThreads(common.num_threads));
    body({common, progress, report});
    progress.Finish();
  });
  int exit_code = outcome.exit_code;
  std::string failure = outcome.failure;
  if (outcome.signal != 0) StopBySignal(impl_->name, outcome.signal);
  if (exit_code == kExitDone && report.ends_untrusted()) {
    exit_code = kExitUntrusted;
    failure = "the result is not to be trusted: " + report.reason();
  }
  progress.Finish();
  if (failure == kOutOfMemory) failure = TellMemory(progress, paths.inputs);
  if (ThreadsNotStarted() > 0) {
    Context{common, progress, report}.Warn(
        "the system did not give all threads that were asked for: it took longer with fewer "
        "(ulimit -u, or the container's limit)");
  }
  if (exit_code != kExitDone) {
    std::cerr << impl_->name << ": " << failure << "\n";
    if (report.trusted()) report.SetUntrusted(failure);
  }
  const Outcome written = RunBody([&] { impl_->WriteReports(exit_code, report, progress); });
  if (written.exit_code != kExitDone) {
    std::cerr << impl_->name << ": " << written.failure << "\n";
    if (exit_code == kExitDone || exit_code == kExitUntrusted) exit_code = written.exit_code;
  }
  if (!FlushAnswer(impl_->name) && (exit_code == kExitDone || exit_code == kExitUntrusted)) {
    exit_code = kExitInput;
  }
  return exit_code;
}

}  // namespace roomtex
