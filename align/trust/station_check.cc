#include "align/trust/station_check.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <unordered_map>
#include <utility>

#include <Eigen/Geometry>

#include "align/fit/similarity_accuracy.h"
#include "align/fit/similarity_normal.h"
#include "align/surface/scan_patches.h"
#include "core/cell_key.h"
#include "core/frames.h"
#include "core/robust_kernel.h"
#include "core/statistics.h"
#include "core/text.h"
#include "core/twist.h"
#include "importers/scan_poses.h"

namespace roomtex {
namespace {

constexpr int kMaxPatches = 6000;  // of one scan that are tried
constexpr int kMinCommon = 200;    // fewer patches on the other's surface are no overlap
constexpr double kMinCommonShare = 0.1;
// Metres: how far off a station is looked for, and the gate of the last steps.
constexpr double kFirstGate = 0.2, kLastGate = 0.02;
constexpr double kGateShrink = 0.8;
// Times as much surface as where the poses put a station must lie on the other's elsewhere.
constexpr double kMoreElsewhere = 1.05;
constexpr int kMaxSteps = 40, kNumRegisterings = 3;
constexpr double kSettled = 1e-5;  // metres and radians of a step at the last gate
// What is known without any surface: keeps open directions where they are (metres, radians).
constexpr double kPriorStationMove = 0.05, kPriorStationTurn = 0.02;
// An offset counts from here on (metres), and when it is this many standard deviations.
constexpr double kLeastOffset = 0.006, kDeviations = 4;

// The patches of a scan as points that are to lie on another one.
std::vector<SurfacePoint> PatchesAsPoints(const ScanPatches& patches) {
  const size_t stride = patches.patches().size() / kMaxPatches + 1;
  std::vector<SurfacePoint> points;
  for (size_t i = 0; i < patches.patches().size(); i += stride) {
    const ScanPatch& patch = patches.patches()[i];
    SurfacePoint point;
    point.x_in_sparse = patch.point;
    point.to_cameras = patch.normal;
    point.covariance = patch.thickness * patch.thickness / patch.num_samples *
                       (patch.normal * patch.normal.transpose());
    points.push_back(point);
  }
  return points;
}

struct Solution {
  Similarity moved;  // scale 1
  std::vector<SurfaceMatch> matches;
  // Of the last step; by parts of the room, for the jackknife.
  SimilarityNormal normal;
  std::vector<SimilarityNormal> parts;
  Matrix7d inverse = Matrix7d::Zero();
};

void HoldScale(SimilarityNormal* normal) {
  normal->matrix.row(6).setZero();
  normal->matrix.col(6).setZero();
  normal->gradient[6] = 0;
}

// Returns the length of the step, metres and radians; infinite without overlap.
double Step(const std::vector<SurfacePoint>& points, const ScanPatches& surface, double gate,
            const Eigen::Vector3d& pivot, Solution* solution) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  solution->matches = FindMatches(points, surface, solution->moved, gate, gate);
  if (static_cast<int>(solution->matches.size()) < kMinCommon) return kNone;
  const SurfaceWeights weights(solution->matches, surface);
  SimilarityNormal& normal = solution->normal;
  normal = SimilarityNormal();
  solution->parts.assign(weights.num_parts(), SimilarityNormal());
  for (size_t k = 0; k < solution->matches.size(); ++k) {
    if (!weights.Counts(k)) continue;
    const SurfaceMatch& match = solution->matches[k];
    const double root = TukeyRootWeight(match.distance, gate);
    for (SimilarityNormal* one : {&normal, &solution->parts[weights.Part(k)]}) {
      one->AddDistance(match.distance, solution->moved * points[match.point].x_in_sparse,
                       weights.Normal(k), pivot, root * root / weights.Variance(k));
    }
  }
  for (int k = 0; k < 6; ++k) {
    const double prior = k < 3 ? kPriorStationMove : kPriorStationTurn;
    normal.matrix(k, k) += 1 / (prior * prior);
  }
  HoldScale(&normal);
  for (SimilarityNormal& part : solution->parts) HoldScale(&part);
  normal.matrix(6, 6) = 1;
  Vector7d step;
  if (!normal.SolveStep(&step, &solution->inverse)) return kNone;
  step[6] = 0;
  solution->moved = Moved(solution->moved, pivot, step);
  return step.norm();
}

// How far the common surface moves across itself, and how well that is known.
void MeasureOffset(const std::vector<SurfacePoint>& points, const ScanPatches& surface,
                   const Eigen::Vector3d& pivot, const Solution& solution, StationPair* pair) {
  // What the noise leaves open, or what single parts of the surface draw: where few patches have
  // samples enough, chance matches of one part can.
  Matrix7d covariance =
      Larger(solution.inverse, JackknifeCovariance(solution.normal, solution.parts));
  covariance.row(6).setZero();
  covariance.col(6).setZero();
  double sum = 0, variance = 0;
  for (const SurfaceMatch& match : solution.matches) {
    const Eigen::Vector3d& n = surface.patches()[match.patch].normal;
    const Eigen::Vector3d& x = points[match.point].x_in_sparse;
    const Eigen::Vector3d arm = x - pivot;
    sum += std::pow(n.dot(solution.moved * x - x), 2);
    Vector7d jacobian;
    jacobian << n, arm.cross(n), 0;
    variance += jacobian.dot(covariance * jacobian);
  }
  const auto count = static_cast<double>(solution.matches.size());
  pair->offset = std::sqrt(sum / count);
  pair->sigma = std::sqrt(variance / count);
}

// Which stations have surface where, by cubes, so that those which share none are never compared:
// of stations in many rooms, nearly all pairs.
class StationCells {
 public:
  explicit StationCells(const std::vector<ScanPatches>& patches) : counts_(patches.size(), 0) {
    for (int station = 0; station < static_cast<int>(patches.size()); ++station) {
      for (const ScanPatch& patch : patches[station].patches()) {
        std::vector<int>& there = stations_[CellKey(patch.point, kCell)];
        if (there.empty() || there.back() != station) there.push_back(station);
      }
      reach_ = std::max(reach_, std::hypot(kFirstGate, patches[station].cell_size()));
    }
  }

