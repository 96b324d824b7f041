#include "core/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/rayleigh.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/random_stream.h"

namespace roomtex {
namespace {

using testing::ElementsAre;
using testing::IsNan;

TEST(Median, IsTheUpperOfTheTwoInTheMiddle) {
  EXPECT_EQ(Median(std::vector<double>{3, 1, 2}), 2);
  EXPECT_EQ(Median(std::vector<double>{4, 1, 3, 2}), 3);
  EXPECT_EQ(Median(std::vector<float>{7}), 7);
}

TEST(Median, OfNoneIsWhatTheCallerWants) {
  EXPECT_EQ(Median(std::vector<double>()), 0);
  EXPECT_THAT(Median(std::vector<double>(), std::nan("")), IsNan());
  EXPECT_EQ(Quantile(std::vector<float>(), 0.5, -1.0f), -1);
}

TEST(Median, LeavesACopyAloneAndStandsInfinities) {
  std::vector<double> values = {std::numeric_limits<double>::infinity(), 5, 1};
  EXPECT_EQ(Median(values), 5);
  EXPECT_THAT(values, ElementsAre(std::numeric_limits<double>::infinity(), 5, 1));
  EXPECT_EQ(Median(&values), 5);
}

TEST(MidpointMedian, LiesBetweenTheTwoInTheMiddle) {
  EXPECT_EQ(MidpointMedian(std::vector<double>{4, 1, 3, 2}), 2.5);
  EXPECT_EQ(MidpointMedian(std::vector<double>{3, 1, 2}), 2);
  EXPECT_THAT(MidpointMedian(std::vector<double>(), std::nan("")), IsNan());
}

TEST(Quantile, IsTheValueOfThatRankInTheSortedOnes) {
  RandomStream random(1);
  for (const size_t size : {1, 2, 5, 100}) {
    std::vector<double> values;
    for (size_t i = 0; i < size; ++i) values.push_back(random.Uniform(-1, 1));
    std::vector<double> sorted = values;
    std::sort(sorted.begin(), sorted.end());
    for (size_t rank = 0; rank < size; ++rank) EXPECT_EQ(AtRank(&values, rank), sorted[rank]);
    for (const double share : {0.0, 0.01, 0.5, 0.95, 1.0}) {
      const auto rank = static_cast<size_t>(share * static_cast<double>(size - 1));
      EXPECT_EQ(Quantile(values, share), sorted[rank]) << size << " " << share;
    }
  }
}

TEST(MedianAbsoluteDeviation, IsNotCarriedAwayByHalfOfTheValues) {
  EXPECT_EQ(MedianAbsoluteDeviation<double>({9, 10, 11, 10, 1000, 999}, 10), 1);
}

TEST(WeightedMedian, IsWhereHalfOfTheWeightIsReached) {
  std::vector<std::pair<double, double>> values = {{3, 1}, {1, 1}, {2, 5}};
  EXPECT_EQ(WeightedMedian(&values), 2);
  values = {{1, 10}, {2, 1}, {3, 1}};
  EXPECT_EQ(WeightedMedian(&values), 1);
  // With equal weights the lower one of two: the half is reached there.
  values = {{1, 1}, {2, 1}};
  EXPECT_EQ(WeightedMedian(&values), 1);
}

// To the digits that they are written with.
TEST(Constants, AreThoseOfTheDistributions) {
  namespace math = boost::math;
  const double quartile = quantile(math::normal(), 0.75);
  EXPECT_NEAR(kSigmaPerMad, 1 / quartile, 5e-5);
  EXPECT_NEAR(kMadPerSigma, quartile, 5e-5);
  EXPECT_NEAR(kMedianSquarePerVariance, quantile(math::chi_squared(1), 0.5), 5e-5);
  EXPECT_NEAR(kMedianLengthPerSigma, quantile(math::rayleigh(1), 0.5), 5e-5);
}

}  // namespace
}  // namespace roomtex
