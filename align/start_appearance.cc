#include "align/start_appearance.h"

#include <algorithm>
#include <iterator>
#include <optional>
#include <utility>

#include "align/start_photos.h"
#include "align/trust/appearance_matches.h"

namespace roomtex {
namespace {

constexpr size_t kMostUps = 3;
constexpr size_t kMostPicks = 400;
constexpr double kSurfaceGate = 0.15;  // metres; features are matched to some centimetres

// The matches that agree with a place, evenly taken.
std::vector<Pick> AgreeingPicks(const std::vector<AppearanceMatch>& matches,
                                const Similarity& scan_from_sparse, const SparseModel& model) {
  std::vector<Pick> picks;
  for (const AppearanceMatch& one : matches) {
    const double off = (scan_from_sparse * one.x_in_sparse - one.x_in_scan).norm();
    if (off > AppearanceSearchOptions().tolerance) continue;
    picks.push_back({model.images.at(one.image_id).name, one.x_in_img, one.x_in_scan});
  }
  const size_t stride = 1 + picks.size() / kMostPicks;
  std::vector<Pick> some;
  for (size_t i = 0; i < picks.size(); i += stride) some.push_back(picks[i]);
  return some;
}

// With all directions that may be up; where the photos do not say it, also without any.
AppearanceEvidence LookForPlaces(const AlignmentInput& input, const StartSearch& search) {
  std::vector<std::optional<Eigen::Vector3d>> ups(search.ups_in_sparse.begin(),
                                                  search.ups_in_sparse.end());
  if (search.up_known) {
    ups.resize(1);
  } else {
    if (ups.size() > kMostUps) ups.resize(kMostUps);
    ups.push_back(std::nullopt);
  }
  const AppearanceMatcher matcher(input.model, input.image_path, input.surveyed.viewer(),
                                  AppearanceOptions(), input.num_threads);
  AppearanceEvidence best;
  std::vector<AppearancePlace> all;
  int most_cells = 0;
  for (const Eigen::Vector3d& up_in_scan : search.ups_in_scan) {
    for (const std::optional<Eigen::Vector3d>& up_in_sparse : ups) {
      const std::vector<AppearanceMatch> matches = matcher.Match(up_in_sparse, up_in_scan);
      std::vector<AppearancePlace> places = SearchByAppearance(
          matches, up_in_sparse, up_in_scan, AppearanceSearchOptions(), input.num_threads);
      if (places.empty()) continue;
      if (places[0].num_cells > most_cells) {
        most_cells = places[0].num_cells;
        best.agreeing = AgreeingPicks(matches, places[0].scan_from_sparse, input.model);
        best.spread = FindCellSpread(best.agreeing);
      }
      std::move(places.begin(), places.end(), std::back_inserter(all));
    }
  }
  // The same place comes again with another direction up; a rival may come with another only.
  std::stable_sort(all.begin(), all.end(), [](const AppearancePlace& a, const AppearancePlace& b) {
    return a.num_cells > b.num_cells;
  });
  for (AppearancePlace& place : all) {
    const bool is_new =
        std::all_of(best.places.begin(), best.places.end(), [&](const AppearancePlace& other) {
          return DistanceBetween(search.cloud, place.scan_from_sparse, other.scan_from_sparse) >=
                 kSameStart;
        });
    if (is_new) best.places.push_back(std::move(place));
  }
  return best;
}

}  // namespace

bool StandsOut(const std::vector<AppearancePlace>& places, const StartAppearanceOptions& options) {
  if (places.empty() || places[0].num_cells < options.min_cells) return false;
  return places.size() < 2 || places[0].num_cells >= options.min_ratio * places[1].num_cells;
}

void AddStartThatLooksAlike(const AlignmentInput& input, const AlignmentOptions& options,
                            const Similarity& place, const std::vector<Pick>& agreeing,
                            StartSearch* search) {
  SimilarityFitOptions fit_options = options.fit;
  fit_options.max_scale_change = kMaxStartScaleChange;
  FittedStart start;
  start.scan_from_sparse = place;
  FitStart(input, search->cloud, agreeing, CornerSigma(agreeing, input.model, place), kSurfaceGate,
           fit_options, &start);
  if (DistanceBetween(search->cloud, place, start.scan_from_sparse) > kSameStart) {
    return;  // the surface is elsewhere
  }
  if (!Agrees(search->hints, start.scan_from_sparse, kHintSlack)) return;
  start.looks_alike = true;
  search->alike_picks = agreeing;
  // A start that is there already stays, unless it came to rest less well.
  const auto same =
      std::find_if(search->starts.begin(), search->starts.end(), [&](const FittedStart& other) {
        return DistanceBetween(search->cloud, start.scan_from_sparse, other.scan_from_sparse) <
               kSameStart;
      });
  if (same == search->starts.end()) {
    search->starts.push_back(std::move(start));
  } else if (same->settled && same->sights.Score() >= start.sights.Score()) {
    same->looks_alike = true;
  } else {
    *same = std::move(start);
  }
  const int num_starts = static_cast<int>(search->starts.size());
  search->starts = DistinctStarts(search->cloud, std::move(search->starts), num_starts);
}

void AskAppearance(const AlignmentInput& input, const AlignmentOptions& options,
                   const StartAppearanceOptions& appearance, StartSearch* search) {
  if (input.image_path.empty()) return;
  if (!search->appearance) search->appearance = LookForPlaces(input, *search);
  if (!StandsOut(search->appearance->places, appearance)) return;
  if (search->appearance->spread.num_apart < kFewestApart) return;
  AddStartThatLooksAlike(input, options, search->appearance->places[0].scan_from_sparse,
                         search->appearance->agreeing, search);
}

}  // namespace roomtex
