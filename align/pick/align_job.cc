#include "align/pick/align_job.h"

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstring>
#include <filesystem>

#include "core/child_program.h"
#include "core/error.h"
#include "core/json_text.h"
#include "core/resource_limits.h"
#include "core/result_names.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr size_t kMaxLog = 300;                 // lines
constexpr size_t kMaxLine = 4000;               // characters
constexpr char kSpeaker[] = "roomtex-align: ";  // before what it has to say

// The stages that roomtex-align prints, in their order, with their seconds on a scan of 2 M samples
// and 30 photos (those of a search: 320 000 samples and 12 photos): what a share of the whole is
// measured by. A stage prints when it is done.
struct Stage {
  const char* name;
  double seconds;
};
using Stages = std::vector<Stage>;
const Stages kStagesByPicks = {
    {"read model", 0.1},    {"read photos", 0.05},
    {"read scan", 0.3},     {"stations", 0.3},
    {"planes", 0.9},        {"scan surface", 0.1},
    {"lenses", 0.2},        {"pose from picks", 0.05},
    {"scale", 0.4},         {"surface refinement", 0.1},
    {"trust", 0.05},        {"bundle adjustment", 6},
    {"single photos", 0.1}, {"agreement", 0.9},
    {"overlays", 0.9},      {"write", 0.1},
};
const Stages kStagesOfSearch = {
    {"read model", 0.1},
    {"read scan", 0.1},
    {"stations", 0.3},
    {"planes", 1.2},
    {"search", 12},
    {"search verdict", 1.5},
    {"search by appearance", 0.7},
    {"features of the scan", 0.9},
    {"features of the photos", 1},
    {"scan surface", 0.1},
    {"lenses", 0.4},
    {"surface refinement", 0.1},
    {"trust", 0.05},
    {"bundle adjustment", 4},
    {"single photos", 0.1},
    {"agreement", 1.5},
    {"overlays", 0.9},
    {"write", 0.1},
};
const Stages& StagesOf(bool searches) { return searches ? kStagesOfSearch : kStagesByPicks; }

// Index of the stage whose line this is; -1 if it is none.
int StageOf(const std::string& line, const Stages& stages) {
  for (size_t i = 0; i < stages.size(); ++i) {
    const std::string start = std::string(stages[i].name) + "  ";
    const bool is_stage = BeginsWith(line, start) && line.compare(line.size() - 2, 2, " s") == 0;
    if (is_stage) return static_cast<int>(i);
  }
  return -1;
}

double ShareDone(int stages_done, const Stages& stages) {
  double done = 0, all = 0;
  for (size_t i = 0; i < stages.size(); ++i) {
    all += stages[i].seconds;
    if (static_cast<int>(i) < stages_done) done += stages[i].seconds;
  }
  return done / all;
}

// An untrusted result does not replace a trusted one: of both folders the one written last.
std::string FolderOfRun(const std::string& aligned_path) {
  std::error_code error, other_error;
  const std::string aside = aligned_path + ".untrusted";
  const auto time = std::filesystem::last_write_time(aligned_path + "/" + kAlignReportName, error);
  const auto aside_time =
      std::filesystem::last_write_time(aside + "/" + kAlignReportName, other_error);
  if (other_error) return aligned_path;
  return error || aside_time > time ? aside : aligned_path;
}

}  // namespace

AlignJob::AlignJob(std::string program, std::string aligned_path, TakeReport take_report)
    : program_(std::move(program)),
      aligned_path_(std::move(aligned_path)),
      take_report_(std::move(take_report)) {}

AlignJob::~AlignJob() { Cancel(); }

void AlignJob::Start(std::vector<std::string> arguments, bool searches) {
  const std::lock_guard<std::mutex> starting(starting_);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (state_ == "running") throw UsageError("An alignment is running already.");
  }
  if (follower_.joinable()) follower_.join();
  std::vector<std::string> line = {FindProgram(program_, "It belongs beside roomtex-pick")};
  line.insert(line.end(), arguments.begin(), arguments.end());
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    state_ = "running";
    arguments_ = std::move(arguments);
    searches_ = searches;
    stages_done_ = models_done_ = 0;
    num_models_ = 1;
    log_.clear();
    errors_.clear();
    overlays_.clear();
    verdict_ = {};
  }
  cancelled_ = false;
  follower_ = StartThread([this, line] { Follow(line); });
}

