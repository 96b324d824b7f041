#include "workflow/run_steps.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <optional>

#include "core/child_program.h"
#include "core/error.h"
#include "core/output_file.h"
#include "core/pick_table.h"
#include "core/text.h"
#include "workflow/align_remedies.h"
#include "workflow/late_inputs.h"
#include "workflow/made_from.h"
#include "workflow/output_folder.h"
#include "workflow/own_commands.h"
#include "workflow/remaining_time.h"
#include "workflow/step.h"

namespace roomtex {
namespace fs = std::filesystem;
namespace {

constexpr char kReportStep[] = "report";
constexpr char kCopiedDatabase[] = "database.copy.db";
constexpr char kResultChanged[] = "its result was changed or removed";

std::string Joined(const std::vector<std::string>& texts, const char* between) {
  std::string joined;
  for (const std::string& text : texts) joined += (joined.empty() ? "" : between) + text;
  return joined;
}

class StepRunner {
 public:
  StepRunner(Chain* chain, const Command::Context& context)
      : chain_(*chain),
        context_(context),
        asked_(StepsAskedFor(chain->options())),
        names_(chain->options().output_path),
        state_(chain->At("steps.json")) {}

  RunResult Run() {
    RequireOwnResults(&chain_, state_);
    CheckLateInputs();
    PlanTime();
    for (const StepRow& row : StepTable()) {
      ThrowIfInterrupted();
      if (row.name == std::string(kReportStep) || !GoesOn(row)) break;
    }
    result_.whole = !result_.stop.stopped && WholeUntil("pictures");
    return std::move(result_);
  }

 private:
  // False: the run ends with this step. An input that is not as it should be, or gone, ends it like
  // a command that fails, so that the report does not stay the one of the run before.
  bool GoesOn(const StepRow& row) {
    try {
      return !row.applies(&chain_) || RunRow(row);
    } catch (const InputError& error) {
      result_.stop.stopped = true;
      result_.stop.cannot_begin = IndexOfStep(row.name) < asked_.first;
      result_.stop.step = result_.stop.cannot_begin ? StepTable()[asked_.first].name : row.name;
      result_.stop.reason = error.what();
      result_.stop.exit_code = kExitInput;
      return false;
    }
  }

  // ---- which steps

  // Not where roomtex-align is the first to run, which says the same, or has read them as they are.
  // Where it is not asked for (a site runs step by step) when nothing has been made yet.
  void CheckLateInputs() {
    const StepRow* const align = RowOf("align");
    if (!align->applies(&chain_) || asked_.first >= IndexOfStep(align->name)) return;
    const bool is_begun =
        std::any_of(StepTable().begin(), StepTable().end(),
                    [this](const StepRow& row) { return state_.Find(row.name) != nullptr; });
    if (IsAskedFor(align->name, chain_.options()) ? IsUpToDate(*align) : is_begun) return;
    context_.progress.Stage("look at scans");
    RequireReadableScans(chain_);
    // Which photos they name is known when there is a model.
    if (!chain_.PicksPath().empty()) ReadPicks(chain_.PicksPath());
    context_.progress.Finish();
    ThrowIfInterrupted();
  }

  bool IsForced() const { return !chain_.options().only.empty() || !chain_.options().from.empty(); }
  bool WholeUntil(const std::string& last) const {
    return std::any_of(result_.steps.begin(), result_.steps.end(), [&](const StepOutcome& step) {
      const StepState state = step.record.state;
      return step.name == last && step.known &&
             (state == StepState::kDone || state == StepState::kUntrusted);
    });
  }

  // False: the run ends here.
  bool RunRow(const StepRow& row) {
    const int index = IndexOfStep(row.name);
    StepOutcome outcome;
    outcome.name = row.name;
    outcome.does = row.does;
    if (!asked_.Holds(index)) {
      if (index < asked_.first || IsUpToDate(row)) Remember(&outcome);
      if (index < asked_.first) {
        RequireMade(row);
        outcome.outdated = WhyOutdated(row);
      }
      result_.steps.push_back(outcome);
      return true;
    }
    const Step step = MakeStep(row);
    const MadeFrom made_from = MadeFromOf(step);
    const std::optional<std::string> why = WhyRun(step, made_from);
    if (why) {
      if (state_.Find(step.name) != nullptr) {
        context_.progress.Note(step.name + ": once more, " + *why);
      }
      RunStep(step, made_from, *why);
      outcome.ran = true;
    } else {
      context_.progress.Note(step.name + ": done before, nothing has changed");
    }
    if (why) {
      time_.Finish(step.name, state_.Find(step.name)->seconds);
    } else {
      time_.Drop(step.name);
    }
    Remember(&outcome);
    result_.steps.push_back(outcome);
    return GoesOnBehind(outcome);
  }

