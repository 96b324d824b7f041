#include "workflow/remaining_time.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/text.h"

namespace roomtex {
namespace {

constexpr double kLeastShare = 0.02;  // of a step, before its own pace is believed
constexpr double kMaxFactor = 20;

}  // namespace

void RemainingTime::SetSteps(const std::vector<std::string>& steps,
                             const std::map<std::string, double>& seconds_last_time) {
  steps_ = steps;
  last_time_ = seconds_last_time;
}

// Seconds on two processor cores, from a simulated room of 12 to 30 photos of 0.3 to 2.5
// megapixels; only their relation counts once a step has run.
double RemainingTime::Guess(const std::string& step) const {
  const double pixels = num_photos_ * megapixels_;
  const double seen = std::min(megapixels_, 10.0);  // COLMAP makes larger photos smaller
  const double pairs = num_photos_ * (num_photos_ - 1) / 2;
  const double features = std::min(8.0, 4 + 2 * seen);  // thousands
  if (step == "features") return 1 + num_photos_ * (0.2 + 0.6 * seen);
  if (step == "matches") return 1 + 0.01 * pairs * features * features;
  if (step == "mapper") return 1 + 0.12 * num_photos_ * std::sqrt(num_photos_);
  if (step == "align") return 4 + 0.25 * num_photos_;
  if (step == "texture") return 5 + 0.5 * pixels;
  if (step == "pictures") return 8;
  if (step == "report") return 2;
  return 1 + 0.3 * pixels;
}

double RemainingTime::Expected(const std::string& step) const {
  const auto known = last_time_.find(step);
  if (known != last_time_.end()) return known->second;
  const double factor =
      guessed_ > 0 ? std::clamp(taken_ / guessed_, 1 / kMaxFactor, kMaxFactor) : 1.0;
  return factor * Guess(step);
}

void RemainingTime::Finish(const std::string& step, double seconds) {
  guessed_ += Guess(step);
  taken_ += seconds;
  Drop(step);
}

void RemainingTime::Drop(const std::string& step) {
  steps_.erase(std::remove(steps_.begin(), steps_.end(), step), steps_.end());
}

double RemainingTime::Seconds(const std::string& running, double share, double elapsed) const {
  double seconds = 0;
  for (const std::string& step : steps_) {
    const double expected = Expected(step);
    if (step != running) {
      seconds += expected;
    } else if (share > kLeastShare) {
      seconds += elapsed * (1 - share) / share;
    } else {
      seconds += std::max(expected - elapsed, 0.1 * elapsed);
    }
  }
  return seconds;
}

std::string DurationText(double seconds) {
  if (seconds < 90) return Number(std::max(seconds, 1.0), 0) + " s";
  if (seconds < 5400) return Number(seconds / 60, 0) + " min";
  return Number(seconds / 3600, 1) + " h";
}

double ShareOfLine(const std::string& line) {
  const size_t bracket = line.find('[');
  if (bracket == std::string::npos) return -1;
  const bool is_block = BeginsWith(line, "Matching block");
  const bool is_model = BeginsWith(line, "  sparse model [");
  const bool is_counted = is_block || is_model || BeginsWith(line, "Processed file") ||
                          line.find("] Processed file") != std::string::npos ||
                          BeginsWith(line, "Matching image") ||
                          line.find("Matching image [") != std::string::npos ||
                          line.find("Processing image [") != std::string::npos;
  if (!is_counted) return -1;
  int i = 0, n = 0, j = 0, m = 0;
  const char* const numbers = line.c_str() + (is_model ? bracket : line.rfind('['));
  if (std::sscanf(numbers, "[%d/%d, %d/%d]", &i, &n, &j, &m) == 4 && n > 0 && m > 0) {
    // Blocks of a half of the square of pairs count nearly the same.
    return std::clamp((static_cast<double>(i - 1) * m + j) / (static_cast<double>(n) * m), 0.0,
                      1.0);
  }
  if (std::sscanf(numbers, "[%d/%d]", &i, &n) == 2 && n > 0) {
    if (is_model) --i;  // said before, not after
    return std::clamp(static_cast<double>(i) / n, 0.0, 1.0);
  }
  return -1;
}

}  // namespace roomtex
