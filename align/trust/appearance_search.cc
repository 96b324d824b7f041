#include "align/trust/appearance_search.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <utility>

#include "align/trust/scan_cells.h"
#include "core/frames.h"
#include "core/parallel.h"
#include "core/random_stream.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr int kParts = 64, kKeptOfPart = 6;  // of the samples: fixed, whatever the threads
constexpr double kFirstReach = 2;            // times the tolerance, before a sample is refined

// Median distance from the median point.
double RadiusOf(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d centre;
  std::vector<double> values(points.size());
  for (int k = 0; k < 3; ++k) {
    for (size_t i = 0; i < points.size(); ++i) values[i] = points[i][k];
    centre[k] = Median(values);
  }
  for (size_t i = 0; i < points.size(); ++i) values[i] = (points[i] - centre).norm();
  return Median(values);
}

// The matches in the order of the scan's cells.
class MatchedCells {
 public:
  MatchedCells(const std::vector<AppearanceMatch>& matches,
               const std::optional<Eigen::Vector3d>& up_in_sparse,
               const Eigen::Vector3d& up_in_scan, const AppearanceSearchOptions& options)
      : up_in_sparse_(up_in_sparse), up_in_scan_(up_in_scan), options_(options) {
    std::vector<std::pair<ScanCell, size_t>> by_cell;
    for (size_t i = 0; i < matches.size(); ++i) {
      by_cell.emplace_back(ScanCellOf(matches[i].x_in_scan, options.cell), i);
    }
    std::sort(by_cell.begin(), by_cell.end());
    for (size_t k = 0; k < by_cell.size(); ++k) {
      if (k == 0 || by_cell[k].first != by_cell[k - 1].first) {
        firsts_.push_back(static_cast<int>(k));
      }
      cells_.push_back(static_cast<int>(firsts_.size()) - 1);
      sparse_.push_back(matches[by_cell[k].second].x_in_sparse);
      scan_.push_back(matches[by_cell[k].second].x_in_scan);
    }
    firsts_.push_back(static_cast<int>(by_cell.size()));
    middle_scale_ = RadiusOf(scan_) / std::max(1e-12, RadiusOf(sparse_));
  }

  int num_cells() const { return static_cast<int>(firsts_.size()) - 1; }

  // A similarity of three matches that go together; mostly none.
  std::optional<Similarity> Sample(RandomStream* random) const {
    std::array<int, 3> which;
    for (int& one : which) {  // any cell: some have many matches, of a poster, say
      const int cell = random->Index(num_cells());
      one = firsts_[cell] + random->Index(firsts_[cell + 1] - firsts_[cell]);
    }
    double least = middle_scale_ * options_.scale_reach,
           most = middle_scale_ / options_.scale_reach;
    const double largest = least, smallest = most;
    for (int k = 0; k < 3; ++k) {
      const int i = which[k], j = which[(k + 1) % 3];
      const double length = (scan_[i] - scan_[j]).norm();
      if (length < options_.min_length) return std::nullopt;
      const double scale = length / std::max(1e-12, (sparse_[i] - sparse_[j]).norm());
      if (scale < smallest || scale > largest) return std::nullopt;
      least = std::min(least, scale);
      most = std::max(most, scale);
    }
    if (most > options_.max_stretch * least) return std::nullopt;
    Eigen::Matrix3Xd from(3, 3), to(3, 3);
    for (int k = 0; k < 3; ++k) {
      from.col(k) = sparse_[which[k]];
      to.col(k) = scan_[which[k]];
    }
    Similarity guess = FitSimilarity(from, to);
    if (!IsUpright(guess)) return std::nullopt;
    return guess;
  }

  // Cells with a match that agrees.
  int CellsWithin(const Similarity& scan_from_sparse, double tolerance) const {
    const Eigen::Matrix3d turn =
        scan_from_sparse.scale * scan_from_sparse.rotation.toRotationMatrix();
    int num = 0, last = -1;
    for (size_t i = 0; i < sparse_.size(); ++i) {
      if (cells_[i] == last) continue;
      const Eigen::Vector3d off = turn * sparse_[i] + scan_from_sparse.translation - scan_[i];
      if (off.squaredNorm() > tolerance * tolerance) continue;
      last = cells_[i];
      ++num;
    }
    return num;
  }