  void Remember(StepOutcome* outcome) const {
    const StepRecord* const record = state_.Find(outcome->name);
    if (record == nullptr) return;
    outcome->known = true;
    outcome->record = *record;
    outcome->report = ReadJsonFile(chain_.ReportOf(outcome->name));
  }

  Step MakeStep(const StepRow& row) {
    Step step = row.make(&chain_);
    step.name = row.name;
    return step;
  }

  // A step that --from passes over must have left something.
  void RequireMade(const StepRow& row) {
    if (IsConsumed(row.name)) return;
    for (const std::string& path : MakeStep(row).outputs) {
      if (IsThere(path)) continue;
      // The matches take up the features: without these they cannot run either.
      const bool lacks_features =
          row.name == std::string("matches") && !IsThere(chain_.At(kPartialDatabase));
      const std::string first = lacks_features ? "features" : row.name;
      throw InputError(path, "", "is not there: the step " + first + " has to run first",
                       "Start without --from or --only, or with --from " + first);
    }
  }

  // ---- what is up to date

  // The database of the features becomes that of the matches.
  static bool IsConsumed(const std::string& name) { return name == "features"; }

  MadeFrom MadeFromOf(const Step& step) {
    MadeFrom from;
    from["roomtex"] = Version();
    bool uses_colmap = step.name == "mapper";
    for (size_t i = 0; i < step.commands.size(); ++i) {
      from["options" + (i == 0 ? "" : " " + std::to_string(i + 1))] =
          names_.Essential(step.commands[i]);
      uses_colmap |= step.commands[i][0] == chain_.options().colmap;
    }
    if (uses_colmap) from["COLMAP"] = chain_.Colmap().version();
    for (const std::string& path : step.inputs) {
      const std::string signature =
          chain_.IsPhotoFolder(path) ? SignatureOfPhotos(path) : Signature(path);
      if (signature.empty()) {
        throw InputError(path, "", "does not exist, and the step " + step.name + " needs it",
                         "Check the path");
      }
      // Two of one name, as scans in folders of their own: by their paths.
      from[from.count(FileName(path)) == 0 ? FileName(path) : names_.Of(path)] = signature;
    }
    for (const auto& [path, content] : step.files) from[FileName(path)] = HashText(content);
    if (step.name == "matches") {
      const StepRecord* const features = state_.Find("features");
      if (features != nullptr) from["features"] = HashText(Json(features->made_from).dump());
    }
    return from;
  }

  // Of a step behind the last one that was asked for: whether what an earlier run left still rests
  // on what is there now. If not, the report must not count it.
  bool IsUpToDate(const StepRow& row) {
    const StepRecord* const record = state_.Find(row.name);
    if (record == nullptr) return false;
    const Step step = MakeStep(row);
    return std::all_of(step.inputs.begin(), step.inputs.end(), IsThere) &&
           names_.Changes(record->made_from, MadeFromOf(step)).empty();
  }

  bool OutputsAreThere(StepRecord record) const {
    std::map<std::string, std::string> placed;
    for (const auto& [name, signature] : record.outputs) placed[names_.PlaceOf(name)] = signature;
    record.outputs = std::move(placed);
    return OutputsAreAsLeft(record);
  }

  // Why what a record left is not what its step would give now; none if it is.
  static std::optional<std::string> WhyStale(const StepRecord& record,
                                             const std::vector<std::string>& changed) {
    if (!changed.empty()) return "changed: " + Joined(changed, ", ");
    if (record.state == StepState::kStarted) return "it was interrupted";
    if (record.state == StepState::kFailed) return "it failed the last time";
    return std::nullopt;
  }

  // Of a step that is passed over. Another version of roomtex or COLMAP is no reason: what it made
  // is a result of the inputs that are there.
  std::string WhyOutdated(const StepRow& row) {
    const StepRecord* const record = state_.Find(row.name);
    if (record == nullptr) return IsConsumed(row.name) ? "" : "it has not run";
    const Step step = MakeStep(row);
    for (const std::string& path : step.inputs) {
      if (!IsThere(path)) return FileName(path) + " is not there any more";
    }
    std::vector<std::string> changed = names_.Changes(record->made_from, MadeFromOf(step));
    changed.erase(std::remove_if(changed.begin(), changed.end(),
                                 [](const std::string& name) {
                                   return name == "roomtex" || name == "COLMAP";
                                 }),
                  changed.end());
    if (const auto why = WhyStale(*record, changed)) return *why;
    return IsConsumed(row.name) || OutputsAreThere(*record) ? "" : kResultChanged;
  }

