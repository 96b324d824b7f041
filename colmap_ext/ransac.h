#pragma once
// RANSAC with a truncated cost (MSAC, Torr and Zisserman 2000), local optimisation of every new
// best model (LO-RANSAC, Chum et al. 2003) and an adaptive number of samples. Deterministic by its
// seed.

#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

namespace roomtex {

struct RansacOptions {
  double max_error_px = 2;     // larger = more tolerant
  double confidence = 0.9999;  // that one sample without outliers was drawn; larger = more samples
  int min_samples = 30, max_samples = 5000;
  uint64_t random_seed = 0;
};

struct RansacResult {
  Eigen::Matrix3d model = Eigen::Matrix3d::Zero();
  std::vector<int> inliers;  // positions in the data, ascending
  double cost = 0;           // sum of min(error^2, max_error^2), px^2
  bool success = false;
};

// The models that a sample allows: several for minimal solvers, none if the sample is degenerate.
using RansacFit = std::function<std::vector<Eigen::Matrix3d>(const std::vector<int>& sample)>;

// fit: models from sample_size data. refine: the same from more of them, the inliers of a new best
// model (local optimisation). squared_error: px^2 of one datum, for 0 <= i < num_data.
RansacResult RunRansac(int num_data, int sample_size, const RansacOptions& options,
                       const RansacFit& fit, const RansacFit& refine,
                       const std::function<double(const Eigen::Matrix3d&, int)>& squared_error);

// `count` different numbers below `bound`, ascending; all of them if count >= bound. Deterministic.
std::vector<int> RandomSubset(int bound, int count, uint64_t random_seed);

}  // namespace roomtex
