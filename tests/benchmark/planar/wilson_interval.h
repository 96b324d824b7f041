#pragma once
// Shares with their uncertainty, as the tables print them.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

namespace roomtex {

struct Interval {
  double low = 0, high = 1;
};

// 95 % score interval of a share (Wilson 1927): honest also where all or none of the sets are
// right.
inline Interval WilsonInterval(int count, int of) {
  if (of == 0) return {};
  constexpr double z = 1.959964;
  const double n = of, p = count / n, z2 = z * z;
  const double middle = (p + z2 / (2 * n)) / (1 + z2 / n);
  const double half = z / (1 + z2 / n) * std::sqrt(p * (1 - p) / n + z2 / (4 * n * n));
  return {std::max(0.0, middle - half), std::min(1.0, middle + half)};
}

// "97.5 % (95.2-98.8)"
inline std::string ShareText(int count, int of) {
  if (of == 0) return "-";
  const Interval interval = WilsonInterval(count, of);
  char text[64];
  std::snprintf(text, sizeof(text), "%.1f %% (%.1f-%.1f)", 100.0 * count / of, 100 * interval.low,
                100 * interval.high);
  return text;
}

}  // namespace roomtex
