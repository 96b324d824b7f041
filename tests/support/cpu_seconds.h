#pragma once

#include <ctime>

namespace roomtex {

// CPU seconds of this process so far, all threads together.
inline double CpuSeconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

}  // namespace roomtex
