#include "colmap_ext/seed_trials.h"

#include <optional>
#include <string>
#include <utility>

#include "colmap_ext/mapping_report.h"
#include "core/child_program.h"

namespace roomtex {
namespace {

bool Better(const MapperResult& a, const MapperResult& b) {
  if (a.model.images.size() != b.model.images.size()) {
    return a.model.images.size() > b.model.images.size();
  }
  return a.model.points.size() > b.model.points.size();
}

// Registers what the mapper left out.
void ChainLeftOut(const Database& database, const MatchedImages& images, MapperRun* mapper,
                  const MappingOptions& options, const Command::Context& context,
                  MappingOutcome* outcome) {
  MatchedImages model_images = ImagesOfModel(database, images, outcome->result.model);
  context.progress.Stage("chain photos");
  ViewChainer chainer(&model_images, options.chain, HypothesisOptionsOf(options, context),
                      context.options.num_threads);
  ChainResult chain = chainer.Run(std::move(outcome->result), [&](const SparseModel& poses) {
    ThrowIfInterrupted();
    return mapper->Adjust(poses);
  });
  outcome->result = std::move(chain.result);
  outcome->chained = std::move(chain.chained);
  outcome->reasons = std::move(chain.reasons);
}

std::string OutcomeSentence(const MapperResult& result) {
  if (!result.problem.empty()) return result.problem;
  return std::to_string(result.model.images.size()) + " photos registered" +
         (result.grew ? "" : ", all of them of the seed");
}

}  // namespace

std::vector<MappingOutcome> TrySeeds(const Database& database, MatchedImages* images,
                                     MapperRun* mapper, const MappingOptions& options,
                                     const InitOptions& init, const Command::Context& context,
                                     Json* trials) {
  const int num_images = static_cast<int>(images->images().size());
  std::vector<MappingOutcome> best;  // at most one
  Initializer initializer(images, init, context.options.num_threads,
                          static_cast<uint64_t>(context.options.random_seed));
  for (int tried = 0; tried < init.max_pairs; ++tried) {
    if (tried > 0) context.progress.Stage("initialise");
    std::optional<Seed> seed = initializer.Next();
    ThrowIfInterrupted();
    if (!seed) break;
    context.progress.Note("pair " + images->images().at(seed->trial.image_id1).name + ", " +
                          images->images().at(seed->trial.image_id2).name + ": " +
                          std::to_string(seed->pair_model.points.size()) + " points, " +
                          std::to_string(seed->poses.images.size() - 2) + " third views agree");
    context.progress.Stage("colmap mapper", num_images);
    MappingOutcome outcome;
    outcome.result = mapper->Run(*seed, num_images, [&] { context.progress.Tick(); });
    outcome.seed = std::move(*seed);
    const int num_mapped = static_cast<int>(outcome.result.model.images.size());
    if (options.chain.enabled && !outcome.result.folder.empty() && num_mapped < num_images) {
      ChainLeftOut(database, *images, mapper, options, context, &outcome);
    }
    trials->push_back(TrialJson(outcome.seed.trial, *images, OutcomeSentence(outcome.result)));
    if (!outcome.result.problem.empty()) {
      context.Warn("starting from " + images->images().at(outcome.seed.trial.image_id1).name +
                   " and " + images->images().at(outcome.seed.trial.image_id2).name + ": " +
                   outcome.result.problem);
    }
    if (outcome.result.folder.empty()) continue;
    const bool enough = 2 * outcome.result.model.images.size() >= images->images().size();
    if (best.empty() || Better(outcome.result, best[0].result)) {
      best.clear();
      best.push_back(std::move(outcome));
    }
    if (enough) break;
  }
  for (const PairTrial& trial : initializer.Rejected()) {
    trials->push_back(TrialJson(trial, *images, trial.problem));
  }
  return best;
}

}  // namespace roomtex
