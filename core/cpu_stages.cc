#include "core/cpu_stages.h"

#include <array>
#include <atomic>
#include <cstdint>
#include <ctime>

namespace roomtex {
namespace {

constexpr std::array<const char*, 10> kNames = {"mesh",    "decode", "depth map", "boundaries",
                                                "samples", "merge",  "exposure",  "blend",
                                                "detail",  "write"};

std::array<std::atomic<int64_t>, kNames.size()>& Nanoseconds() {
  static std::array<std::atomic<int64_t>, kNames.size()> nanoseconds{};
  return nanoseconds;
}

double Now(int clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace

CpuTimer::CpuTimer(CpuStage stage, Scope scope)
    : stage_(stage),
      clock_(scope == Scope::kThread ? CLOCK_THREAD_CPUTIME_ID : CLOCK_PROCESS_CPUTIME_ID),
      started_(Now(clock_)) {}

CpuTimer::~CpuTimer() {
  Nanoseconds()[static_cast<size_t>(stage_)] +=
      static_cast<int64_t>(1e9 * (Now(clock_) - started_));
}

std::vector<std::pair<std::string, double>> CpuSecondsByStage() {
  std::vector<std::pair<std::string, double>> result;
  double other = Now(CLOCK_PROCESS_CPUTIME_ID);
  for (size_t i = 0; i < kNames.size(); ++i) {
    const double seconds = 1e-9 * static_cast<double>(Nanoseconds()[i].load());
    result.emplace_back(kNames[i], seconds);
    other -= seconds;
  }
  result.emplace_back("other", other > 0 ? other : 0);
  return result;
}

}  // namespace roomtex
