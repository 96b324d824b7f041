// WriteScanPlanes: the planes in colour, for a look.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "align/surface/scan_planes.h"
#include "core/output_file.h"
#include "core/parallel.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr uint8_t kGrey = 128;

using Rgb = std::array<uint8_t, 3>;

// Hues by the golden ratio, three brightnesses: neighbours in the list never look alike.
Rgb PlaneColor(int plane) {
  const double hue = std::fmod(0.05 + 0.618033988749895 * plane, 1.0);
  const double value = 1.0 - 0.22 * (plane / 2 % 3);
  const double saturation = plane % 3 == 2 ? 0.55 : 0.9;
  Rgb color;
  for (int k = 0; k < 3; ++k) {
    const double place = std::fmod(6 * hue + (k == 0 ? 5 : k == 1 ? 3 : 1), 6.0);
    const double share = std::clamp(std::min(place, 4 - place), 0.0, 1.0);
    color[k] = static_cast<uint8_t>(std::lround(255 * value * (1 - saturation * share)));
  }
  return color;
}

// The plane that a point of the scan lies on: within its noise, where it has samples, facing the
// station; the nearest of several.
int PlaneOf(const Eigen::Vector3d& x, const Eigen::Vector3d& station,
            const std::vector<ScanPlane>& planes) {
  int best = -1;
  double least = 3.5;  // standard deviations
  for (size_t k = 0; k < planes.size(); ++k) {
    const ScanPlane& plane = planes[k];
    const double deviations = std::abs(plane.Distance(x)) / std::max(plane.rms, 1e-4);
    if (!(deviations < least) || plane.normal.dot(station - x) < 0 || !plane.Covers(x)) continue;
    least = deviations;
    best = static_cast<int>(k);
  }
  return best;
}

template <typename T>
void Append(T value, std::string* bytes) {
  char buffer[sizeof(T)];
  std::memcpy(buffer, &value, sizeof(T));
  bytes->append(buffer, sizeof(T));
}

std::string RowBytes(const Scan& scan, int row, const Eigen::Vector3d& shift,
                     const std::vector<ScanPlane>& planes) {
  std::string bytes;
  for (int column = 0; column < scan.num_columns; ++column) {
    const int index = scan.Index(column, row);
    if (scan.IsMissing(index)) continue;
    const Eigen::Vector3d& x = scan.points[index];
    const int plane = PlaneOf(x, scan.Station(), planes);
    const Rgb color = plane < 0 ? Rgb{kGrey, kGrey, kGrey} : PlaneColor(plane);
    const Eigen::Vector3d normal =
        plane < 0 ? Eigen::Vector3d(0, 0, 0) : planes[static_cast<size_t>(plane)].normal;
    for (double value : (x - shift).eval()) Append(static_cast<float>(value), &bytes);
    for (uint8_t value : color) Append(value, &bytes);
    for (double value : normal) Append(static_cast<float>(value), &bytes);
    Append(static_cast<int32_t>(plane), &bytes);
  }
  return bytes;
}

}  // namespace

void WriteScanPlanes(const std::string& path, const std::vector<Scan>& scans,
                     const std::vector<ScanPlane>& planes, int num_threads,
                     const Eigen::Vector3d& origin) {
  std::vector<std::vector<std::string>> rows;
  size_t count = 0;
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  if (!scans.empty()) {
    const Bounds bounds = FindBounds(scans[0]);
    const Eigen::Vector3d middle = (bounds.min + bounds.max) / 2;
    if (middle.cwiseAbs().maxCoeff() > kLargeCoordinate) shift = middle.array().round();
  }
  for (const Scan& scan : scans) {
    rows.emplace_back(scan.num_rows);
    ParallelFor(num_threads, 0, scan.num_rows,
                [&](int row) { rows.back()[row] = RowBytes(scan, row, shift, planes); });
    count += scan.points.size() - scan.NumMissing();
  }
  OutputFile file(path);
  std::ostream& header = file.stream();
  header << "ply\nformat binary_little_endian 1.0\n"
         << "comment planes of the scan by roomtex-align; plane = index in alignment.json, -1 = "
            "none\n";
  const Eigen::Vector3d add = shift + origin;
  if (!add.isZero()) {
    header << "comment add " << Significant(add.x(), 12) << " " << Significant(add.y(), 12) << " "
           << Significant(add.z(), 12) << " for the scan frame\n";
  }
  header << "element vertex " << count << "\n";
  for (const char* name : {"x", "y", "z"}) header << "property float " << name << "\n";
  for (const char* name : {"red", "green", "blue"}) header << "property uchar " << name << "\n";
  for (const char* name : {"nx", "ny", "nz"}) header << "property float " << name << "\n";
  header << "property int plane\nend_header\n";
  for (const auto& of_scan : rows) {
    for (const std::string& bytes : of_scan) file.stream() << bytes;
  }
  file.Commit();
}

}  // namespace roomtex
