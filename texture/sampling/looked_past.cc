#include "texture/sampling/looked_past.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include "core/frames.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

constexpr double kFinestCell = 1e-3;    // radians; finer needs more memory than scan and photos
constexpr double kPosesAreOff = 0.015;  // metres, of stations against each other
constexpr double kPiece = 0.06;         // metres: shadows are cut no finer

using Corners = std::array<Eigen::Vector3d, 3>;

// Collects triangles in tiles.
class TileWriter {
 public:
  explicit TileWriter(std::vector<MeshTile>* tiles) : tiles_(*tiles) {}

  void Add(const Corners& corners) {
    if (tiles_.empty() || tiles_.back().triangles.size() >= kPerTile || is_far(corners)) {
      tiles_.emplace_back();
      tiles_.back().points.origin = corners[0];
    }
    MeshTile& tile = tiles_.back();
    const auto first = static_cast<uint16_t>(tile.points.size());
    for (const Eigen::Vector3d& corner : corners) tile.points.Add(corner);
    tile.triangles.push_back(
        {first, static_cast<uint16_t>(first + 1), static_cast<uint16_t>(first + 2)});
  }

 private:
  static constexpr size_t kPerTile = 2048;
  static constexpr double kWidest = 1.5;  // metres: photos skip tiles that they do not see

  bool is_far(const Corners& corners) const {
    return (corners[0] - tiles_.back().points.origin).norm() > kWidest;
  }

  std::vector<MeshTile>& tiles_;
};

}  // namespace

LookedPast::LookedPast(const Scan& scan, double angular_spacing, double range_noise)
    : station_(scan.Station()),
      cell_(std::max(kFinestCell, 2 * angular_spacing)),
      tolerance_(kPosesAreOff + 3 * range_noise),
      first_({0}) {
  const int rows = std::max(1, static_cast<int>(std::ceil(kPi / cell_)));
  for (int row = 0; row < rows; ++row) {
    const double around = 2 * kPi * std::sin((row + 0.5) * kPi / rows);
    first_.push_back(first_.back() + std::max(1, static_cast<int>(around / cell_)));
  }
  nearest_.assign(first_.back(), 0.0f);
  cell_ = kPi / rows;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (scan.IsMissing(static_cast<int>(i))) continue;
    const Eigen::Vector3d way = scan.points[i] - station_;
    const double range = way.norm();
    if (!(range > 0)) continue;
    const int row = std::min(rows - 1, static_cast<int>(std::acos(way.z() / range) / cell_));
    float& nearest = nearest_[CellOf(row, std::atan2(way.y(), way.x()), 0)];
    if (nearest == 0 || range < nearest) nearest = static_cast<float>(range);
  }
}

// step: so many cells on in the row.
int LookedPast::CellOf(int row, double azimuth, int step) const {
  const int count = first_[row + 1] - first_[row];
  const auto column = static_cast<int>((azimuth / (2 * kPi) + 0.5) * count);
  return first_[row] + (std::clamp(column, 0, count - 1) + step + count) % count;
}

bool LookedPast::operator()(const Eigen::Vector3d& x_in_scan) const {
  const Eigen::Vector3d way = x_in_scan - station_;
  const double range = way.norm();
  if (!(range > 0)) return true;
  const int rows = static_cast<int>(first_.size()) - 1;
  const int middle = std::min(rows - 1, static_cast<int>(std::acos(way.z() / range) / cell_));
  const double azimuth = std::atan2(way.y(), way.x());
  for (int row = std::max(0, middle - 1); row <= std::min(rows - 1, middle + 1); ++row) {
    for (const int step : {-1, 0, 1}) {
      if (nearest_[CellOf(row, azimuth, step)] < range + tolerance_) return false;
    }
  }
  return true;
}

// What is left of the shadows of one station.
class ShadowsOfStations::Cutter {
 public:
  Cutter(const std::vector<Station>& stations, size_t own) : stations_(stations), own_(own) {}

