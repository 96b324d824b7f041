#include "align/start_appearance.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "align/search/appearance_matches.h"

namespace roomtex {
namespace {

constexpr double kPickSigma = 3;  // pixels; a hint may be hurried
constexpr size_t kMostUps = 3;
constexpr double kSurfaceGate = 0.15;  // metres; features are matched to some centimetres

// With all directions that may be up; where the photos do not say it, also without any.
std::vector<AppearancePlace> LookForPlaces(const AlignmentInput& input, const StartSearch& search) {
  std::vector<std::optional<Eigen::Vector3d>> ups(search.ups_in_sparse.begin(),
                                                  search.ups_in_sparse.end());
  if (search.up_known) {
    ups.resize(1);
  } else {
    if (ups.size() > kMostUps) ups.resize(kMostUps);
    ups.push_back(std::nullopt);
  }
  std::vector<AppearancePlace> best;
  for (const Eigen::Vector3d& up_in_scan : search.ups_in_scan) {
    for (const std::optional<Eigen::Vector3d>& up_in_sparse : ups) {
      const std::vector<AppearanceMatch> matches =
          MatchAppearance(input.model, input.image_path, input.surveyed.viewer(), up_in_sparse,
                          up_in_scan, AppearanceOptions(), input.num_threads);
      std::vector<AppearancePlace> places = SearchByAppearance(
          matches, up_in_sparse, up_in_scan, AppearanceSearchOptions(), input.num_threads);
      if (places.empty()) continue;
      if (best.empty() || places[0].num_cells > best[0].num_cells) best = std::move(places);
    }
  }
  return best;
}

}  // namespace

bool StandsOut(const std::vector<AppearancePlace>& places, const StartAppearanceOptions& options) {
  if (places.empty() || places[0].num_cells < options.min_cells) return false;
  return places.size() < 2 || places[0].num_cells >= options.min_ratio * places[1].num_cells;
}

void AskAppearance(const AlignmentInput& input, const AlignmentOptions& options,
                   const StartAppearanceOptions& appearance, StartSearch* search) {
  if (input.image_path.empty()) return;
  if (!search->appearance) search->appearance = LookForPlaces(input, *search);
  if (!StandsOut(*search->appearance, appearance)) return;
  FittedStart start;
  start.scan_from_sparse = search->appearance->front().scan_from_sparse;
  FitStart(input, search->cloud, input.picks, kPickSigma, kSurfaceGate, options.fit, &start);
  const auto is_near = [&](const Similarity& place) {
    return DistanceBetween(search->cloud, search->appearance->front().scan_from_sparse, place) <
           kSameStart;
  };
  if (!is_near(start.scan_from_sparse)) return;  // the surface is elsewhere
  start.looks_alike = true;
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

}  // namespace roomtex
