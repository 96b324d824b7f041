#include "core/command_report.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>
#include <system_error>

#include "core/commit_together.h"
#include "core/error.h"
#include "core/input_guard.h"
#include "core/json_text.h"
#include "core/output_set.h"
#include "core/text.h"

namespace roomtex {
namespace {

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

[[noreturn]] void RefuseReportPath(const std::string& path) {
  throw UsageError("--report_path " + path +
                   " is a result of this command, which is kept. Give another --report_path");
}

// Before anything is put in its place.
void CheckReportPath(const std::string& path, const std::vector<SetWithReport>& sets,
                     const CommitTogether& files) {
  if (path.empty() || HoldsReport(path, sets)) return;
  for (const SetWithReport& one : sets) {
    if (one.set->WillHold(path)) RefuseReportPath(path);
  }
  if (files.Holds(path)) RefuseReportPath(path);
  for (const std::string& other : OutputsSoFar()) {
    std::error_code error;
    if (std::filesystem::equivalent(path, other, error) && !error) RefuseReportPath(path);
  }
}

}  // namespace

void RequireReplaceableReport(const std::string& path) {
  if (path.empty()) return;
  RequireReplaceable(path);
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return;
  const int first = std::ifstream(path, std::ios::binary).get();
  if (first == '{' || first == std::ifstream::traits_type::eof()) return;
  throw UsageError("--report_path " + path +
                   " is there already and is no report. Give another --report_path");
}

bool IsReportOf(const std::string& command, const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return false;
  const Json report = ReadJsonIfAny(path);
  return report.is_object() && report.value("command", Json()) == command;
}

bool MayReportEarly(const std::string& command, const std::string& path,
                    const std::vector<std::string>& arguments) {
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
  return !fs::exists(fs::symlink_status(path, error)) || IsReportOf(command, path);
}

void WriteReports(bool ran_to_end, const Json& json, const Report& report,
                  const std::string& report_path) {
  std::vector<SetWithReport> sets = TakeSetsWithReport();
  std::unique_ptr<CommitTogether> files = TakeFilesAtEnd();
  if (!ran_to_end) sets.clear();
  if (!ran_to_end || files == nullptr) {
    files.reset();  // what waited in vain goes before another is made
    files = std::make_unique<CommitTogether>();
  }
  CheckReportPath(report_path, sets, *files);
  std::vector<std::shared_ptr<OutputSet>> folders;
  for (const SetWithReport& one : sets) {
    if (!one.report_name.empty()) WriteJson(one.set->Path(one.report_name), json);
    folders.push_back(one.set);
  }
  std::vector<std::string> paths = report.copies_of_any_end();
  if (ran_to_end) paths.insert(paths.end(), report.copies().begin(), report.copies().end());
  if (!report_path.empty()) paths.push_back(report_path);
  for (const std::string& path : paths) {
    if (!HoldsReport(path, sets)) WriteJson(PlaceToWrite(path, folders), json);
  }
  files->Finish(folders);
}

}  // namespace roomtex
