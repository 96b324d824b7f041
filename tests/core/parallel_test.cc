#include "core/parallel.h"

#include <atomic>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace roomtex {
namespace {

TEST(ParallelFor, CallsEveryIndexOnce) {
  for (const int num_threads : {1, 2, 7, -1}) {
    std::vector<std::atomic<int>> calls(1000);
    ParallelFor(num_threads, 100, 1000, [&](int i) { ++calls[i]; });
    for (int i = 0; i < 1000; ++i) EXPECT_EQ(calls[i], i < 100 ? 0 : 1);
  }
}

TEST(ParallelFor, ResultDoesNotDependOnTheNumberOfThreads) {
  const auto compute = [](int num_threads) {
    std::vector<double> values(500);
    ParallelFor(num_threads, 0, 500, [&](int i) { values[i] = 1.0 / (i + 1); });
    return std::accumulate(values.begin(), values.end(), 0.0);
  };
  EXPECT_EQ(compute(1), compute(8));
}

TEST(ParallelFor, DoesNothingForAnEmptyRange) {
  for (const int end : {5, 4, -100}) {
    ParallelFor(4, 5, end, [](int) { ADD_FAILURE(); });
  }
}

TEST(ParallelFor, MoreThreadsThanIndicesIsFine) {
  std::atomic<int> sum{0};
  ParallelFor(64, 0, 3, [&](int i) { sum += i; });
  EXPECT_EQ(sum, 3);
}

TEST(ParallelFor, ThrowsTheExceptionOfABodyAgainAndStopsEarly) {
  for (const int num_threads : {1, 4}) {
    std::atomic<int> num_calls{0};
    try {
      ParallelFor(num_threads, 0, 1000000, [&](int i) {
        ++num_calls;
        if (i == 10) throw std::runtime_error("index 10");
      });
      ADD_FAILURE() << "no exception";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "index 10");
    }
    EXPECT_LT(num_calls, 1000000);
  }
}

TEST(ParallelFor, EveryBodyMayThrow) {
  EXPECT_THROW(ParallelFor(4, 0, 1000, [](int) { throw std::logic_error("all"); }),
               std::logic_error);
}

TEST(EffectiveThreads, AllMeansAtLeastOne) {
  EXPECT_GE(EffectiveThreads(-1), 1);
  EXPECT_EQ(EffectiveThreads(3), 3);
}

}  // namespace
}  // namespace roomtex
