#include "colmap_ext/ransac.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>

namespace roomtex {
namespace {

// The first `count` of `order` become a random sample; own arithmetic instead of a library's
// distribution, so that every platform draws the same.
void DrawSample(int count, std::mt19937_64* random, std::vector<int>* order) {
  for (int i = 0; i < count; ++i) {
    const uint64_t left = order->size() - i;
    std::swap((*order)[i], (*order)[i + (*random)() % left]);
  }
}

int SamplesNeeded(double inlier_share, int sample_size, const RansacOptions& options) {
  const double clean = std::pow(inlier_share, sample_size);
  if (clean >= 1 - 1e-12) return options.min_samples;
  if (clean <= 1e-12) return options.max_samples;
  const double needed = std::log(1 - options.confidence) / std::log1p(-clean);
  return static_cast<int>(
      std::clamp(std::ceil(needed), 1.0 * options.min_samples, 1.0 * options.max_samples));
}

}  // namespace

RansacResult RunRansac(int num_data, int sample_size, const RansacOptions& options,
                       const RansacFit& fit, const RansacFit& refine,
                       const std::function<double(const Eigen::Matrix3d&, int)>& squared_error) {
  RansacResult best;
  if (num_data < sample_size) return best;
  const double limit = options.max_error_px * options.max_error_px;
  best.cost = std::numeric_limits<double>::infinity();

  // Takes the model if it is better than the best so far.
  const auto take_if_better = [&](const Eigen::Matrix3d& model) {
    double cost = 0;
    for (int i = 0; i < num_data && cost < best.cost; ++i) {
      const double error = squared_error(model, i);
      cost += error < limit ? error : limit;  // NaN counts as outlier
    }
    if (!(cost < best.cost)) return false;
    best.model = model;
    best.cost = cost;
    best.inliers.clear();
    for (int i = 0; i < num_data; ++i) {
      if (squared_error(model, i) < limit) best.inliers.push_back(i);
    }
    return true;
  };
  const auto offer = [&](const std::vector<Eigen::Matrix3d>& models) {
    bool better = false;
    for (const Eigen::Matrix3d& model : models) better |= take_if_better(model);
    return better;
  };

  std::mt19937_64 random(options.random_seed);
  std::vector<int> order(num_data);
  std::iota(order.begin(), order.end(), 0);
  int needed = options.max_samples;
  constexpr int kMaxLocalSteps = 4;
  for (int sample = 0; sample < needed; ++sample) {
    DrawSample(sample_size, &random, &order);
    if (!offer(fit({order.begin(), order.begin() + sample_size}))) continue;
    for (int step = 0; step < kMaxLocalSteps; ++step) {
      if (static_cast<int>(best.inliers.size()) < sample_size) break;
      if (!offer(refine(best.inliers))) break;
    }
    needed = SamplesNeeded(1.0 * best.inliers.size() / num_data, sample_size, options);
  }
  best.success = static_cast<int>(best.inliers.size()) >= sample_size;
  return best;
}

std::vector<int> RandomSubset(int bound, int count, uint64_t random_seed) {
  std::vector<int> order(std::max(bound, 0));
  std::iota(order.begin(), order.end(), 0);
  if (count >= bound) return order;
  std::mt19937_64 random(random_seed);
  DrawSample(count, &random, &order);
  order.resize(count);
  std::sort(order.begin(), order.end());
  return order;
}

}  // namespace roomtex
