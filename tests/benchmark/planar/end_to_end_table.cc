#include "tests/benchmark/planar/end_to_end_table.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <mutex>

#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/parallel.h"
#include "core/statistics.h"
#include "tests/benchmark/planar/in_process_table.h"
#include "tests/benchmark/planar/pose_judge.h"
#include "tests/benchmark/planar/program_run.h"
#include "tests/benchmark/planar/wilson_interval.h"
#include "tests/colmap_ext/simulated_database.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using Kind = PlanarSet::Kind;

struct MapperOutcome {
  ProgramRun run;
  ModelVerdict verdict;
  bool complete = false;  // every photo that belongs into the model
  bool Right() const { return complete && verdict.poses_right; }
  bool Wrong() const { return verdict.num_registered > 0 && !verdict.poses_right; }
};

struct BothOutcomes {
  int seed = 0;
  MapperOutcome colmap, ours;
  std::string reason;           // of exit 4, from the report
  double init_cpu_seconds = 0;  // the initialiser alone
};

void Judge(const PlanarSet& set, const SimulatedViews& views, SparseModel model,
           MapperOutcome* outcome) {
  // A ghost view belongs in no place; standing at its true one harms nothing.
  const size_t num_wanted = views.images.size() - (set.kind == Kind::kGhost ? 1 : 0);
  outcome->complete = model.images.size() >= num_wanted;
  outcome->verdict = JudgeModel(model, views);
  // Without a baseline there is no right model at all.
  if (set.kind == Kind::kTurnOnly) outcome->verdict.poses_right = false;
  if (set.kind != Kind::kGrid || outcome->verdict.poses_right) return;
  outcome->verdict.poses_right =
      JudgeModel(std::move(model), WholeOptimumFromTruth(views)).poses_right;
}

MapperOutcome RunColmap(const PlanarSet& set, const SimulatedViews& views, const TempFolder& folder,
                        const EndToEndOptions& options) {
  MapperOutcome outcome;
  std::filesystem::create_directories(folder / "colmap");
  std::vector<std::string> arguments = {
      options.colmap,    "mapper",        "--database_path", folder / "database.db", "--image_path",
      folder / "photos", "--output_path", folder / "colmap", "--random_seed",        "0"};
  for (const char* option :
       {"ba_refine_focal_length", "ba_refine_principal_point", "ba_refine_extra_params"}) {
    arguments.push_back(std::string("--Mapper.") + option);
    arguments.push_back("0");
  }
  arguments.insert(arguments.end(), {"--Mapper.num_threads", "1"});
  // By default COLMAP drops a model that stays small and starts anew, which serves it well where a
  // good model exists. Along weak triples there is none, and nothing would be left.
  if (set.kind == Kind::kWeakTriples) {
    arguments.insert(arguments.end(), {"--Mapper.multiple_models", "0"});
  }
  outcome.run = RunProgram(arguments, folder / "colmap.log");
  Judge(set, views, LargestModel(folder / "colmap"), &outcome);
  return outcome;
}

MapperOutcome RunOurs(const PlanarSet& set, const SimulatedViews& views, const TempFolder& folder,
                      const EndToEndOptions& options) {
  MapperOutcome outcome;
  outcome.run = RunProgram(
      {options.roomtex_mapper, "--quiet", "--database_path", folder / "database.db", "--image_path",
       folder / "photos", "--output_path", folder / "ours", "--report_path", folder / "report.json",
       "--num_threads", "1", "--colmap", options.colmap},
      folder / "ours.log");
  const bool written = std::filesystem::exists(folder / "ours/0/images.bin");
  Judge(set, views, written ? ReadSparseModel(folder / "ours/0") : SparseModel(), &outcome);
  return outcome;
}

BothOutcomes RunSet(const PlanarSet& set, int seed, const EndToEndOptions& options) {
  const TempFolder folder;
  const SimulatedViews views = MakeSet(set, seed);
  WriteSimulatedDatabase(views, folder.path());
  BothOutcomes outcomes;
  outcomes.seed = seed;
  outcomes.colmap = RunColmap(set, views, folder, options);
  outcomes.ours = RunOurs(set, views, folder, options);
  if (std::filesystem::exists(folder / "report.json")) {
    const auto report = nlohmann::json::parse(ReadBytes(folder / "report.json"));
    outcomes.reason = report.value("reason", "");
  } else {
    outcomes.reason = ReadBytes(folder / "ours.log").substr(0, 300);
  }
  outcomes.init_cpu_seconds = RunInProcess(set, seed, false).cpu_seconds;
  return outcomes;
}