  // Those before `station` that have a patch within reach of so many of its points that
  // ComparePair() may find enough matches; it looks no farther.
  std::vector<int> Candidates(int station, const std::vector<SurfacePoint>& points) {
    std::fill(counts_.begin(), counts_.end(), 0);
    std::vector<size_t> last(counts_.size(), points.size());
    for (size_t i = 0; i < points.size(); ++i) {
      const Eigen::Array3d x = points[i].x_in_sparse.array();
      const Eigen::Array3d low = ((x - reach_) / kCell).floor(),
                           high = ((x + reach_) / kCell).floor();
      Eigen::Array3d cell;
      for (cell.x() = low.x(); cell.x() <= high.x(); ++cell.x()) {
        for (cell.y() = low.y(); cell.y() <= high.y(); ++cell.y()) {
          for (cell.z() = low.z(); cell.z() <= high.z(); ++cell.z()) {
            const auto at = stations_.find(CellKey(cell));
            if (at == stations_.end()) continue;
            for (const int other : at->second) {
              if (other >= station) break;  // in order
              counts_[other] += last[other] != i;
              last[other] = i;
            }
          }
        }
      }
    }
    std::vector<int> candidates;
    for (int other = 0; other < station; ++other) {
      if (IsEnough(static_cast<size_t>(counts_[other]), points.size())) candidates.push_back(other);
    }
    return candidates;
  }

  static bool IsEnough(size_t num_matches, size_t num_points) {
    return num_matches > 0 &&
           static_cast<double>(num_matches) >= kMinCommonShare * static_cast<double>(num_points);
  }

