#include "align/automatic_alignment.h"

#include <algorithm>
#include <utility>

#include "core/text.h"

namespace roomtex {
namespace {

// Metres, one standard deviation: how far off the surface a start may be that was fitted to it.
constexpr double kStartSigma = 0.03;

// A hint that contradicts what was found. "" = none does.
std::string ContradictingHint(const AlignmentInput& input, const Alignment& alignment,
                              const TrustOptions& trust) {
  for (size_t i = 0; i < input.picks.size(); ++i) {
    const Pick& pick = input.picks[i];
    const SparseImage& image = *input.model.FindImage(pick.image_name);
    const double limit = 2 * trust.PickRmsLimit(input.model.cameras.at(image.camera_id));
    if (!(pick.weight > 0) || alignment.refined_pick_px[i] < limit) continue;
    return "The pick on " + LineOf(pick) + " (" + pick.image_name + ") is " +
           Number(alignment.refined_pick_px[i], 0) +
           " pixels away from where the alignment puts it, that was found with it as a hint. "
           "Correct or remove it, or add others.";
  }
  return "";
}

bool IsWorthALook(StartVerdict::Kind kind) {
  return kind == StartVerdict::Kind::kTrusted || kind == StartVerdict::Kind::kUnconfirmed ||
         kind == StartVerdict::Kind::kAmbiguous || kind == StartVerdict::Kind::kByPhotos;
}

}  // namespace

bool AreHints(const std::vector<Pick>& picks) {
  return std::count_if(picks.begin(), picks.end(),
                       [](const Pick& pick) { return pick.weight > 0; }) < kMinPicksPerPhoto;
}

AutomaticAlignment AlignAutomatically(const AlignmentInput& input,
                                      const std::vector<NearHint>& near,
                                      const AlignmentOptions& options, Progress* progress) {
  AutomaticAlignment found;
  progress->Stage("search");
  StartSearchOptions search;
  search.num_threads = input.num_threads;
  found.search = SearchStarts(input, near, options, search);
  progress->Stage("search verdict");
  const bool hinted = !near.empty() || !input.picks.empty();
  found.verdict = JudgeStarts(input, found.search, hinted, StartVerdictOptions());
  if (!IsWorthALook(found.verdict.kind)) {
    found.attempt.refusal = found.verdict.reason;
    found.attempt.says_mirrored = found.verdict.kind == StartVerdict::Kind::kMirrored;
    return found;
  }
  const FittedStart& best = found.search.starts[found.verdict.best];
  Alignment alignment = AlignToScan(
      input, StartFromSimilarity(input.model, input.picks, best.scan_from_sparse, kStartSigma),
      options, progress);
  for (const std::string& reason :
       {found.verdict.reason, ContradictingHint(input, alignment, options.trust)}) {
    if (!reason.empty()) alignment.reasons.insert(alignment.reasons.begin(), reason);
  }
  if (!alignment.open.None() && !found.verdict.reason.empty()) {
    alignment.reasons.push_back(alignment.open.Sentence());
  }
  found.attempt.alignment = std::move(alignment);
  return found;
}

}  // namespace roomtex
