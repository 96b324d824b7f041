#pragma once
// Order statistics, and what they say of a normal distribution. One contract for all of them:
// - Of an even number of values the median is the upper one of the two in the middle, so that it is
//   always one of the values (and costs one std::nth_element).
// - A vector by value is left alone, a pointer to one is reordered: no copy, same result.
// - Of no values, Median() and Quantile() give `of_none`; the others need at least one.
// - No value may be NaN: it has no place in the order, and the result would be any of them. Callers
//   leave NaN out; infinities are fine.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace roomtex {

// Factors between robust measures and the standard deviation of normally distributed values. All
// follow from quantiles of the normal and the chi-square distribution (statistics_test.cc computes
// them); their digits stay, since results depend on them.
// Standard deviation over the median absolute deviation, 1 / Phi^-1(3/4) (Hampel 1974) ...
inline constexpr double kSigmaPerMad = 1.4826;
// ... and the other way round: the median size of values about 0 is so many standard deviations.
inline constexpr double kMadPerSigma = 0.6745;
// Median of the square of a value over the variance: chi-square of one.
inline constexpr double kMedianSquarePerVariance = 0.4549;
// Median length of a vector of two such values over the deviation of one: Rayleigh's distribution,
// sqrt(2 ln 2).
inline constexpr double kMedianLengthPerSigma = 1.1774;

// The value that `rank` others would stand before if all were sorted; rank < values->size().
template <typename T>
T AtRank(std::vector<T>* values, size_t rank) {
  const auto place = values->begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(values->begin(), place, values->end());
  return *place;
}

template <typename T>
T Median(std::vector<T>* values, T of_none = T(0)) {
  return values->empty() ? of_none : AtRank(values, values->size() / 2);
}
template <typename T>
T Median(std::vector<T> values, T of_none = T(0)) {
  return Median(&values, of_none);
}

// The textbook's median: the mean of the two in the middle of an even number. For numbers that a
// user may compute again.
template <typename T>
T MidpointMedian(std::vector<T> values, T of_none = T(0)) {
  const T upper = Median(&values, of_none);
  if (values.size() % 2 == 1 || values.empty()) return upper;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  return (upper + *std::max_element(values.begin(), middle)) / 2;
}

// The value that the share (0..1) of the others lies below: rank share * (n - 1), rounded down.
template <typename T>
T Quantile(std::vector<T>* values, double share, T of_none = T(0)) {
  if (values->empty()) return of_none;
  return AtRank(values, static_cast<size_t>(share * static_cast<double>(values->size() - 1)));
}
template <typename T>
T Quantile(std::vector<T> values, double share, T of_none = T(0)) {
  return Quantile(&values, share, of_none);
}

// Median distance of the values from `centre`. kSigmaPerMad times this is a standard deviation that
// up to half of the values being wrong cannot carry away.
template <typename T>
T MedianAbsoluteDeviation(std::vector<T> values, T centre) {
  for (T& value : values) value = std::abs(value - centre);
  return Median(&values);
}

// The value at which half of the weight is reached; pairs of value and weight > 0, sorted by the
// call. Weights are summed as double in the order of the values.
template <typename T>
T WeightedMedian(std::vector<std::pair<T, T>>* values_and_weights) {
  std::sort(values_and_weights->begin(), values_and_weights->end());
  double total = 0, sum = 0;
  for (const auto& [value, weight] : *values_and_weights) total += weight;
  for (const auto& [value, weight] : *values_and_weights) {
    sum += weight;
    if (sum >= total / 2) return value;
  }
  return values_and_weights->back().first;
}

}  // namespace roomtex
