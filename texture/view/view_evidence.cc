#include "texture/view/view_evidence.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/parallel.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// Nearest of many points, not farther than a cell.
class NearestPoint {
 public:
  NearestPoint(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& origin,
               double cell)
      : points_(points), origin_(origin), cell_(cell) {
    entries_.reserve(points.size());
    for (size_t i = 0; i < points.size(); ++i) {
      entries_.push_back({Hash(CellOf(points[i])), static_cast<uint32_t>(i)});
    }
    std::sort(entries_.begin(), entries_.end());
    // Where the entries of each leading part of the hash begin.
    begin_.assign((size_t{1} << kBits) + 1, 0);
    for (const auto& entry : entries_) ++begin_[(entry.first >> (64 - kBits)) + 1];
    for (size_t i = 1; i < begin_.size(); ++i) begin_[i] += begin_[i - 1];
  }

  // -1 = none.
  int Find(const Eigen::Vector3d& at) const {
    int best = -1;
    double best_distance = cell_;
    // Cells have twice the reach as their side, so that eight of them hold all candidates.
    const Eigen::Vector3d base = (at - origin_) / (2 * cell_) - Eigen::Vector3d::Constant(0.5);
    const Eigen::Matrix<int64_t, 3, 1> low = base.array().floor().matrix().cast<int64_t>();
    for (int corner = 0; corner < 8; ++corner) {
      const uint64_t hash =
          Hash(low + Eigen::Matrix<int64_t, 3, 1>(corner & 1, corner >> 1 & 1, corner >> 2));
      const size_t bucket = hash >> (64 - kBits);
      for (size_t i = begin_[bucket]; i < begin_[bucket + 1]; ++i) {
        if (entries_[i].first != hash) continue;
        const double distance = (points_[entries_[i].second] - at).norm();
        if (distance > best_distance) continue;
        best_distance = distance;
        best = static_cast<int>(entries_[i].second);
      }
    }
    return best;
  }

 private:
  static constexpr int kBits = 20;
  Eigen::Matrix<int64_t, 3, 1> CellOf(const Eigen::Vector3d& p) const {
    return ((p - origin_) / (2 * cell_)).array().floor().matrix().cast<int64_t>();
  }
  static uint64_t Hash(const Eigen::Matrix<int64_t, 3, 1>& cell) {
    uint64_t hash = 0x9e3779b97f4a7c15u;
    for (int k = 0; k < 3; ++k) {
      hash ^= static_cast<uint64_t>(cell[k]) + (hash << 6) + (hash >> 2);
      hash *= 0xff51afd7ed558ccdu;
      hash ^= hash >> 29;
    }
    return hash;
  }

  const std::vector<Eigen::Vector3d>& points_;
  Eigen::Vector3d origin_;
  double cell_;
  std::vector<std::pair<uint64_t, uint32_t>> entries_;
  std::vector<size_t> begin_;
};

std::vector<float> Finite(const std::vector<float>& values) {
  std::vector<float> finite;
  std::copy_if(values.begin(), values.end(), std::back_inserter(finite),
               [](float value) { return std::isfinite(value); });
  return finite;
}

uint8_t Byte(double value, double largest) {
  return static_cast<uint8_t>(std::lround(std::clamp(value, 0.0, largest)));
}

}  // namespace

ViewEvidence::ViewEvidence(const ViewChunks& chunks, const Eigen::Vector3d& origin,
                           const Evidence& evidence, int num_threads) {
  intensity_low_ = Quantile(Finite(evidence.intensity), 0.01);
  intensity_high_ = Quantile(Finite(evidence.intensity), 0.99);
  disagreement_high_ = std::max<double>(1.0, Quantile(Finite(evidence.disagreement), 0.98));
  for (const uint8_t views : evidence.views) max_views_ = std::max<int>(max_views_, views);
  const double width = std::max(intensity_high_ - intensity_low_, 1e-9);
  const NearestPoint nearest(evidence.points, origin, kMaxDistance);
  codes_.resize(chunks.chunks().size());
  std::vector<size_t> num_found(codes_.size(), 0);
  ParallelFor(num_threads, 0, static_cast<int>(codes_.size()), [&](int chunk) {
    for (const Eigen::Vector3f& point : chunks.Shown(chunk)) {
      const int found = nearest.Find(origin + point.cast<double>());
      if (found < 0) {
        codes_[chunk].push_back({0, 0, 255, 255});
        continue;
      }
      ++num_found[chunk];
      const float intensity = evidence.intensity[found], difference = evidence.disagreement[found];
      const double grey = 255 * (intensity - intensity_low_) / width;
      codes_[chunk].push_back(
          {Byte(std::isfinite(grey) ? grey : 0, 255), evidence.views[found],
           std::isfinite(difference) ? Byte(difference / kDisagreementStep, 254) : uint8_t{255},
           0});
    }
  });
  size_t found = 0, all = 0;
  for (size_t chunk = 0; chunk < codes_.size(); ++chunk) {
    found += num_found[chunk];
    all += codes_[chunk].size();
  }
  if (2 * found < all) {
    reason_ =
        "evidence.ply belongs to another model: its points lie elsewhere. Run roomtex-texture "
        "again.";
    codes_.clear();
  }
}

Json ViewEvidence::ToJson() const {
  return {{"available", reason_.empty()},
          {"reason", reason_},
          {"intensity", {intensity_low_, intensity_high_}},
          {"max_views", max_views_},
          {"disagreement_high", disagreement_high_},
          {"disagreement_step", kDisagreementStep}};
}

std::string ViewEvidence::Encode(int chunk, const std::vector<uint16_t>& points) const {
  std::string bytes;
  bytes.reserve(4 * points.size());
  for (const uint16_t point : points) {
    static constexpr std::array<uint8_t, 4> kNothing = {0, 0, 255, 255};
    const auto& code = codes_.empty() ? kNothing : codes_[chunk][point];
    bytes.append(reinterpret_cast<const char*>(code.data()), 4);
  }
  return bytes;
}

}  // namespace roomtex
