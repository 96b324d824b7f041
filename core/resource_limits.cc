#include "core/resource_limits.h"

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <fstream>
#include <future>
#include <limits>
#include <mutex>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <opencv2/core/utility.hpp>
#include <sys/resource.h>

#include "core/error.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr int64_t kUnlimited = std::numeric_limits<int64_t>::max();

std::atomic<int> threads_not_started{0};

// A number behind a word in one of the kernel's tables, in its unit; kUnlimited = not there.
int64_t NumberOf(const char* path, const std::string& word) {
  std::ifstream stream(path);
  std::string name;
  for (std::string line; std::getline(stream, line);) {
    if (!BeginsWith(line, word)) continue;
    const long long value = std::atoll(line.c_str() + word.size());
    return value >= 0 ? value : kUnlimited;
  }
  return kUnlimited;
}

// Of a container (cgroup v2): its limit less what it uses that cannot be taken back.
int64_t LeftInContainer() {
  const int64_t limit = NumberOf("/sys/fs/cgroup/memory.max", "");
  if (limit <= 0 || limit == kUnlimited) return kUnlimited;  // "max" reads as 0
  const int64_t used = NumberOf("/sys/fs/cgroup/memory.current", "");
  const int64_t cached = NumberOf("/sys/fs/cgroup/memory.stat", "file ");
  return used == kUnlimited ? limit : limit - used + (cached == kUnlimited ? 0 : cached);
}

int64_t LeftOfAddressSpace() {
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return kUnlimited;
  const int64_t used = NumberOf("/proc/self/status", "VmSize:");
  return static_cast<int64_t>(limit.rlim_cur) - (used == kUnlimited ? 0 : 1024 * used);
}

std::string Gigabytes(double bytes) {
  return bytes < 1e8 ? fmt::format("{:.0f} MB", bytes / 1e6)
                     : fmt::format("{:.1f} GB", bytes / 1e9);
}

}  // namespace

int64_t AvailableMemory() {
  const int64_t free = NumberOf("/proc/meminfo", "MemAvailable:");
  const int64_t swap = NumberOf("/proc/meminfo", "SwapFree:");
  const int64_t machine =
      free == kUnlimited ? kUnlimited : 1024 * (free + (swap == kUnlimited ? 0 : swap));
  return std::max<int64_t>(0, std::min({machine, LeftInContainer(), LeftOfAddressSpace()}));
}

void RequireMemory(const std::string& path, const std::string& what, double num_bytes,
                   const std::string& remedy) {
  const auto available = static_cast<double>(AvailableMemory());
  if (num_bytes <= available) return;
  throw InputError(path, "",
                   fmt::format("{} takes {} of memory, and {} are free", what, Gigabytes(num_bytes),
                               Gigabytes(available)),
                   remedy);
}

namespace {

struct StateOfWork {
  std::string what;
  double bytes_per_sample, max_samples, bytes_per_full_sample, available;
  double samples = 0, largest = 0;
};
std::optional<StateOfWork> sample_work;
std::mutex sample_work_mutex;

}  // namespace

SampleWork::SampleWork(const std::string& what, double bytes_per_sample, double max_samples,
                       double bytes_per_full_sample) {
  const std::lock_guard<std::mutex> lock(sample_work_mutex);
  sample_work = StateOfWork{what, bytes_per_sample, max_samples, bytes_per_full_sample,
                            static_cast<double>(AvailableMemory())};
}

SampleWork::~SampleWork() {
  const std::lock_guard<std::mutex> lock(sample_work_mutex);
  sample_work.reset();
}

void RequireMemoryForSamples(const std::string& path, double count, double largest) {
  constexpr double kReadBytesPerSample = 28;  // place and intensity
  const std::lock_guard<std::mutex> lock(sample_work_mutex);
  const auto now = static_cast<double>(AvailableMemory());
  StateOfWork work = sample_work.value_or(
      StateOfWork{"reading", kReadBytesPerSample, std::numeric_limits<double>::infinity(), 0, now});
  work.samples += count;
  work.largest = std::max(work.largest, largest > 0 ? largest : count);
  if (sample_work) *sample_work = work;
  double needed = work.samples * work.bytes_per_sample;
  if (work.largest < work.samples) {  // one alone is not thinned
    needed = std::min(needed, work.max_samples * work.bytes_per_sample +
                                  work.largest * work.bytes_per_full_sample);
  }
  if (needed <= work.available) return;
  throw InputError(path, "",
                   fmt::format("{} {:.0f} samples takes {} of memory, and {} are free", work.what,
                               work.samples, Gigabytes(needed), Gigabytes(work.available)),
                   "Give a machine with more memory, or a scan with fewer samples");
}

std::string BytesPerSampleHelp(double bytes, bool bounded) {
  if (!bounded) return fmt::format("Takes about {:.0f} bytes of memory a sample.", bytes);
  return fmt::format(
      "Takes about {:.0f} bytes of memory a sample of at most --max_samples; of scans with more, "
      "one at a time is held in full beside them.",
      bytes);
}

int ThreadsNotStarted() { return threads_not_started; }
void NoteThreadNotStarted() { ++threads_not_started; }

std::thread StartThread(std::function<void()> work) {
  try {
    return std::thread(std::move(work));
  } catch (const std::system_error&) {
    NoteThreadNotStarted();
    throw;
  }
}

void ProbeThreads(int count) {
  std::vector<std::thread> threads;
  std::promise<void> all_started;
  const std::shared_future<void> wait = all_started.get_future().share();
  try {
    for (int i = 0; i < count; ++i) threads.emplace_back([wait] { wait.wait(); });
  } catch (const std::system_error&) {
    NoteThreadNotStarted();
  }
  all_started.set_value();
  for (std::thread& thread : threads) thread.join();
  if (ThreadsNotStarted() > 0) cv::setNumThreads(1);
}

}  // namespace roomtex
