#include "align/start_search.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "align/alignment_fit.h"
#include "align/search/up_directions.h"
#include "align/trust/scan_cells.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr size_t kCloudPoints = 4000;  // that finalists are fitted with
constexpr size_t kFirstPoints = 700;   // that every hypothesis is fitted with
constexpr double kFirstSearchGate = 0.4, kLastSearchGate = 0.1;  // metres, of the fits
constexpr double kSightTolerance = 0.05;                         // metres
class Fitter {
 public:
  Fitter(const AlignmentInput& input, const AlignmentOptions& options,
         const StartSearchOptions& search)
      : input_(input), options_(options), search_(search) {}

  std::vector<FittedStart> FitAll(const SearchCloud& cloud,
                                  const std::vector<StartHypothesis>& hypotheses) const {
    const SearchCloud few = Thinned(cloud, kFirstPoints);
    std::vector<FittedStart> starts;
    for (const StartHypothesis& one : hypotheses) {
      starts.push_back({one.scan_from_sparse, one.score, false, 0, 0, {}, {}, false});
    }
    starts = DistinctStarts(cloud, FitEach(few, kFirstSearchGate, kMaxStartScaleChange, starts),
                            search_.num_finalists);
    return DistinctStarts(cloud,
                          FitEach(cloud, kLastSearchGate, options_.fit.max_scale_change, starts),
                          search_.num_finalists);
  }

 private:
  std::vector<FittedStart> FitEach(const SearchCloud& cloud, double gate, double max_scale_change,
                                   const std::vector<FittedStart>& starts) const {
    SimilarityFitOptions fit_options = options_.fit;
    fit_options.max_scale_change = max_scale_change;
    // Picks belong to the model as it is.
    static const std::vector<Pick> kNone;
    const std::vector<Pick>& picks = cloud.is_mirrored ? kNone : input_.picks;
    std::vector<FittedStart> fitted = starts;
    ParallelFor(search_.num_threads, 0, static_cast<int>(starts.size()), [&](int i) {
      FitStart(input_, cloud, picks, kPickSigma, gate, fit_options, &fitted[i]);
    });
    return fitted;
  }

  static constexpr double kPickSigma = 3;  // pixels; a hint may be hurried
  const AlignmentInput& input_;
  const AlignmentOptions& options_;
  const StartSearchOptions& search_;
};

}  // namespace

void FitStart(const AlignmentInput& input, const SearchCloud& cloud, const std::vector<Pick>& picks,
              double sigma_px, double gate, const SimilarityFitOptions& options,
              FittedStart* start) {
  std::vector<bool> used;
  for (const Pick& pick : picks) used.push_back(pick.weight > 0);
  const SimilarityFit fit = FitToSurface(input.model, cloud.points, input.surveyed.patches(), picks,
                                         used, sigma_px, gate, start->scan_from_sparse, options);
  start->settled = fit.converged;
  start->num_on_surface = fit.num_points;
  start->rms = fit.rms_after;
  start->sights =
      CheckSights(cloud, fit.scan_from_sparse, input.surveyed.free_space(), kSightTolerance);
  start->scan_from_sparse = fit.scan_from_sparse;
}

CellSpread FindCellSpread(const std::vector<Pick>& picks) {
  const double cell_size = AppearanceSearchOptions().cell;
  std::set<ScanCell> cells;
  for (const Pick& pick : picks) cells.insert(ScanCellOf(pick.x_in_scan, cell_size));
  std::vector<Eigen::Vector3d> places;
  for (const ScanCell& cell : cells) places.emplace_back(cell[0], cell[1], cell[2]);
  CellSpread spread;
  spread.num_cells = spread.num_apart = static_cast<int>(places.size());
  for (const Eigen::Vector3d& middle : places) {
    const auto apart = std::count_if(places.begin(), places.end(), [&](const auto& place) {
      return (place - middle).norm() * cell_size > kObjectReach;
    });
    spread.num_apart = std::min(spread.num_apart, static_cast<int>(apart));
  }
  return spread;
}

double DistanceBetween(const SearchCloud& cloud, const Similarity& a, const Similarity& b) {
  std::vector<double> distances;
  for (const SurfacePoint& point : Thinned(cloud, 200).points) {
    distances.push_back((a * point.x_in_sparse - b * point.x_in_sparse).norm());
  }
  return Median(&distances);
}

std::vector<FittedStart> DistinctStarts(const SearchCloud& cloud, std::vector<FittedStart> starts,
                                        int most) {
  std::stable_sort(starts.begin(), starts.end(), [](const auto& a, const auto& b) {
    return a.sights.Score() > b.sights.Score();
  });
  std::vector<FittedStart> kept;
  for (FittedStart& one : starts) {
    if (static_cast<int>(kept.size()) == most) break;
    const auto same = std::find_if(kept.begin(), kept.end(), [&](const FittedStart& other) {
      return DistanceBetween(cloud, one.scan_from_sparse, other.scan_from_sparse) < kSameStart;
    });
    if (same != kept.end()) {
      same->looks_alike = same->looks_alike || one.looks_alike;
    } else {
      kept.push_back(std::move(one));
    }
  }
  return kept;
}

Eigen::Vector3d PhotosMiddle(const StartSearch& search, int start) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& centre : search.cloud.centres) middle += centre;
  return search.starts[start].scan_from_sparse *
         (middle / static_cast<double>(search.cloud.centres.size()));
}

StartSearch SearchStarts(const AlignmentInput& input, const std::vector<NearHint>& near,
                         const AlignmentOptions& options, const StartSearchOptions& search) {
  StartSearch found;
  const double sigma_px = KeypointSigma(input.model);
  found.cloud = MakeSearchCloud(input.model, sigma_px, kCloudPoints);
  const SearchCloud mirror_image = Mirrored(found.cloud);
  const UpDirections ups = FindModelUps(found.cloud);
  const UpDirections scan_ups = FindScanUps(input.surveyed.scans(), input.surveyed.patches());
  found.up_known = ups.known;
  found.ups_in_sparse = ups.ups;
  found.ups_in_scan = scan_ups.ups;
  std::vector<Eigen::Vector3d> mirrored_ups;
  for (const Eigen::Vector3d& up : ups.ups) mirrored_ups.emplace_back(-up.x(), up.y(), up.z());
  found.hints = FindHintRays(input.model, input.picks, near);
  std::vector<StartHypothesis> as_is, mirrored;
  for (const Eigen::Vector3d& scan_up : scan_ups.ups) {
    const ScanVolume volume(input.surveyed.scans(), scan_up, search.geometry.volume);
    const auto add = [&](const SearchCloud& cloud, const std::vector<Eigen::Vector3d>& cloud_ups,
                         const std::vector<HintRay>& rays, std::vector<StartHypothesis>* all) {
      const auto some =
          SearchByGeometry(cloud, cloud_ups, volume, rays, search.geometry, search.num_threads);
      all->insert(all->end(), some.begin(), some.end());
    };
    add(found.cloud, ups.ups, found.hints, &as_is);
    add(mirror_image, mirrored_ups, {}, &mirrored);
  }
  found.num_hypotheses = static_cast<int>(as_is.size());
  const Fitter fitter(input, options, search);
  found.starts = fitter.FitAll(found.cloud, as_is);
  const auto contradicts = [&found](const FittedStart& start) {
    return !Agrees(found.hints, start.scan_from_sparse, kHintSlack);
  };
  found.starts.erase(std::remove_if(found.starts.begin(), found.starts.end(), contradicts),
                     found.starts.end());
  found.mirrored = fitter.FitAll(mirror_image, mirrored);
  return found;
}

}  // namespace roomtex