  // Why a step has to run; none if it has not.
  std::optional<std::string> WhyRun(const Step& step, const MadeFrom& made_from) {
    if (IsForced()) return "asked for";
    const StepRecord* const record = state_.Find(step.name);
    if (record == nullptr) return "for the first time";
    const auto why = WhyStale(*record, names_.Changes(record->made_from, made_from));
    if (why) return why;
    if (IsConsumed(step.name)) {
      if (IsThere(step.outputs[0]) || MatchesHoldTheseFeatures()) return std::nullopt;
      return "its result is not there";
    }
    if (!OutputsAreThere(*record)) return kResultChanged;
    return std::nullopt;
  }

  // Matches were begun in another way than they would be now.
  bool HoldsOtherMatches() {
    const StepRecord* const record = state_.Find("matches");
    if (record == nullptr || record->state == StepState::kDone) return false;
    const Step step = MakeStep(*RowOf("matches"));
    return !names_.Changes(record->made_from, MadeFromOf(step)).empty();
  }

  // Whichever way they were matched, the database has the features that are asked for now.
  bool MatchesHoldTheseFeatures() {
    const StepRecord* const record = state_.Find("matches");
    if (record == nullptr || !IsThere(chain_.At(kDatabase))) return false;
    const MadeFrom now = MadeFromOf(MakeStep(*RowOf("matches")));
    const auto features = record->made_from.find("features");
    return features != record->made_from.end() && now.count("features") != 0 &&
           features->second == now.at("features") &&
           (record->state != StepState::kDone || OutputsAreThere(*record));
  }

  static const StepRow* RowOf(const std::string& name) {
    for (const StepRow& row : StepTable()) {
      if (row.name == name) return &row;
    }
    return nullptr;
  }

  // ---- running

  void RunStep(const Step& step, const MadeFrom& made_from, const std::string& why) {
    PrepareDatabase(step, made_from);
    StepRecord record;
    record.made_from = made_from;
    record.notes = step.notes;
    const std::vector<CommandLine> first = ClearMatches(step);
    // Killed before they are cleared, they are those of other options still.
    if (!first.empty()) record.made_from["matches"] = "not cleared";
    for (const CommandLine& line : first) record.commands.push_back(CommandText(line));
    for (const CommandLine& line : step.commands) record.commands.push_back(CommandText(line));
    state_.Set(step.name, record);
    for (const std::string& note : step.notes) context_.progress.Note(note);
    for (const auto& [path, content] : step.files) {
      OutputFile file(path);
      file.stream() << content;
      file.Commit();
    }
    std::ofstream(chain_.LogOf(step.name), std::ios::trunc)
        << "roomtex-auto " << Version() << ": " << step.name << ", " << why << "\n";
    std::error_code ignored;
    fs::remove(chain_.ReportOf(step.name), ignored);
    context_.progress.Stage(step.name);
    started_ = std::chrono::steady_clock::now();
    running_ = step.name;
    share_ = -1;
    command_ = 0;
    if (step.action) {
      context_.progress.Note("$ " + record.commands[0]);
      step.action([this](double share) {
        share_ = share;
        ShowTime();
      });
      record.state = StepState::kDone;
    } else {
      num_commands_ = first.size() + step.commands.size();
      if (RunCommands(step, first, &record)) {
        record.made_from = made_from;
        if (!first.empty()) state_.Set(step.name, record);
        if (RunCommands(step, step.commands, &record)) record.state = StepState::kDone;
      }
    }
    record.seconds = Elapsed();
    if (!IsConsumed(step.name)) {
      // Asked again: how many models the mapper makes is known now.
      for (const std::string& path : RowOf(step.name)->make(&chain_).outputs) {
        record.outputs[names_.Of(path)] = Signature(path);
      }
    }
    state_.Set(step.name, record);
    context_.progress.Finish();
  }

  // COLMAP goes on where it was, if the database is one of the same photos and options; otherwise
  // it is made anew.
  void PrepareDatabase(const Step& step, const MadeFrom& made_from) {
    const std::string partial = chain_.At(kPartialDatabase);
    if (step.name == "features") {
      const StepRecord* const before = state_.Find(step.name);
      const bool same = before != nullptr && before->state == StepState::kStarted &&
                        names_.Changes(before->made_from, made_from).empty();
      if (!same) RemoveDatabase(partial);
    }
    if (step.name == "matches" && !IsThere(partial) && !IsThere(chain_.At(kDatabase))) {
      throw InputError(partial, "", "is not there: the step features has to run first",
                       "Start with --from features");
    }
  }

