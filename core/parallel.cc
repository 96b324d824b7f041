#include "core/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "core/resource_limits.h"

namespace roomtex {

namespace {

// More do not help, and each takes memory of its own.
constexpr int kMaxThreadsPerProcessor = 8;

}  // namespace

int EffectiveThreads(int num_threads) {
  const int processors = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  if (num_threads > 0) return std::min(num_threads, kMaxThreadsPerProcessor * processors);
  return processors;
}

void ParallelFor(int num_threads, int begin, int end, const std::function<void(int)>& body) {
  const int count = std::min(EffectiveThreads(num_threads), end - begin);
  if (count <= 1) {
    for (int i = begin; i < end; ++i) body(i);
    return;
  }
  std::atomic<int> next{begin};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto work = [&] {
    for (int i = next++; i < end; i = next++) {
      try {
        body(i);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(failure_mutex);
        if (!failure) failure = std::current_exception();
        next = end;
      }
    }
  };
  std::vector<std::thread> threads;
  try {
    for (int t = 1; t < count; ++t) threads.emplace_back(work);
  } catch (const std::system_error&) {
    NoteThreadNotStarted();  // those that there are do it all
  }
  work();
  for (std::thread& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace roomtex