  // Least squares over what agrees, at first within thrice the tolerance; the best on the way.
  AppearancePlace Refined(const Similarity& guess) const {
    AppearancePlace best = {guess, CellsWithin(guess, options_.tolerance)};
    Similarity now = guess;
    for (const double wider : {2.0, 3.0, 3.0, 2.0, 2.0, 1.5, 1.5, 1.0, 1.0}) {
      const std::optional<Similarity> fitted = FitWithin(now, wider * options_.tolerance);
      if (!fitted || !IsUpright(*fitted)) break;
      now = *fitted;
      const int num_cells = CellsWithin(now, options_.tolerance);
      if (num_cells > best.num_cells) best = {now, num_cells};
    }
    return best;
  }

  // Metres: median over matches.
  double Between(const Similarity& a, const Similarity& b) const {
    std::vector<double> distances;
    for (size_t i = 0; i < sparse_.size(); i += 1 + sparse_.size() / 100) {
      distances.push_back((a * sparse_[i] - b * sparse_[i]).norm());
    }
    return Median(&distances);
  }

 private:
  bool IsUpright(const Similarity& scan_from_sparse) const {
    return !up_in_sparse_ || AngleBetween(scan_from_sparse.rotation * *up_in_sparse_, up_in_scan_) <
                                 RadFromDeg(options_.max_lean_deg);
  }
  // Each cell counts once, by the mean of its matches.
  std::optional<Similarity> FitWithin(const Similarity& now, double tolerance) const {
    Eigen::Matrix3Xd from(3, num_cells()), to(3, num_cells());
    Eigen::Index num = 0;
    for (int cell = 0; cell < num_cells(); ++cell) {
      Eigen::Vector3d a = Eigen::Vector3d::Zero(), b = a;
      int count = 0;
      for (int i = firsts_[cell]; i < firsts_[cell + 1]; ++i) {
        if ((now * sparse_[i] - scan_[i]).norm() > tolerance) continue;
        a += sparse_[i];
        b += scan_[i];
        ++count;
      }
      if (count == 0) continue;
      from.col(num) = a / count;
      to.col(num++) = b / count;
    }
    if (num < 4) return std::nullopt;
    return FitSimilarity(from.leftCols(num), to.leftCols(num));
  }

  const std::optional<Eigen::Vector3d> up_in_sparse_;
  const Eigen::Vector3d up_in_scan_;
  const AppearanceSearchOptions& options_;
  std::vector<Eigen::Vector3d> sparse_, scan_;
  std::vector<int> cells_;   // of each match
  std::vector<int> firsts_;  // of each cell its first match, and where the last one ends
  double middle_scale_ = 1;
};

}  // namespace

std::vector<AppearancePlace> SearchByAppearance(const std::vector<AppearanceMatch>& matches,
                                                const std::optional<Eigen::Vector3d>& up_in_sparse,
                                                const Eigen::Vector3d& up_in_scan,
                                                const AppearanceSearchOptions& options,
                                                int num_threads) {
  if (matches.empty()) return {};
  const MatchedCells cells(matches, up_in_sparse, up_in_scan, options);
  const auto is_better = [](const AppearancePlace& a, const AppearancePlace& b) {
    return a.num_cells > b.num_cells;
  };
  std::vector<std::vector<AppearancePlace>> of_parts(kParts);
  ParallelFor(num_threads, 0, kParts, [&](int part) {
    RandomStream random(MixBits(0x5eed, static_cast<uint64_t>(part)));
    std::vector<AppearancePlace>& best = of_parts[part];
    for (int k = 0; k < options.num_samples / kParts; ++k) {
      const std::optional<Similarity> guess = cells.Sample(&random);
      if (!guess) continue;
      const AppearancePlace place = {*guess,
                                     cells.CellsWithin(*guess, kFirstReach * options.tolerance)};
      const auto at = std::upper_bound(best.begin(), best.end(), place, is_better);
      if (at - best.begin() >= kKeptOfPart) continue;
      best.insert(at, place);
      if (best.size() > kKeptOfPart) best.pop_back();
    }
    for (AppearancePlace& one : best) one = cells.Refined(one.scan_from_sparse);
  });
  std::vector<AppearancePlace> all, kept;
  for (const auto& part : of_parts) all.insert(all.end(), part.begin(), part.end());
  std::stable_sort(all.begin(), all.end(), is_better);
  for (const AppearancePlace& one : all) {
    if (static_cast<int>(kept.size()) == options.num_kept) break;
    const bool is_new = std::none_of(kept.begin(), kept.end(), [&](const AppearancePlace& other) {
      return cells.Between(one.scan_from_sparse, other.scan_from_sparse) < options.distinct;
    });
    if (is_new) kept.push_back(one);
  }
  return kept;
}

}  // namespace roomtex