  // What gives the step matches a database of features alone. Photos that are matched once more
  // have theirs in the database of the matches; that one stays until the new one is whole.
  std::vector<CommandLine> ClearMatches(const Step& step) {
    if (step.name != "matches") return {};
    const std::string partial = chain_.At(kPartialDatabase);
    const auto clear = [this](const std::string& path) {
      return CommandLine{chain_.options().colmap,
                         "database_cleaner",
                         "--type",
                         "matches",
                         "--database_path",
                         path};
    };
    if (IsThere(partial)) {
      return HoldsOtherMatches() ? std::vector<CommandLine>{clear(partial)}
                                 : std::vector<CommandLine>();
    }
    const std::string copy = chain_.At(kCopiedDatabase);
    RemoveDatabase(copy);
    return {{"cp", chain_.At(kDatabase), copy}, clear(copy), {"mv", copy, partial}};
  }

  static void RemoveDatabase(const std::string& path) {
    std::error_code ignored;
    for (const char* more : {"", "-journal", "-wal", "-shm"}) fs::remove(path + more, ignored);
  }

  // False: one failed, as the record says then.
  bool RunCommands(const Step& step, const std::vector<CommandLine>& commands, StepRecord* record) {
    for (const CommandLine& line : commands) {
      if (line[0] != "mv" && line[0] != "cp") context_.progress.Note("$ " + CommandText(line));
      const ChildRun run = RunOne(step, line);
      ++command_;
      record->cpu_seconds += run.cpu_seconds;
      record->peak_memory_bytes = std::max(record->peak_memory_bytes, run.peak_memory_bytes);
      if (run.success) continue;
      const bool is_ours = BeginsWith(line[0], "roomtex-");
      record->reason = is_ours ? ReasonOf(step.commands[0][0], chain_.ReportOf(step.name), run)
                               : line[0] + " " + run.failure + ": " + run.LastLines();
      const bool untrusted = is_ours && run.exit_code == kExitUntrusted;
      record->state = untrusted ? StepState::kUntrusted : StepState::kFailed;
      exit_code_ = untrusted             ? kExitUntrusted
                   : !is_ours            ? kExitInput
                   : run.exit_code < 128 ? run.exit_code
                                         : kExitInternalError;
      return false;
    }
    return true;
  }

  ChildRun RunOne(const Step& step, const CommandLine& line) {
    CommandLine arguments = line;
    const bool is_ours = BeginsWith(line[0], "roomtex-");
    arguments[0] = line[0] == chain_.options().colmap ? chain_.Colmap().path()
                   : is_ours                          ? FindOwnCommand(line[0])
                                                      : FindProgram(line[0], "Install it");
    ChildSettings settings;
    settings.log_path = chain_.LogOf(step.name);
    settings.stop_signal = is_ours ? SIGTERM : SIGKILL;
    settings.on_line = [&](const std::string& text) {
      const double share = ShareOfLine(text);
      if (share >= 0) share_ = (command_ + share) / static_cast<double>(num_commands_);
      const bool is_warning = BeginsWith(text, "warning: ");
      if (is_ours && is_warning) context_.Warn(step.name + ": " + text.substr(9));
    };
    settings.on_wait = [this] { ShowTime(); };
    return RunChild(arguments, settings);
  }

  // ---- time

  double Elapsed() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count();
  }

  void PlanTime() {
    std::vector<std::string> steps;
    std::map<std::string, double> last_time;
    for (const StepRow& row : StepTable()) {
      const int index = IndexOfStep(row.name);
      if (!asked_.Holds(index) || !row.applies(&chain_)) continue;
      steps.emplace_back(row.name);
      const StepRecord* const record = state_.Find(row.name);
      if (record != nullptr && record->seconds > 0) last_time[row.name] = record->seconds;
    }
    time_.SetSteps(steps, last_time);
    const AutoOptions& options = chain_.options();
    if (options.image_path.empty()) return;
    const std::vector<PhotoFacts>& photos = chain_.Photos(options.image_path);
    double megapixels = 0;
    for (const PhotoFacts& photo : photos) megapixels += photo.Megapixels();
    time_.SetPhotos(photos.size(), megapixels / static_cast<double>(photos.size()));
  }

