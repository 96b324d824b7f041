#include "tests/benchmark/planar/in_process_table.h"

#include <ctime>

#include "colmap_ext/initializer.h"
#include "core/parallel.h"
#include "tests/benchmark/planar/pose_judge.h"
#include "tests/benchmark/planar/thesis_rule.h"
#include "tests/benchmark/planar/wilson_interval.h"

namespace roomtex {
namespace {

using Matches = PlanarSet::Matches;

double ThreadCpuSeconds() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

const DatabasePair& FindPair(const MatchedImages& images, const PairTrial& trial) {
  for (const DatabasePair& pair : images.pairs()) {
    if (pair.image_id1 == trial.image_id1 && pair.image_id2 == trial.image_id2) return pair;
  }
  throw std::runtime_error("the seed's pair is none of the database");
}

Rigid SeedMotion(const Seed& seed) {
  return seed.pair_model.images.at(seed.trial.image_id2).cam_from_model *
         seed.pair_model.images.at(seed.trial.image_id1).cam_from_model.Inverse();
}

void JudgeSeed(const SimulatedViews& views, double noise_px, MatchedImages* images,
               const Seed& seed, SetOutcome* outcome) {
  const PairVerdict verdict = JudgePair(views, noise_px, images, FindPair(*images, seed.trial),
                                        SeedMotion(seed), InitOptions().max_third_views);
  outcome->identifiable = verdict.Identifiable();
  outcome->strictly_right = verdict.StrictlyRight();
  outcome->confidence = seed.trial.decision.confidence;
  outcome->rotation_deg = verdict.from_truth.rotation_deg;
  outcome->baseline_deg = verdict.from_truth.baseline_deg;
  if (seed.ambiguous) {
    outcome->ours = verdict.Right() ? SeedOutcome::kAmbiguousRight : SeedOutcome::kAmbiguousWrong;
  } else {
    outcome->ours = verdict.Right() ? SeedOutcome::kRight : SeedOutcome::kWrong;
  }
}

bool IsRight(const SimulatedViews& views, double noise_px, MatchedImages* images,
             const std::optional<ChosenPair>& chosen) {
  return chosen &&
         JudgePair(views, noise_px, images, *chosen->pair, chosen->solution.right_from_left, 0)
             .Right();
}

const char* OutcomeText(SeedOutcome outcome) {
  switch (outcome) {
    case SeedOutcome::kRight:
      return "right";
    case SeedOutcome::kWrong:
      return "WRONG, trusted";
    case SeedOutcome::kAmbiguousRight:
      return "ambiguous (right)";
    case SeedOutcome::kAmbiguousWrong:
      return "ambiguous (wrong)";
    case SeedOutcome::kNone:
      return "no seed";
  }
  return "";
}

void PrintHeader(const char* first, std::FILE* out) {
  std::fprintf(
      out,
      "\n| %s | sets | thesis' rule | lower two-view cost | roomtex right | wrong, trusted "
      "| said ambiguous | no seed | identifiable | right where identifiable | within 3 and 5 deg "
      "of the truth, trusted "
      "| beyond, trusted | CPU ms |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|\n",
      first);
}

void PrintRow(const std::string& name, const OutcomeCounts& counts, std::FILE* out) {
  std::fprintf(out, "| %s | %d | %s | %s | %s | %d | %d | %d | %d | %s | %s | %d | %.0f |\n",
               name.c_str(), counts.num_sets, ShareText(counts.thesis, counts.num_rivals).c_str(),
               ShareText(counts.lower_cost, counts.num_rivals).c_str(),
               ShareText(counts.right, counts.num_sets).c_str(), counts.wrong, counts.ambiguous,
               counts.no_seed, counts.identifiable,
               ShareText(counts.identifiable_right, counts.identifiable).c_str(),
               ShareText(counts.strictly_right, counts.num_sets).c_str(), counts.strictly_wrong,
               1000 * counts.cpu_seconds / std::max(1, counts.num_sets));
  std::fflush(out);
}

// The sets of all rows once more, by one property of their cells.
void PrintMargins(const std::map<std::string, OutcomeCounts>& by_property, std::FILE* out) {
  PrintHeader("all rows, by", out);
  for (const auto& [name, counts] : by_property) PrintRow(name, counts, out);
}

void PrintFailures(const std::vector<SetOutcome>& outcomes, std::FILE* out) {
  std::fprintf(out, "\nSets that are not right and trusted:\n\n");
  for (const SetOutcome& outcome : outcomes) {
    if (outcome.ours == SeedOutcome::kRight) continue;
    std::fprintf(out, "- %s --seed %d: %s, confidence %.3g, %.1f and %.1f deg off%s\n",
                 outcome.set.c_str(), outcome.seed, OutcomeText(outcome.ours), outcome.confidence,
                 outcome.rotation_deg, outcome.baseline_deg,
                 outcome.identifiable ? "" : ", not identifiable");
  }
}

}  // namespace

SetOutcome RunInProcess(const PlanarSet& set, int seed, bool rivals) {
  SetOutcome outcome;
  outcome.set = set.Name();
  outcome.seed = seed;
  const SimulatedViews views = MakeSet(set, seed);
  MatchedImages images = views.Matched();
  const double start = ThreadCpuSeconds();
  MatchedImages fresh = views.Matched();  // unprojects anew, as roomtex-mapper must
  const std::optional<Seed> found = Initializer(&fresh, InitOptions(), 1, 0).Next();
  outcome.cpu_seconds = ThreadCpuSeconds() - start;
  if (found) JudgeSeed(views, set.noise_px, &images, *found, &outcome);
  outcome.with_rivals = rivals;
  if (!rivals) return outcome;
  outcome.thesis_right =
      IsRight(views, set.noise_px, &images, StartByThesisRule(&images, HypothesisOptions()));
  outcome.lower_cost_right =
      IsRight(views, set.noise_px, &images, StartByLowerCost(&images, HypothesisOptions()));
  return outcome;
}

void OutcomeCounts::Add(const SetOutcome& outcome) {
  ++num_sets;
  num_rivals += outcome.with_rivals ? 1 : 0;
  thesis += outcome.thesis_right ? 1 : 0;
  lower_cost += outcome.lower_cost_right ? 1 : 0;
  right += outcome.ours == SeedOutcome::kRight ? 1 : 0;
  const bool trusted = outcome.ours == SeedOutcome::kRight || outcome.ours == SeedOutcome::kWrong;
  strictly_right += trusted && outcome.strictly_right ? 1 : 0;
  strictly_wrong += trusted && !outcome.strictly_right ? 1 : 0;
  wrong += outcome.ours == SeedOutcome::kWrong ? 1 : 0;
  ambiguous +=
      outcome.ours == SeedOutcome::kAmbiguousRight || outcome.ours == SeedOutcome::kAmbiguousWrong
          ? 1
          : 0;
  no_seed += outcome.ours == SeedOutcome::kNone ? 1 : 0;
  identifiable += outcome.identifiable ? 1 : 0;
  identifiable_right += outcome.identifiable && outcome.ours == SeedOutcome::kRight ? 1 : 0;
  cpu_seconds += outcome.cpu_seconds;
}

std::vector<SetOutcome> PrintInProcessTable(const InProcessOptions& options, std::FILE* out) {
  std::vector<SetOutcome> all;
  std::map<std::string, OutcomeCounts> by_property;
  PrintHeader("set", out);
  for (const GridRow& row : GridRows()) {
    if (row.name.find(options.rows) == std::string::npos) continue;
    const int num_sets = static_cast<int>(row.cells.size()) * options.sets_per_cell;
    std::vector<SetOutcome> outcomes(num_sets);
    ParallelFor(options.jobs, 0, num_sets, [&](int i) {
      outcomes[i] = RunInProcess(row.cells[i / options.sets_per_cell], i % options.sets_per_cell,
                                 i % options.sets_per_cell < options.rival_sets_per_cell);
    });
    OutcomeCounts counts;
    for (int i = 0; i < num_sets; ++i) {
      const PlanarSet& cell = row.cells[i / options.sets_per_cell];
      counts.Add(outcomes[i]);
      char text[40];
      std::snprintf(text, sizeof(text), "%g %% outliers", 100 * cell.outlier_share);
      by_property[text].Add(outcomes[i]);
      by_property[std::to_string(cell.num_views) + " views"].Add(outcomes[i]);
      by_property[cell.matches == Matches::kFew ? "few matches" : "many matches"].Add(outcomes[i]);
    }
    PrintRow(row.name, counts, out);
    all.insert(all.end(), outcomes.begin(), outcomes.end());
  }
  PrintMargins(by_property, out);
  PrintFailures(all, out);
  return all;
}

void ShowSet(const PlanarSet& set, int seed, std::FILE* out) {
  const SimulatedViews views = MakeSet(set, seed);
  MatchedImages images = views.Matched();
  std::fprintf(out, "%s --seed %d\n", set.Name().c_str(), seed);
  for (const DatabasePair& pair : images.pairs()) {
    int num_right = 0;
    for (const Eigen::Vector2i& match : pair.matches) {
      num_right += views.point_of_keypoint.at(pair.image_id1)[match.x()] ==
                           views.point_of_keypoint.at(pair.image_id2)[match.y()]
                       ? 1
                       : 0;
    }
    std::fprintf(out, "pair %u %u: %zu matches, %d right\n", pair.image_id1, pair.image_id2,
                 pair.matches.size(), num_right);
  }
  Initializer initializer(&images, InitOptions(), 1, 0);
  const std::optional<Seed> found = initializer.Next();
  for (const PairTrial& trial : initializer.Rejected()) {
    std::fprintf(out, "rejected %u %u: %s\n", trial.image_id1, trial.image_id2,
                 trial.problem.c_str());
  }
  if (!found) return;
  const PairTrial& trial = found->trial;
  const DatabasePair& pair = FindPair(images, trial);
  SetOutcome outcome;
  JudgeSeed(views, set.noise_px, &images, *found, &outcome);
  const MotionUncertainty uncertainty = JudgePair(views, set.noise_px, &images, pair,
                                                  SeedMotion(*found), InitOptions().max_third_views)
                                            .uncertainty;
  std::fprintf(out, "noise alone: %.2f and %.2f deg (one standard deviation)\n",
               uncertainty.rotation_deg, uncertainty.baseline_deg);
  std::fprintf(out, "seed %u %u: %s, confidence %.3g, %d third views%s\n", trial.image_id1,
               trial.image_id2, OutcomeText(outcome.ours), trial.decision.confidence,
               trial.decision.num_views, outcome.identifiable ? "" : ", not identifiable");
  const auto print = [&](const char* what, const Rigid& motion, double cost) {
    const PairVerdict verdict =
        JudgePair(views, set.noise_px, &images, pair, motion, InitOptions().max_third_views);
    std::fprintf(out,
                 "  %s: cost %.1f; %.2f and %.2f deg from the truth, %.2f and %.2f from the "
                 "optimum\n",
                 what, cost, verdict.from_truth.rotation_deg, verdict.from_truth.baseline_deg,
                 verdict.from_optimum.rotation_deg, verdict.from_optimum.baseline_deg);
  };
  for (const TwoViewHypothesis& hypothesis : trial.analysis.hypotheses) {
    print(("two views, " + hypothesis.origin).c_str(), hypothesis.right_from_left, hypothesis.cost);
  }
  for (const HypothesisVerdict& verdict : trial.decision.verdicts) {
    print("with third views", verdict.right_from_left, verdict.cost);
  }
  // What the third-view test makes of the truth: a lower cost means that the search fell short.
  const std::vector<RayMatch> matches = images.Matches(pair);
  ThirdViewOptions third;
  Rigid truth = views.TrueRelativePose(pair.image_id1, pair.image_id2);
  truth.translation.normalize();
  const ThirdViewDecision of_truth = DecideByThirdViews(
      matches, {EvaluatePose(truth, matches, third.pair)},
      images.FindThirdViews(pair, matches, third.min_sightings, InitOptions().max_third_views),
      third);
  print("with third views, from the truth", of_truth.verdicts[0].right_from_left,
        of_truth.verdicts[0].cost);
  print("seed", SeedMotion(*found), 0);
}

}  // namespace roomtex