  std::vector<MeshTile> Cut(const std::vector<MeshTile>& tiles) const {
    return Filter(tiles, [this](const Corners& corners, TileWriter* writer) {
      if (CutTriangle(corners, writer)) writer->Add(corners);
    });
  }
  // These are as small as a sample.
  std::vector<MeshTile> Pick(const std::vector<MeshTile>& tiles) const {
    return Filter(tiles, [this](const Corners& corners, TileWriter* writer) {
      if (!IsSeen((corners[0] + corners[1] + corners[2]) / 3)) writer->Add(corners);
    });
  }

 private:
  template <typename Take>
  static std::vector<MeshTile> Filter(const std::vector<MeshTile>& tiles, const Take& take) {
    std::vector<MeshTile> left;
    TileWriter writer(&left);
    for (const MeshTile& tile : tiles) {
      const auto corner = [&tile](int i) -> Eigen::Vector3d {
        return tile.points.origin +
               Eigen::Vector3d(tile.points.x[i], tile.points.y[i], tile.points.z[i]);
      };
      for (const auto& [a, b, c] : tile.triangles) {
        take({corner(a), corner(b), corner(c)}, &writer);
      }
    }
    return left;
  }

  bool IsSeen(const Eigen::Vector3d& x) const {
    for (size_t i = 0; i < stations_.size(); ++i) {
      if (i != own_ && stations_[i].looked_past(x)) return true;
    }
    return false;
  }

  // True where all of the triangle is left; parts of it that are, are written otherwise. Halves the
  // longest side until pieces are small.
  bool CutTriangle(const Corners& t, TileWriter* writer) const {
    int longest = 0;
    double length = 0;
    for (int k = 0; k < 3; ++k) {
      const double side = (t[(k + 1) % 3] - t[k]).norm();
      if (side > length) {
        length = side;
        longest = k;
      }
    }
    if (!(length > kPiece)) return !IsSeen((t[0] + t[1] + t[2]) / 3);
    const Eigen::Vector3d &a = t[longest], &b = t[(longest + 1) % 3], &c = t[(longest + 2) % 3];
    const Eigen::Vector3d middle = (a + b) / 2;
    const Corners first = {a, middle, c}, second = {middle, b, c};
    const bool is_first = CutTriangle(first, writer), is_second = CutTriangle(second, writer);
    if (is_first && is_second) return true;
    if (is_first) writer->Add(first);
    if (is_second) writer->Add(second);
    return false;
  }

  const std::vector<Station>& stations_;
  size_t own_;
};

void ShadowsOfStations::Take(const Scan& grid, double angular_spacing, double range_noise,
                             OccluderTiles* tiles) {
  stations_.push_back({LookedPast(grid, angular_spacing, range_noise), std::move(tiles->shadows),
                       std::move(tiles->fringes)});
  tiles->shadows.clear();
  tiles->fringes.clear();
}

void ShadowsOfStations::Give(OccluderTiles* tiles, int num_threads) {
  const auto count = static_cast<int>(stations_.size());
  std::vector<std::vector<MeshTile>> shadows(stations_.size()), fringes(stations_.size());
  ParallelFor(num_threads, 0, count, [&](int i) {
    const Cutter cutter(stations_, i);
    shadows[i] = count < 2 ? std::move(stations_[i].shadows) : cutter.Cut(stations_[i].shadows);
    fringes[i] = count < 2 ? std::move(stations_[i].fringes) : cutter.Pick(stations_[i].fringes);
  });
  const auto add = [](std::vector<MeshTile>* from, std::vector<MeshTile>* to) {
    std::move(from->begin(), from->end(), std::back_inserter(*to));
  };
  for (int i = 0; i < count; ++i) {
    add(&shadows[i], &tiles->shadows);
    add(&fringes[i], &tiles->fringes);
  }
  stations_.clear();
}

}  // namespace roomtex