std::vector<BothOutcomes> RunRow(const PlanarSet& set, const EndToEndOptions& options) {
  std::vector<BothOutcomes> outcomes(options.sets_per_row);
  std::mutex mutex;
  ParallelFor(options.jobs, 0, options.sets_per_row, [&](int seed) {
    outcomes[seed] = RunSet(set, seed, options);
    const BothOutcomes& done = outcomes[seed];
    if (done.ours.Right() && done.ours.run.exit_code == 0) return;
    const std::lock_guard<std::mutex> lock(mutex);
    std::fprintf(stderr, "%s --seed %d: exit %d, %zu registered, %s %s\n", set.Name().c_str(), seed,
                 done.ours.run.exit_code, done.ours.verdict.num_registered,
                 done.ours.Right()   ? "right"
                 : done.ours.Wrong() ? "WRONG"
                                     : "incomplete",
                 done.reason.c_str());
  });
  return outcomes;
}

double MedianOfKnown(std::vector<double> values) {
  values.erase(std::remove_if(values.begin(), values.end(), [](double v) { return std::isnan(v); }),
               values.end());
  return Median(&values, std::nan(""));
}

// Sums and medians of one program over the sets of a row.
struct RowNumbers {
  int right = 0, wrong = 0, registered = 0, photos = 0;
  int exit_done = 0, exit_untrusted = 0, exit_other = 0;
  int done_and_wrong = 0, done_and_incomplete = 0, untrusted_but_right = 0;
  double cpu_seconds = 0;
  double centre_error = 0, rotation_error_deg = 0, worst_centre_error = 0;  // medians over sets
  double reprojection_error_px = 0;                                         // median over sets

  RowNumbers(const std::vector<BothOutcomes>& outcomes, MapperOutcome BothOutcomes::*which,
             int photos_per_set) {
    std::vector<double> centre, rotation, reprojection;
    for (const BothOutcomes& both : outcomes) {
      const MapperOutcome& outcome = both.*which;
      right += outcome.Right() ? 1 : 0;
      wrong += outcome.Wrong() ? 1 : 0;
      registered += static_cast<int>(outcome.verdict.num_registered);
      photos += photos_per_set;
      cpu_seconds += outcome.run.cpu_seconds;
      const bool done = outcome.run.exit_code == kExitDone;
      const bool untrusted = outcome.run.exit_code == kExitUntrusted;
      exit_done += done ? 1 : 0;
      exit_untrusted += untrusted ? 1 : 0;
      exit_other += !done && !untrusted ? 1 : 0;
      done_and_wrong += done && outcome.Wrong() ? 1 : 0;
      done_and_incomplete += done && !outcome.Wrong() && !outcome.Right() ? 1 : 0;
      untrusted_but_right += untrusted && outcome.Right() ? 1 : 0;
      centre.push_back(outcome.verdict.MedianCentreError());
      rotation.push_back(outcome.verdict.MedianRotationErrorDeg());
      if (outcome.verdict.num_registered > 1) {
        reprojection.push_back(outcome.verdict.mean_reprojection_error_px);
        worst_centre_error = std::max(worst_centre_error, outcome.verdict.centre_errors.back());
      }
    }
    centre_error = MedianOfKnown(centre);
    rotation_error_deg = MedianOfKnown(rotation);
    reprojection_error_px = MedianOfKnown(reprojection);
  }
};

double InitShare(const std::vector<BothOutcomes>& outcomes, const RowNumbers& program) {
  double init = 0;
  for (const BothOutcomes& both : outcomes) init += both.init_cpu_seconds;
  return program.cpu_seconds > 0 ? init / program.cpu_seconds : 0;
}

void PrintMapperRow(const PlanarSet& set, const std::vector<BothOutcomes>& outcomes,
                    std::FILE* out) {
  const int n = static_cast<int>(outcomes.size());
  const RowNumbers colmap(outcomes, &BothOutcomes::colmap, set.num_views);
  const RowNumbers ours(outcomes, &BothOutcomes::ours, set.num_views);
  std::fprintf(out,
               "| %s | %s | %s | %d / %d of %d | %d | %d | %d | %d (%d) | %.1f / %.1f | %.2f / "
               "%.2f | %.3f / %.3f | %.2f / %.2f | %.1f %% / %.1f %% |\n",
               set.Name().c_str(), ShareText(colmap.right, n).c_str(),
               ShareText(ours.right, n).c_str(), colmap.registered, ours.registered, ours.photos,
               colmap.wrong, ours.done_and_wrong, ours.done_and_incomplete, ours.exit_untrusted,
               ours.untrusted_but_right, 100 * colmap.centre_error, 100 * ours.centre_error,
               colmap.rotation_error_deg, ours.rotation_error_deg, colmap.reprojection_error_px,
               ours.reprojection_error_px, colmap.cpu_seconds / n, ours.cpu_seconds / n,
               100 * InitShare(outcomes, ours), 100 * InitShare(outcomes, colmap));
}

constexpr char kMapperHeader[] =
    "| set | COLMAP right | roomtex right | registered, COLMAP / roomtex | COLMAP wrong (all exit "
    "0) | roomtex exit 0 and wrong | exit 0, photos missing | exit 4 (of these right) | median "
    "centre error, cm | median rotation error, deg | mean reprojection error, px | CPU s per set "
    "| initialiser's share of roomtex-mapper's / of COLMAP's CPU |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|---|---|\n";