  void ShowTime() {
    const double left = time_.Seconds(running_, share_, Elapsed());
    double share = share_;
    if (share < 0) share = std::min(0.95, Elapsed() / std::max(1.0, time_.Expected(running_)));
    context_.progress.Share(share, "about " + DurationText(left) + " left for everything");
  }

  // ---- where it ends

  bool GoesOnBehind(const StepOutcome& outcome) {
    const StepRecord& record = outcome.record;
    if (record.state == StepState::kDone) return true;
    const AutoOptions& options = chain_.options();
    const bool untrusted = record.state == StepState::kUntrusted;
    if (untrusted && outcome.name == "associate" && options.patterned == "auto") {
      context_.progress.Note("no pairs of patterned and plain photos: all are ordinary photos");
      return true;
    }
    if (untrusted && IsLeftToAlign(outcome) && IndexOfStep("align") <= asked_.last) {
      context_.progress.Note("roomtex-align, which knows the scan, has the last word on that");
      return true;
    }
    if (untrusted && options.accept_untrusted && !record.outputs.empty() &&
        HasModel(outcome.name)) {
      context_.Warn(outcome.name + " is not to be trusted: " + record.reason);
      return true;
    }
    result_.stop.stopped = true;
    result_.stop.step = outcome.name;
    result_.stop.reason = record.reason;
    result_.stop.exit_code = untrusted         ? static_cast<int>(kExitUntrusted)
                             : exit_code_ != 0 ? exit_code_
                                               : static_cast<int>(kExitInput);
    result_.stop.remedies = Remedies(outcome.name, untrusted);
    return false;
  }

  // A refusal of roomtex-align is nothing but a report, and names no scans.
  bool HasModel(const std::string& step) const {
    return step != "align" || ReadJsonFile(chain_.ReportOf(step)).contains("scans");
  }

  std::vector<std::string> Remedies(const std::string& step, bool untrusted) const {
    std::vector<std::string> remedies;
    const std::string again = CommandText(chain_.AutoCommand());
    if (!untrusted) {
      remedies.push_back("What it printed: " + chain_.LogOf(step));
      remedies.push_back("Then start again, it goes on from here: " + again);
      return remedies;
    }
    if (step == "align") {
      remedies = AlignRemedies(chain_, ReadJsonFile(chain_.ReportOf(step)));
    } else {
      if (step == "mapper") {
        remedies.emplace_back(
            "Add photos where it says that they are missing: between photos that do not see the "
            "same, taken from another place, not only turned");
      } else if (step == "associate") {
        remedies.emplace_back("If these are ordinary photos, start again with --patterned 0");
      }
      remedies.push_back("Then start again, it goes on from here: " + again);
    }
    if (HasModel(step) && step != "associate") {
      remedies.push_back("To go on all the same: " + again +
                         (chain_.options().accept_untrusted ? "" : " --accept_untrusted 1"));
    }
    return remedies;
  }

  Chain& chain_;
  const Command::Context& context_;
  const StepRange asked_;
  const PathNames names_;
  RunState state_;
  RemainingTime time_;
  RunResult result_;
  std::chrono::steady_clock::time_point started_;
  std::string running_;
  double share_ = -1;
  int command_ = 0, exit_code_ = 0;
  size_t num_commands_ = 1;
};

}  // namespace

bool IsLeftToAlign(const StepOutcome& outcome) {
  if (outcome.name != "mapper" || outcome.record.outputs.empty()) return false;
  const Json reasons =
      outcome.report.is_object() ? outcome.report.value("reasons", Json()) : Json();
  if (!reasons.is_array() || reasons.empty()) return false;
  return std::all_of(reasons.begin(), reasons.end(), [](const Json& reason) {
    const Json about = reason.is_object() ? reason.value("about", Json()) : Json();
    return about == "motion" || about == "calibration";
  });
}

RunResult RunSteps(Chain* chain, const Command::Context& context) {
  return StepRunner(chain, context).Run();
}

void PrintSteps(Chain* chain) {
  for (const StepRow& row : StepTable()) {
    if (row.name == std::string(kReportStep) || !row.applies(chain)) continue;
    if (!IsAskedFor(row.name, chain->options())) continue;
    Step step;
    try {
      step = row.make(chain);
    } catch (const InputError&) {
      std::printf("# %s: known when the steps before have run\n", row.name);
      continue;
    }
    std::printf("# %s: %s\n", row.name, row.does);
    for (const std::string& note : step.notes) std::printf("#   %s\n", note.c_str());
    for (const CommandLine& line : step.commands) std::printf("%s\n", CommandText(line).c_str());
  }
}

}  // namespace roomtex
