#include "importers/e57_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/frames.h"
#include "core/text.h"
#include "importers/e57_records.h"

namespace roomtex {
namespace {

// A grid has at most this many cells per record: memory follows the records. A scan of the sky has
// fewer.
constexpr double kMostCellsPerRecord = 64;
constexpr double kSmallGrid = 1 << 16;  // cells that are always fine

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -low;

  // NaN is no index.
  void Add(const double* values, int64_t count) {
    for (int64_t i = 0; i < count; ++i) {
      low = std::min(low, values[i]);
      high = std::max(high, values[i]);
    }
  }
  bool Holds(const Range& other) const { return low <= other.low && high >= other.high; }
  double Count() const { return high - low + 1; }
};

double MostCells(int64_t num_records) {
  return std::min(std::max(kSmallGrid, kMostCellsPerRecord * static_cast<double>(num_records)),
                  static_cast<double>(std::numeric_limits<int>::max()));
}

std::string SizeText(const Range& columns, const Range& rows) {
  return Number(columns.Count(), 0) + " columns x " + Number(rows.Count(), 0) + " rows";
}

// The values that occur, in order. Sorted now and then, so that they take no more room than those.
class Occurring {
 public:
  void Add(const double* values, int64_t count) {
    std::copy_if(values, values + count, std::back_inserter(values_),
                 [](double value) { return std::isfinite(value); });
    if (values_.size() > 2 * num_distinct_ + (1 << 16)) Sort();
  }
  std::vector<double> Take() {
    Sort();
    return std::move(values_);
  }

 private:
  void Sort() {
    std::sort(values_.begin(), values_.end());
    values_.erase(std::unique(values_.begin(), values_.end()), values_.end());
    num_distinct_ = values_.size();
  }
  std::vector<double> values_;
  size_t num_distinct_ = 0;
};

}  // namespace

int E57Grid::Axis::Of(double index) const {
  if (indices.empty()) {
    return index >= first && index < first + count ? static_cast<int>(index - first) : -1;
  }
  const auto at = std::lower_bound(indices.begin(), indices.end(), index);
  return at != indices.end() && *at == index ? static_cast<int>(at - indices.begin()) : -1;
}

std::optional<E57Grid> E57Grid::Find(const E57Pages& pages, const E57Scan& scan,
                                     std::vector<std::string>* notes) {
  const std::vector<int> wanted = {scan.points.Find("rowIndex"), scan.points.Find("columnIndex")};
  Range rows, columns;
  E57Records records(pages, scan.points, wanted);
  while (const int64_t count = records.Next()) {
    rows.Add(records.Values(0), count);
    columns.Add(records.Values(1), count);
  }
  const double most_cells = MostCells(records.num_records());
  const auto is_fine = [&](double num_rows, double num_columns) {
    return num_rows >= 1 && num_columns >= 1 && num_rows * num_columns <= most_cells;
  };
  if (scan.index_bounds) {
    const E57Scan::IndexBounds& b = *scan.index_bounds;
    const Range said_rows{static_cast<double>(b.first_row), static_cast<double>(b.last_row)};
    const Range said_columns{static_cast<double>(b.first_column),
                             static_cast<double>(b.last_column)};
    if (!said_rows.Holds(rows) || !said_columns.Holds(columns)) {
      notes->push_back("the scan " + Quoted(scan.name) + " has points beyond its indexBounds of " +
                       SizeText(said_columns, said_rows) + ": it is read with " +
                       SizeText(columns, rows));
    } else if (is_fine(said_rows.Count(), said_columns.Count())) {
      rows = said_rows;
      columns = said_columns;
    }
  }
  E57Grid grid;
  if (is_fine(rows.Count(), columns.Count())) {
    grid.rows_ = {rows.low, static_cast<int>(rows.Count()), {}};
    grid.columns_ = {columns.low, static_cast<int>(columns.Count()), {}};
    return grid;
  }
  Occurring some_rows, some_columns;
  E57Records again(pages, scan.points, wanted);
  while (const int64_t count = again.Next()) {
    some_rows.Add(again.Values(0), count);
    some_columns.Add(again.Values(1), count);
  }
  grid.rows_.indices = some_rows.Take();
  grid.columns_.indices = some_columns.Take();
  for (Axis* axis : {&grid.rows_, &grid.columns_}) {
    axis->count = static_cast<int>(std::min<size_t>(axis->indices.size(), 1 << 30));
  }
  if (!is_fine(grid.num_rows(), grid.num_columns())) {
    notes->push_back("the scan " + Quoted(scan.name) + " fills almost nothing of its grid of " +
                     SizeText(columns, rows) + ": it is read as a cloud without a grid");
    return std::nullopt;
  }
  notes->push_back("the scan " + Quoted(scan.name) + " fills almost nothing of its grid of " +
                   SizeText(columns, rows) + ": rows and columns without a point are left out");
  return grid;
}

