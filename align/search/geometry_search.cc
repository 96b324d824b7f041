#include "align/search/geometry_search.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include <Eigen/Geometry>

#include "align/search/translation_search.h"
#include "core/decompositions.h"
#include "core/frames.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr size_t kCorrelatedPoints = 4000;  // that are correlated
constexpr int kPlacesPerTurn = 3;           // per turn and scale
// What it costs when all cameras stand where nobody looked, or in a wall.
constexpr double kCameraCost = 0.25;
// Points farther out than this share of them do not count: they are far, few and inexact.
constexpr double kInnerShare = 0.97;
// Of a model that is larger than the scan by more, only the middle is laid over it.
constexpr double kLargestModel = 1.3;
// Starts that differ by less are one: the fit brings either to the same place.
const double kSameTurn = RadFromDeg(9.0);
constexpr double kSameScale = 0.08, kSamePlace = 0.4;  // of the logarithm; metres

// A model turned so that its up is z, about the middle of its points.
struct LevelCloud {
  Eigen::Quaterniond level_from_sparse;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  // `sparse`
  std::vector<Eigen::Vector3d> points, centres;      // relative to the middle
  double radius = 0, low = 0, high = 0;              // about z, and along it
  double extent = 0;                                 // root mean square distance from the middle
};

Eigen::Vector3d MiddleOf(const SearchCloud& cloud) {
  Eigen::Vector3d middle;
  for (int k = 0; k < 3; ++k) {
    std::vector<double> along;
    for (const SurfacePoint& point : cloud.points) along.push_back(point.x_in_sparse[k]);
    middle[k] = Median(&along);
  }
  return middle;
}

LevelCloud MakeLevel(const SearchCloud& cloud, const Eigen::Vector3d& up) {
  LevelCloud level;
  level.level_from_sparse = RotationBetween(up, Eigen::Vector3d::UnitZ());
  level.middle = MiddleOf(cloud);
  std::vector<double> radii, heights, squares;
  for (const SurfacePoint& point : cloud.points) {
    const Eigen::Vector3d x = level.level_from_sparse * (point.x_in_sparse - level.middle);
    level.points.push_back(x);
    radii.push_back(x.head<2>().norm());
    heights.push_back(x.z());
    squares.push_back(x.squaredNorm());
  }
  for (const Eigen::Vector3d& centre : cloud.centres) {
    level.centres.push_back(level.level_from_sparse * (centre - level.middle));
  }
  level.radius = Quantile(&radii, kInnerShare);
  level.low = Quantile(&heights, 0.5 - kInnerShare / 2);
  level.high = Quantile(&heights, 0.5 + kInnerShare / 2);
  std::sort(squares.begin(), squares.end());
  const auto inner = static_cast<size_t>(kInnerShare * static_cast<double>(squares.size()));
  double sum = 0;
  for (size_t i = 0; i < inner; ++i) sum += squares[i];
  level.extent = std::sqrt(sum / static_cast<double>(std::max<size_t>(inner, 1)));
  return level;
}

double CameraCost(const ScanVolume& volume, const std::vector<Eigen::Vector3d>& centres,
                  const Eigen::Vector3d& translation) {
  double bad = 0;
  for (const Eigen::Vector3d& centre : centres) {
    bad += volume.StateAt(centre + translation) != ScanVolume::State::kFree;
  }
  return kCameraCost * bad / static_cast<double>(centres.size());
}

std::vector<Eigen::Vector3d> Turned(const std::vector<Eigen::Vector3d>& points, double scale,
                                    const Eigen::Quaterniond& turn) {
  const Eigen::Matrix3d linear = scale * turn.toRotationMatrix();
  std::vector<Eigen::Vector3d> turned;
  turned.reserve(points.size());
  for (const Eigen::Vector3d& x : points) turned.emplace_back(linear * x);
  return turned;
}

class OneScale {
 public:
  OneScale(const LevelCloud& cloud, const ScanVolume& volume, double scale)
      : cloud_(cloud), volume_(volume), scale_(scale) {
    const Eigen::Vector3d room = kLargestModel * volume.cell_size() * volume.size().cast<double>();
    const double radius = std::min(scale * cloud.radius, 0.5 * std::max(room.x(), room.y()));
    const double tall = std::min(scale * (cloud.high - cloud.low), room.z());
    low_ = {-radius, -radius, 0.5 * (scale * (cloud.low + cloud.high) - tall)};
    reach_ = (Eigen::Vector3d(2 * radius, 2 * radius, tall) / volume.cell_size())
                 .array()
                 .floor()
                 .cast<int>() +
             1;
  }

  std::vector<StartHypothesis> Search(const std::vector<HintRay>& hints, double turn_step) const {
    const TranslationSearch search(volume_, reach_);
    std::vector<StartHypothesis> found;
    const int num_turns = std::max(1, static_cast<int>(std::lround(2 * kPi / turn_step)));
    for (int i = 0; i < num_turns; ++i) {
      const Eigen::Quaterniond turn(
          Eigen::AngleAxisd(2 * kPi * i / num_turns, Eigen::Vector3d::UnitZ()));
      const auto start_of = [&](const Eigen::Vector3d& translation) {
        return StartOf(turn, translation);
      };
      const auto allowed = AllowedBy(hints, start_of(Eigen::Vector3d::Zero()));
      const auto centres = Turned(cloud_.centres, scale_, turn);
      for (const auto& place :
           search.FindBest(Turned(cloud_.points, scale_, turn), low_, kPlacesPerTurn, allowed)) {
        found.push_back({start_of(place.translation),
                         place.score - CameraCost(volume_, centres, place.translation)});
      }
    }
    return found;
  }

