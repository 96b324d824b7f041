#pragma once
// RTPI files byte by byte, written without a look at the writer under test.

#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace roomtex {

struct RawSample {
  float range, theta, phi;
  uint32_t value;
};
using RawColumns = std::vector<std::vector<RawSample>>;

inline void AppendWord(uint32_t bits, bool big, std::string* bytes) {
  for (int i = 0; i < 4; ++i) *bytes += static_cast<char>(bits >> (big ? 24 - 8 * i : 8 * i));
}
inline void AppendFloat(float number, bool big, std::string* bytes) {
  uint32_t bits;
  std::memcpy(&bits, &number, 4);
  AppendWord(bits, big, bytes);
}

inline std::string RtpiBody(const RawColumns& columns, bool big, bool has_color = false) {
  std::string bytes;
  for (const auto& column : columns) {
    AppendWord(static_cast<uint32_t>(column.size()), big, &bytes);
    for (const RawSample& sample : column) {
      AppendFloat(sample.range, big, &bytes);
      AppendFloat(sample.theta, big, &bytes);
      AppendFloat(sample.phi, big, &bytes);
      AppendWord(sample.value, big && !has_color, &bytes);  // colours are four single bytes
    }
  }
  return bytes;
}

// `extra` lines stand among the scan parameters, each with its newline.
inline std::string Rtpi3Header(size_t num_columns, size_t max_samples,
                               const std::string& extra = "", const std::string& units = "meters") {
  return "RTPI_version_3.0\n# --begin_header--\n# model: deltaSphere3000\n# serverVersion 1.0.5\n"
         "# --begin_scan_parameters--\n# num_columns: " +
         std::to_string(num_columns) +
         "\n# max_samples_per_column: " + std::to_string(max_samples) +
         "\n# has_color: no\n# units: " + units + "\n" + extra +
         "# --begin_comments--\n# any text\n# --end_header--\n";
}

inline constexpr double kDegree = 3.14159265358979323846 / 180;

// A full grid: theta 2 degrees a column from -10, phi 1 degree a row from -5 (first) upwards;
// ranges and intensities differ from sample to sample.
inline RawColumns MakeColumns(int num_columns, int num_rows) {
  RawColumns columns(num_columns);
  for (int c = 0; c < num_columns; ++c) {
    for (int k = 0; k < num_rows; ++k) {
      columns[c].push_back({2.0f + 0.01f * static_cast<float>(c) + 0.001f * static_cast<float>(k),
                            static_cast<float>((-10 + 2 * c) * kDegree),
                            static_cast<float>((-5 + k) * kDegree),
                            static_cast<uint32_t>(100 * c + k)});
    }
  }
  return columns;
}

}  // namespace roomtex
