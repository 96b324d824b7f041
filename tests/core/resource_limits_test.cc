#include "core/resource_limits.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

// In shares of what is free, so that the machine does not matter.
TEST(SampleWork, OfSeveralScansTheBoundAndTheLargestCount) {
  const double per_sample = static_cast<double>(AvailableMemory()) / 100;
  {
    const SampleWork work("colouring", per_sample);
    RequireMemoryForSamples("a", 40);
    EXPECT_INPUT_ERROR(RequireMemoryForSamples("b", 80), "colouring 120 samples takes");
  }
  {
    const SampleWork work("colouring", per_sample, 50, per_sample);
    for (int i = 0; i < 20; ++i) RequireMemoryForSamples("a", 40);
    RequireMemoryForSamples("many.e57", 1000, 40);
    EXPECT_INPUT_ERROR(RequireMemoryForSamples("b", 60), "of memory, and");
  }
  {
    const SampleWork work("colouring", per_sample, 50, per_sample);
    // One scan is not thinned.
    EXPECT_INPUT_ERROR(RequireMemoryForSamples("a", 120), "colouring 120 samples takes");
  }
}

}  // namespace
}  // namespace roomtex
