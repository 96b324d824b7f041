#include "align/automatic_alignment.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "align/start_appearance.h"
#include "align/start_photos.h"
#include "align/start_placed_photos.h"
#include "core/text.h"

namespace roomtex {
namespace {

// Metres, one standard deviation: how far off the surface a start may be that was fitted to it.
constexpr double kStartSigma = 0.03;

constexpr int kStartsPerScale = 3;  // of the second look

// A hint that contradicts what was found. "" = none does.
std::string ContradictingHint(const AlignmentInput& input, const Alignment& alignment,
                              const TrustOptions& trust) {
  for (size_t i = 0; i < input.picks.size(); ++i) {
    const Pick& pick = input.picks[i];
    const SparseImage& image = *input.model.FindImage(pick.image_name);
    const double limit = 2 * trust.PickRmsLimit(input.model.cameras.at(image.camera_id));
    const double off_px = alignment.refined_pick_px[i];
    if (!(pick.weight > 0) || off_px < limit) continue;
    const std::string where = std::isfinite(off_px) ? Number(off_px, 0) + " pixels away from where"
                                                    : "out of the photo's sight where";
    return "The pick on " + LineOf(pick) + " (" + pick.image_name + ") is " + where +
           " the alignment puts it, that was found with it as a hint. Correct or remove it, or add "
           "others.";
  }
  return "";
}

// What leaves the photos' corners as exact as they are: half a step between the scan's samples is
// not known of any, and neighbouring ones are off together.
constexpr size_t kMostCorners = 200, kFewCorners = 30;

// On the surface; where that does not hold the model, by what the photos show of the scan's
// intensity as well, if they confirm the start.
Alignment AlignFromStart(const AlignmentInput& input, const AutomaticAlignment& found,
                         const AlignmentOptions& options, Progress* progress) {
  const FittedStart& start = found.search.starts[found.verdict.best];
  const Similarity& best = start.scan_from_sparse;
  Alignment alignment = AlignToScan(
      input, StartFromSimilarity(input.model, input.picks, best, kStartSigma), options, progress);
  std::vector<Pick> corners;
  const bool is_confirmed = found.verdict.support != PhotoSupport::kNone || start.looks_alike;
  if (is_confirmed && start.photos) {
    corners = PicksOf(start.photos->shifts.corners, input.model, best, kMostCorners);
  }
  // Features are less exact.
  if (start.looks_alike && corners.size() < kFewCorners) {
    corners = found.search.alike_picks;
  }
  if (corners.empty()) return alignment;
  const double sigma_px = CornerSigma(corners, input.model, best);
  if (!NeedsCorners(alignment, corners, sigma_px, input.model)) return alignment;
  // As picks that are as exact as they turn out to be.
  std::vector<Pick> picks = input.picks;
  for (Pick& corner : corners) {
    corner.weight = alignment.start.pick_sigma_px / sigma_px;
    picks.push_back(std::move(corner));
  }
  AlignmentStart again = StartFromSimilarity(input.model, picks, best, kStartSigma);
  again.num_corners = static_cast<int>(corners.size());
  return AlignToScan(input.With(input.model, input.surveyed, picks), again, options, progress);
}

bool IsWorthALook(StartVerdict::Kind kind) {
  return kind == StartVerdict::Kind::kTrusted || kind == StartVerdict::Kind::kUnconfirmed ||
         kind == StartVerdict::Kind::kAmbiguous || kind == StartVerdict::Kind::kByPhotos;
}

}  // namespace

bool NeedsCorners(const Alignment& alignment, const std::vector<Pick>& corners, double sigma_px,
                  const SparseModel& model) {
  constexpr double kDrawnAway = 2;  // times what the corners were off
  // Metres at the photos, one standard deviation, and times what model and scan disagree by.
  constexpr double kHeldByOnePart = 0.02, kBeyondDisagreement = 3;
  const AlignmentFit& fit = alignment.fit;
  if (!fit.surface.converged || !alignment.open.None() || !fit.surface.covariance.allFinite()) {
    return true;
  }
  if (alignment.expected_error.at_cameras >
      std::max(kHeldByOnePart, kBeyondDisagreement * alignment.disagreement.rms)) {
    return true;
  }
  const SparseModel& as_aligned = alignment.rolling_shutter ? alignment.rolling_shutter->model
                                  : alignment.lenses.mended ? *alignment.lenses.mended
                                                            : model;
  return CornerSigma(corners, as_aligned, alignment.scan_from_sparse) > kDrawnAway * sigma_px;
}

bool AreHints(const std::vector<Pick>& picks) {
  return std::count_if(picks.begin(), picks.end(),
                       [](const Pick& pick) { return pick.weight > 0; }) < kMinPicksPerPhoto;
}

AutomaticAlignment AlignAutomatically(const AlignmentInput& input,
                                      const std::vector<NearHint>& near,
                                      const AlignmentOptions& options, Progress* progress) {
  AutomaticAlignment found;
  const bool has_picks = std::any_of(input.picks.begin(), input.picks.end(),
                                     [](const Pick& pick) { return pick.weight > 0; });
  const bool hinted = has_picks || !near.empty();
  StartSearchOptions search;
  search.num_threads = input.num_threads;
  const auto judge = [&] {
    AskPhotosOfStarts(input, options, StartPhotosOptions(), &found.search);
    found.verdict = JudgeStarts(input, found.search, hinted, StartVerdictOptions());
  };
  const auto look = [&] {
    progress->Stage("search");
    StartSearch next = SearchStarts(input, near, options, search);
    next.appearance.swap(found.search.appearance);  // are known from a first look
    next.placed_photos.swap(found.search.placed_photos);
    found.search = std::move(next);
    progress->Stage("search verdict");
    judge();
    // What geometry and corners decide was counted by itself; features are asked about the rest.
    if (found.verdict.kind == StartVerdict::Kind::kTrusted) return;
    progress->Stage("search by appearance");
    AskAppearance(input, options, StartAppearanceOptions(), &found.search);
    judge();
    if (found.verdict.kind == StartVerdict::Kind::kTrusted) return;
    AskPhotosAlone(input, options, PlacedPhotoOptions(), progress, &found.search);
    judge();
  };
  look();
  if (found.verdict.kind == StartVerdict::Kind::kNone ||
      found.verdict.kind == StartVerdict::Kind::kWeak ||
      found.verdict.kind == StartVerdict::Kind::kOpen) {
    // A model of the whole room fits a scan of a part of it best when it is small enough to lie in
    // that part: so many are in the way that what is best for each scale has to be asked for.
    search.geometry.num_kept_per_scale = kStartsPerScale;
    look();
  }
  if (!IsWorthALook(found.verdict.kind)) {
    found.attempt.refusal = found.verdict.reason;
    found.attempt.says_mirrored = found.verdict.kind == StartVerdict::Kind::kMirrored;
    return found;
  }
  Alignment alignment = AlignFromStart(input, found, options, progress);
  for (const std::string& reason :
       {found.verdict.reason, ContradictingHint(input, alignment, options.trust)}) {
    if (!reason.empty()) alignment.reasons.insert(alignment.reasons.begin(), reason);
  }
  if (!alignment.open.None() && !found.verdict.reason.empty()) {
    alignment.reasons.push_back(alignment.open.Sentence(
        has_picks ? OpenDirections::HeldBy::kPicks : OpenDirections::HeldBy::kNothing));
  }
  found.attempt.alignment = std::move(alignment);
  return found;
}

}  // namespace roomtex
