#include "core/progress.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>

#include <unistd.h>

namespace roomtex {
namespace {

constexpr int kBarWidth = 32;

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

Progress::Progress(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() { Finish(); }

void Progress::Stage(const std::string& name, int total) {
  Finish();
  const std::lock_guard<std::mutex> lock(mutex_);
  stage_ = name;
  total_ = total;
  done_ = 0;
  started_ = redrawn_ = std::chrono::steady_clock::now();
  if (terminal_) Redraw();
}

void Progress::Tick() {
  const std::lock_guard<std::mutex> lock(mutex_);
  ++done_;
  if (terminal_ && SecondsSince(redrawn_) > 0.1) Redraw();
}

void Progress::Finish() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (stage_.empty()) return;
  const double seconds = SecondsSince(started_);
  stages_.emplace_back(stage_, seconds);
  if (!quiet_) {
    std::fprintf(stderr, "%s%-24s %8.2f s\n", terminal_ ? "\r\033[K" : "", stage_.c_str(), seconds);
  }
  stage_.clear();
}

void Progress::Note(const std::string& message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!quiet_) std::fprintf(stderr, "%s  %s\n", terminal_ ? "\r\033[K" : "", message.c_str());
}

void Progress::Warning(const std::string& message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!quiet_)
    std::fprintf(stderr, "%swarning: %s\n", terminal_ ? "\r\033[K" : "", message.c_str());
}

void Progress::Redraw() {
  if (quiet_) return;
  redrawn_ = std::chrono::steady_clock::now();
  if (total_ <= 0) {
    std::fprintf(stderr, "\r\033[K%s ...", stage_.c_str());
  } else {
    const int filled = static_cast<int>(int64_t{kBarWidth} * std::min(done_, total_) / total_);
    std::fprintf(stderr, "\r\033[K%-24s [%.*s%*s] %d/%d", stage_.c_str(), filled,
                 "################################", kBarWidth - filled, "", done_, total_);
  }
  std::fflush(stderr);
}

}  // namespace roomtex