void AlignJob::Follow(const std::vector<std::string>& line) {
  ChildSettings settings;
  settings.stop_signal = SIGTERM;
  settings.should_stop = [this] { return cancelled_.load(); };
  settings.on_line = [this](const std::string& said) { TakeLine(said); };
  try {
    Finish(RunChild(line, settings).exit_code);
  } catch (const std::exception& failure) {
    TakeLine(std::string(kSpeaker) + failure.what());
    Finish(kExitInternalError);
  }
}

void AlignJob::TakeLine(const std::string& line) {
  const std::lock_guard<std::mutex> lock(mutex_);
  log_.push_back(line.substr(0, kMaxLine));
  if (log_.size() > kMaxLog) log_.pop_front();
  const int stage = StageOf(line, StagesOf(searches_));
  if (stage >= 0) stages_done_ = std::max(stages_done_, stage + 1);
  int model = 0, num_models = 0;
  if (std::sscanf(line.c_str(), "  sparse model [%d/%d]", &model, &num_models) == 2 && model > 0 &&
      num_models >= model) {
    models_done_ = model - 1;
    num_models_ = num_models;
    stages_done_ = 0;
  }
  if (BeginsWith(line, kSpeaker)) {
    errors_.push_back(line.substr(std::strlen(kSpeaker)));
  } else if (!errors_.empty() && stage < 0) {
    errors_.push_back(line);  // a message of several lines
  }
}

void AlignJob::Finish(int exit_code) {
  // Only these two write a report: another one is of an earlier run.
  const bool has_report = exit_code == kExitDone || exit_code == kExitUntrusted;
  const std::string written = has_report ? FolderOfRun(aligned_path_) : aligned_path_;
  const Json report = has_report ? ReadJsonIfAny(written + "/" + kAlignReportName) : Json();
  const std::string sentence =
      has_report && !cancelled_ ? take_report_(written, report) : std::string();
  const std::lock_guard<std::mutex> lock(mutex_);
  written_path_ = written;
  if (cancelled_) {
    verdict_ = {"failed", "Ended before it was done.", {}, {}};
  } else {
    try {
      verdict_ = JudgeRun(exit_code, report, errors_);
    } catch (const Json::exception&) {
      verdict_ = JudgeRun(exit_code, Json(), errors_);
    }
    if (!sentence.empty()) verdict_.sentences.push_back(sentence);
    if (report.is_object() && report.contains("overlays") && report["overlays"].is_array()) {
      for (const Json& path : report["overlays"]) {
        if (!path.is_string()) continue;
        overlays_.push_back(std::filesystem::path(path.get<std::string>()).filename().string());
      }
    }
  }
  exit_code_ = exit_code;
  state_ = "done";
}

void AlignJob::Cancel() {
  const std::lock_guard<std::mutex> starting(starting_);
  cancelled_ = true;
  if (follower_.joinable()) follower_.join();
}

Json AlignJob::State() {
  const std::lock_guard<std::mutex> lock(mutex_);
  const bool running = state_ == "running", done = state_ == "done";
  Json json;
  json["state"] = state_;
  const Stages& stages = StagesOf(searches_);
  const bool in_stage = running && stages_done_ < static_cast<int>(stages.size());
  json["stage"] = in_stage ? stages[stages_done_].name : "";
  const double share = (models_done_ + ShareDone(stages_done_, stages)) / num_models_;
  json["share"] = running ? Json(share) : done ? Json(1.0) : Json();
  json["log"] = log_;
  json["exit_code"] = done ? Json(exit_code_) : Json();
  json["verdict"] = verdict_.verdict;
  json["headline"] = verdict_.headline;
  json["sentences"] = verdict_.sentences;
  json["facts"] = Json::array();
  for (const auto& [name, value] : verdict_.facts) {
    json["facts"].push_back({{"name", name}, {"value", value}});
  }
  std::vector<std::string> line = {"roomtex-align"};
  line.insert(line.end(), arguments_.begin(), arguments_.end());
  json["command"] = state_ == "idle" ? "" : CommandText(line);
  json["overlays"] = overlays_;
  return json;
}

std::string AlignJob::OverlayPath(const std::string& name) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const bool known = std::find(overlays_.begin(), overlays_.end(), name) != overlays_.end();
  return known ? written_path_ + "/overlays/" + name : "";
}

}  // namespace roomtex
