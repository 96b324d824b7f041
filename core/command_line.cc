#include "core/command_line.h"

#include <algorithm>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <iostream>
#include <optional>
#include <set>
#include <utility>

#include <sys/resource.h>

#include "core/command_impl.h"
#include "core/command_outcome.h"
#include "core/command_report.h"
#include "core/error.h"
#include "core/input_guard.h"
#include "core/parallel.h"
#include "core/partial_path.h"
#include "core/resource_limits.h"
#include "core/signal_tidy.h"
#include "core/standard_files.h"
#include "core/version.h"

namespace roomtex {
namespace {

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

}  // namespace

const char* Version() { return ROOMTEX_VERSION; }

Command::Command(const std::string& name, const std::string& summary, const std::string& example)
    : impl_(std::make_unique<Impl>(name)) {
  impl_->summary = summary;
  impl_->example = example;
}

Command::~Command() = default;

void Command::Context::Warn(const std::string& message) const {
  progress.Warning(message);
  report.AddWarning(message);
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

int Command::Impl::EndEarly(int exit_code, const std::string& failure,
                            const std::vector<std::string>& arguments) const {
  std::cerr << name << ": " << failure << "\n";
  if (exit_code == kExitUsage) std::cerr << "See " << name << " --help\n";
  const std::string path = options.GivenAs("report_path", arguments);
  if (path.empty()) return exit_code;
  if (!MayReportEarly(name, path, arguments)) {
    if (IsReportOf(name, path)) {
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
    RequireReplaceableReport(common.report_path);
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
  if (outcome.IsOutOfMemory()) failure = TellMemory(progress, paths.inputs);
  if (ThreadsNotStarted() > 0) {
    Context{common, progress, report}.Warn(
        "the system did not give all threads that were asked for: it took longer with fewer "
        "(ulimit -u, or the container's limit)");
  }
  if (exit_code != kExitDone) {
    std::cerr << impl_->name << ": " << failure << "\n";
    if (report.trusted()) report.SetUntrusted(failure);
  }
  const bool ran_to_end = exit_code == kExitDone || exit_code == kExitUntrusted;
  const Outcome written = RunBody([&] {
    WriteReports(ran_to_end, impl_->MakeReport(report, progress), report, common.report_path);
  });
  if (written.exit_code != kExitDone) {
    std::cerr << impl_->name << ": " << written.failure << "\n";
    if (exit_code == kExitDone || exit_code == kExitUntrusted) exit_code = written.exit_code;
  }
  const std::string answer_at_end = TakeAnswer(ran_to_end);
  if (written.exit_code == kExitDone) std::cout << answer_at_end;
  if (!FlushAnswer(impl_->name) && (exit_code == kExitDone || exit_code == kExitUntrusted)) {
    exit_code = kExitInput;
  }
  return exit_code;
}

}  // namespace roomtex