constexpr char kSequenceHeader[] =
    "| set | registered of 8, COLMAP | roomtex | all 8 and right, COLMAP | roomtex | exit 0 and "
    "wrong | exit 4 | median centre error, cm, COLMAP / roomtex | worst | CPU s per set |\n"
    "|---|---|---|---|---|---|---|---|---|---|\n";

void PrintSequenceRow(const PlanarSet& set, const std::vector<BothOutcomes>& outcomes,
                      std::FILE* out) {
  const int n = static_cast<int>(outcomes.size());
  const RowNumbers colmap(outcomes, &BothOutcomes::colmap, set.num_views);
  const RowNumbers ours(outcomes, &BothOutcomes::ours, set.num_views);
  std::fprintf(out,
               "| %s | %.2f | %.2f | %d of %d | %s | %d | %d | %.1f / %.1f | %.1f / %.1f | %.2f / "
               "%.2f |\n",
               set.Name().c_str(), 1.0 * colmap.registered / n, 1.0 * ours.registered / n,
               colmap.right, n, ShareText(ours.right, n).c_str(), ours.done_and_wrong,
               ours.exit_untrusted, 100 * colmap.centre_error, 100 * ours.centre_error,
               100 * colmap.worst_centre_error, 100 * ours.worst_centre_error,
               colmap.cpu_seconds / n, ours.cpu_seconds / n);
}

constexpr char kAdversarialHeader[] =
    "| set | sets | COLMAP wrong (exit 0) | roomtex exit 0 and wrong | exit 0 and right | exit 0, "
    "photos missing | exit 4 | of these wrong | exit 3 or other |\n"
    "|---|---|---|---|---|---|---|---|---|\n";

void PrintAdversarialRow(const PlanarSet& set, const std::vector<BothOutcomes>& outcomes,
                         std::FILE* out) {
  const int n = static_cast<int>(outcomes.size());
  const RowNumbers colmap(outcomes, &BothOutcomes::colmap, set.num_views);
  const RowNumbers ours(outcomes, &BothOutcomes::ours, set.num_views);
  std::fprintf(out, "| %s | %d | %d | %d | %d | %d | %d | %d | %d |\n", set.Name().c_str(), n,
               colmap.wrong, ours.done_and_wrong,
               ours.exit_done - ours.done_and_wrong - ours.done_and_incomplete,
               ours.done_and_incomplete, ours.exit_untrusted, ours.wrong - ours.done_and_wrong,
               ours.exit_other);
}

}  // namespace

void PrintEndToEndTable(const std::string& table, const EndToEndOptions& options, std::FILE* out) {
  const bool sequences = table == "sequences", adversarial = table == "adversarial";
  std::fprintf(out, "\n%d sets per row\n\n%s", options.sets_per_row,
               sequences     ? kSequenceHeader
               : adversarial ? kAdversarialHeader
                             : kMapperHeader);
  for (const PlanarSet& set : sequences     ? SequenceRows()
                              : adversarial ? AdversarialRows()
                                            : MapperRows()) {
    if (set.Name().find(options.rows) == std::string::npos) continue;
    const std::vector<BothOutcomes> outcomes = RunRow(set, options);
    if (sequences) {
      PrintSequenceRow(set, outcomes, out);
    } else if (adversarial) {
      PrintAdversarialRow(set, outcomes, out);
    } else {
      PrintMapperRow(set, outcomes, out);
    }
    std::fflush(out);
  }
}

void ShowPrograms(const PlanarSet& set, int seed, const EndToEndOptions& options, std::FILE* out) {
  const BothOutcomes both = RunSet(set, seed, options);
  for (const MapperOutcome* outcome : {&both.colmap, &both.ours}) {
    const ModelVerdict& verdict = outcome->verdict;
    std::fprintf(out, "%s: exit %d, %zu registered, %s\n",
                 outcome == &both.ours ? "roomtex-mapper" : "colmap mapper", outcome->run.exit_code,
                 verdict.num_registered,
                 outcome->Right()   ? "right"
                 : outcome->Wrong() ? "WRONG"
                                    : "incomplete");
    if (verdict.num_registered < 2) continue;
    std::fprintf(out,
                 "  centres %.3f m median, %.3f worst; rotations %.2f deg median, %.2f worst; "
                 "points %.3f m median; %.3f px\n",
                 verdict.MedianCentreError(), verdict.centre_errors.back(),
                 verdict.MedianRotationErrorDeg(), verdict.rotation_errors_deg.back(),
                 verdict.median_point_error, verdict.mean_reprojection_error_px);
  }
  std::fprintf(out, "%s\n", both.reason.c_str());
}

}  // namespace roomtex