 private:
  static constexpr double kCell = 0.5;  // metres
  // By CellKey: of cells a thousand kilometres apart a pair is compared for nothing.
  std::unordered_map<uint64_t, std::vector<int>> stations_;
  std::vector<int> counts_;
  double reach_ = 0;
};

// How many points lie on the surface, those near it whole.
double OnSurface(const Solution& solution) {
  double sum = 0;
  for (const SurfaceMatch& match : solution.matches) {
    const double root = TukeyRootWeight(match.distance, kLastGate);
    sum += root * root;
  }
  return sum;
}

// From where the poses put the two; its matches are none where they do not overlap.
Solution Settled(const std::vector<SurfacePoint>& points, const ScanPatches& surface,
                 double first_gate, const Eigen::Vector3d& pivot) {
  Solution solution;
  double gate = first_gate;
  for (int i = 0; i < kMaxSteps; ++i) {
    const double length = Step(points, surface, gate, pivot, &solution);
    if (!std::isfinite(length)) {
      solution.matches.clear();
      return solution;
    }
    if (gate == kLastGate && length < kSettled) break;
    gate = std::max(kLastGate, kGateShrink * gate);
  }
  return solution;
}

// points: PatchesAsPoints() of the second.
StationPair ComparePair(const ScanPatches& first, const std::vector<SurfacePoint>& points) {
  StationPair pair;
  Solution solution;
  solution.matches = FindMatches(points, first, Similarity(), kFirstGate, kFirstGate);
  if (!StationCells::IsEnough(solution.matches.size(), points.size())) return pair;
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();
  for (const SurfaceMatch& match : solution.matches) {
    pivot += points[match.point].x_in_sparse / static_cast<double>(solution.matches.size());
  }
  // Where few patches have samples enough, chance matches draw a station away: it is elsewhere only
  // where that puts more of its surface onto the other's.
  const Solution near = Settled(points, first, kLastGate, pivot);
  solution = Settled(points, first, kFirstGate, pivot);
  if (kMoreElsewhere * OnSurface(near) > OnSurface(solution)) solution = near;
  if (solution.matches.empty()) return pair;
  pair.num_patches = static_cast<int>(solution.matches.size());
  pair.first_from_second = {solution.moved.rotation, solution.moved.translation};
  pair.turn = RotationAngle(solution.moved.rotation, Eigen::Quaterniond::Identity());
  MeasureOffset(points, first, pivot, solution, &pair);
  return pair;
}

// Stations by how many of their neighbours contradict them: of a pair, the one with more.
std::vector<int> FindWrong(const std::vector<StationPair>& pairs, size_t num_scans) {
  std::vector<int> neighbours(num_scans, 0), against(num_scans, 0), wrong;
  for (const StationPair& pair : pairs) {
    for (const int scan : {pair.first, pair.second}) {
      ++neighbours[scan];
      against[scan] += pair.Disagrees();
    }
  }
  for (int scan = 0; scan < static_cast<int>(num_scans); ++scan) {
    if (against[scan] > 0 && 2 * against[scan] > neighbours[scan]) wrong.push_back(scan);
  }
  if (wrong.empty()) {
    for (int scan = 0; scan < static_cast<int>(num_scans); ++scan) {
      if (against[scan] > 0) wrong.push_back(scan);
    }
  }
  std::stable_sort(wrong.begin(), wrong.end(),
                   [&](int a, int b) { return against[a] > against[b]; });
  return wrong;
}

ScanPatches PatchesOf(const Scan& scan) { return ScanPatches({scan}, ScanPatchOptions()); }

std::vector<ScanPatches> PatchesOf(const std::vector<Scan>& scans) {
  std::vector<ScanPatches> patches;
  patches.reserve(scans.size());
  for (const Scan& scan : scans) patches.push_back(PatchesOf(scan));
  return patches;
}

StationCheck ComparePatches(const std::vector<ScanPatches>& patches) {
  StationCheck check;
  StationCells cells(patches);
  for (int second = 1; second < static_cast<int>(patches.size()); ++second) {
    const std::vector<SurfacePoint> points = PatchesAsPoints(patches[second]);
    for (const int first : cells.Candidates(second, points)) {
      StationPair pair = ComparePair(patches[first], points);
      pair.first = first;
      pair.second = second;
      if (pair.num_patches > 0) check.pairs.push_back(pair);
    }
  }
  std::sort(check.pairs.begin(), check.pairs.end(), [](const StationPair& a, const StationPair& b) {
    return std::pair(a.first, a.second) < std::pair(b.first, b.second);
  });
  check.wrong = FindWrong(check.pairs, patches.size());
  return check;
}

}  // namespace

bool StationPair::Disagrees() const {
  return num_patches > 0 && offset > std::max(kLeastOffset, kDeviations * sigma);
}

const StationPair* StationCheck::Worst() const {
  const StationPair* worst = nullptr;
  for (const StationPair& pair : pairs) {
    if (pair.Disagrees() && (worst == nullptr || pair.offset > worst->offset)) worst = &pair;
  }
  return worst;
}

std::string StationCheck::Sentence(const std::vector<Scan>& scans) const {
  if (wrong.empty()) return "";
  const StationPair* const worst = Worst();
  std::string names;
  for (const int scan : wrong) names += (names.empty() ? "" : ", ") + ScanName(scans, scan);
  return "The scans do not fit together: " + ScanName(scans, worst->first) + " and " +
         ScanName(scans, worst->second) + " are " + Number(1000 * worst->offset, 0) + " mm and " +
         Number(DegFromRad(worst->turn), 2) +
         " degrees off where they show the same surface; contradicted by most of its neighbours: " +
         names +
         ". Correct the poses of the scans (--scan_poses), or let them be registered anew "
         "(--register_stations 1).";
}

StationCheck CheckStations(const std::vector<Scan>& scans) {
  return scans.size() < 2 ? StationCheck() : ComparePatches(PatchesOf(scans));
}

std::vector<int> RegisterStations(std::vector<Scan>* scans) {
  std::set<int> moved;
  std::vector<ScanPatches> patches = PatchesOf(*scans);
  for (int round = 0; round < kNumRegisterings; ++round) {
    const StationCheck check = ComparePatches(patches);
    // The worst that is not the first: onto all that are not contradicted, together.
    const auto worst =
        std::find_if(check.wrong.begin(), check.wrong.end(), [](int scan) { return scan != 0; });
    if (worst == check.wrong.end()) break;
    std::vector<Scan> others;
    for (int scan = 0; scan < static_cast<int>(scans->size()); ++scan) {
      const bool doubted =
          scan != 0 && std::count(check.wrong.begin(), check.wrong.end(), scan) > 0;
      if (scan != *worst && !doubted) others.push_back((*scans)[scan]);
    }
    const StationPair pair =
        ComparePair(ScanPatches(others, ScanPatchOptions()), PatchesAsPoints(patches[*worst]));
    if (pair.num_patches == 0) break;
    Scan& scan = (*scans)[*worst];
    PlaceScan(pair.first_from_second * scan.scan_from_station, &scan);
    patches[*worst] = PatchesOf(scan);
    moved.insert(*worst);
  }
  return {moved.begin(), moved.end()};
}

}  // namespace roomtex