namespace {

// How the angles change from cell to cell, summed over the grid.
struct Steps {
  double elevation = 0;                         // with sign
  double elevation_size = 0, azimuth_size = 0;  // without; on the unit sphere

  void Add(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    const double from = std::atan2(a.z(), std::hypot(a.x(), a.y()));
    const double to = std::atan2(b.z(), std::hypot(b.x(), b.y()));
    const double turn =
        std::remainder(std::atan2(b.y(), b.x()) - std::atan2(a.y(), a.x()), 2 * kPi);
    elevation += to - from;
    elevation_size += std::abs(to - from);
    azimuth_size += std::abs(turn) * std::cos(from);
  }
};

void Transpose(Scan* scan) {
  std::vector<Eigen::Vector3d> points(scan->points.size());
  std::vector<float> intensity(points.size());
  CellColors colors(scan->colors.size());
  for (int row = 0; row < scan->num_rows; ++row) {
    for (int column = 0; column < scan->num_columns; ++column) {
      const size_t to = static_cast<size_t>(column) * scan->num_rows + row;
      points[to] = scan->points[scan->Index(column, row)];
      intensity[to] = scan->intensity[scan->Index(column, row)];
      if (!colors.empty()) colors[to] = scan->colors[scan->Index(column, row)];
    }
  }
  scan->points = std::move(points);
  scan->intensity = std::move(intensity);
  scan->colors = std::move(colors);
  std::swap(scan->num_rows, scan->num_columns);
}

void TurnRowsRound(Scan* scan) {
  for (int row = 0; row < scan->num_rows / 2; ++row) {
    const int other = scan->num_rows - 1 - row;
    const auto swap_row = [&](auto* values) {
      std::swap_ranges(values->begin() + scan->Index(0, row),
                       values->begin() + scan->Index(0, row) + scan->num_columns,
                       values->begin() + scan->Index(0, other));
    };
    swap_row(&scan->points);
    swap_row(&scan->intensity);
    if (!scan->colors.empty()) swap_row(&scan->colors);
  }
}

}  // namespace

void StandUpright(Scan* scan) {
  const Rigid station_from_scan = scan->scan_from_station.Inverse();
  Steps down, across;  // from row to row, from column to column
  const double cells = static_cast<double>(scan->num_columns) * scan->num_rows;
  const int every = std::max(1, static_cast<int>(std::sqrt(cells / 1e5)));
  for (int row = 0; row < scan->num_rows; row += every) {
    for (int column = 0; column < scan->num_columns; column += every) {
      const int cell = scan->Index(column, row);
      if (scan->IsMissing(cell)) continue;
      const Eigen::Vector3d here = station_from_scan * scan->points[cell];
      const auto add = [&](bool inside, int other, Steps* steps) {
        if (!inside || scan->IsMissing(other)) return;
        steps->Add(here, station_from_scan * scan->points[other]);
      };
      add(row + 1 < scan->num_rows, cell + scan->num_columns, &down);
      add(column + 1 < scan->num_columns, cell + 1, &across);
    }
  }
  if (down.azimuth_size > down.elevation_size && across.elevation_size > across.azimuth_size) {
    Transpose(scan);
    std::swap(down, across);
  }
  if (down.elevation > 0) TurnRowsRound(scan);
}

}  // namespace roomtex