 private:
  // Of translations in `level`, those that agree with the hints; `at_zero`: the start without one.
  std::function<bool(const Eigen::Vector3d&)> AllowedBy(const std::vector<HintRay>& hints,
                                                        const Similarity& at_zero) const {
    if (hints.empty()) return {};
    const Eigen::Matrix3d scan_from_level =
        volume_.level_from_scan().conjugate().toRotationMatrix();
    std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> rays;  // centre, direction; `scan`
    for (const HintRay& hint : hints) {
      rays.emplace_back(at_zero * hint.centre, at_zero.rotation * hint.direction);
    }
    return [=, &hints, slack = 2 * volume_.cell_size()](const Eigen::Vector3d& translation) {
      const Eigen::Vector3d moved = scan_from_level * translation;
      for (size_t k = 0; k < hints.size(); ++k) {
        if (!Agrees(hints[k], rays[k].first + moved, rays[k].second, slack)) return false;
      }
      return true;
    };
  }

  // x_in_level = scale turn level_from_sparse (x - middle) + translation
  Similarity StartOf(const Eigen::Quaterniond& turn, const Eigen::Vector3d& translation) const {
    const Eigen::Quaterniond scan_from_level = volume_.level_from_scan().conjugate();
    Similarity start;
    start.scale = scale_;
    start.rotation = (scan_from_level * turn * cloud_.level_from_sparse).normalized();
    start.translation = scan_from_level * translation - scale_ * (start.rotation * cloud_.middle);
    return start;
  }

  const LevelCloud& cloud_;
  const ScanVolume& volume_;
  double scale_;
  Eigen::Vector3d low_;
  Eigen::Vector3i reach_;
};

bool AreSame(const StartHypothesis& a, const StartHypothesis& b, const Eigen::Vector3d& middle) {
  const Similarity &s = a.scan_from_sparse, &t = b.scan_from_sparse;
  return std::abs(std::log(s.scale / t.scale)) < kSameScale &&
         RotationAngle(s.rotation, t.rotation) < kSameTurn &&
         (s * middle - t * middle).norm() < kSamePlace;
}

// Adds the `count` best of those that are not kept already.
void KeepBest(std::vector<StartHypothesis> found, int count, const Eigen::Vector3d& middle,
              std::vector<StartHypothesis>* kept) {
  std::stable_sort(found.begin(), found.end(),
                   [](const auto& a, const auto& b) { return a.score > b.score; });
  for (const StartHypothesis& one : found) {
    if (count == 0) break;
    const bool is_new = std::none_of(kept->begin(), kept->end(), [&](const StartHypothesis& other) {
      return AreSame(one, other, middle);
    });
    if (!is_new) continue;
    kept->push_back(one);
    --count;
  }
}

}  // namespace

std::vector<StartHypothesis> SearchByGeometry(
    const SearchCloud& all, const std::vector<Eigen::Vector3d>& ups, const ScanVolume& volume,
    const std::vector<HintRay>& hints, const GeometrySearchOptions& options, int num_threads) {
  if (all.points.empty() || ups.empty() || !(volume.Extent() > 0)) return {};
  const SearchCloud cloud = Thinned(all, kCorrelatedPoints);
  std::vector<LevelCloud> levels;
  for (const Eigen::Vector3d& up : ups) levels.push_back(MakeLevel(cloud, up));
  const int reach = static_cast<int>(std::ceil(std::log(options.scale_reach) / options.scale_step));
  const int num_scales = 2 * reach + 1;
  std::vector<std::vector<StartHypothesis>> found(levels.size() * num_scales);
  ParallelFor(num_threads, 0, static_cast<int>(found.size()), [&](int i) {
    const LevelCloud& level = levels[i / num_scales];
    const double middle_scale = volume.Extent() / level.extent;
    const OneScale one(level, volume,
                       middle_scale * std::exp(options.scale_step * (i % num_scales - reach)));
    found[i] = one.Search(hints, RadFromDeg(options.turn_step_deg));
  });

  std::vector<StartHypothesis> all_found, kept;
  for (const auto& some : found) all_found.insert(all_found.end(), some.begin(), some.end());
  const Eigen::Vector3d& middle = levels[0].middle;
  KeepBest(std::move(all_found), options.num_kept, middle, &kept);
  for (int scale = 0; scale < num_scales; ++scale) {
    std::vector<StartHypothesis> of_scale;
    for (size_t i = scale; i < found.size(); i += num_scales) {
      of_scale.insert(of_scale.end(), found[i].begin(), found[i].end());
    }
    KeepBest(std::move(of_scale), options.num_kept_per_scale, middle, &kept);
  }
  return kept;
}

}  // namespace roomtex
