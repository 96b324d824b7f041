#include "core/progress.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>

#include <fmt/core.h>
#include <unistd.h>

namespace roomtex {
namespace {

constexpr int kBarWidth = 32;
constexpr double kSecondsBetweenLines = 20;  // of one stage, without a terminal
constexpr double kTooSoon = 2;               // seconds: nothing is said of the remaining time yet

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// ", 1:20 left" in a stage that has done so many of its steps in so many seconds; "" where that
// cannot be told.
std::string RemainingText(double seconds, int done, int total) {
  if (seconds < kTooSoon || done <= 0 || done >= total) return "";
  const auto left = static_cast<int>(seconds * (total - done) / done + 0.5);
  return fmt::format(", {}:{:02} left", left / 60, left % 60);
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
  started_ = redrawn_ = said_ = std::chrono::steady_clock::now();
  if (terminal_) Redraw();
}

void Progress::Tick() {
  const std::lock_guard<std::mutex> lock(mutex_);
  ++done_;
  if (terminal_) {
    if (SecondsSince(redrawn_) > 0.1 || done_ == total_) Redraw();
  } else if (!quiet_ && total_ > 0 && SecondsSince(said_) > kSecondsBetweenLines) {
    said_ = std::chrono::steady_clock::now();
    std::fprintf(stderr, "  %s: %d of %d%s\n", stage_.c_str(), done_, total_,
                 RemainingText(SecondsSince(started_), done_, total_).c_str());
  }
}

void Progress::Share(double share, const std::string& text) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (quiet_ || stage_.empty()) return;
  const double bounded = std::min(share, 1.0);
  if (terminal_) {
    if (SecondsSince(redrawn_) < 0.1) return;
    redrawn_ = std::chrono::steady_clock::now();
    const int filled = share < 0 ? 0 : static_cast<int>(kBarWidth * bounded);
    std::fprintf(stderr, "\r\033[K%-24s [%.*s%*s] %s", stage_.c_str(), filled,
                 "################################", kBarWidth - filled, "", text.c_str());
    std::fflush(stderr);
  } else if (SecondsSince(said_) > kSecondsBetweenLines) {
    said_ = std::chrono::steady_clock::now();
    const std::string done =
        share < 0 ? "" : std::to_string(static_cast<int>(100 * bounded)) + " %, ";
    std::fprintf(stderr, "  %s: %s%s\n", stage_.c_str(), done.c_str(), text.c_str());
  }
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
    std::fprintf(stderr, "\r\033[K%-24s [%.*s%*s] %d/%d%s", stage_.c_str(), filled,
                 "################################", kBarWidth - filled, "", done_, total_,
                 RemainingText(SecondsSince(started_), done_, total_).c_str());
  }
  std::fflush(stderr);
}

}  // namespace roomtex
