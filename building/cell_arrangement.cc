#include "building/cell_arrangement.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "core/frames.h"

namespace roomtex {
namespace {

using EdgeKey = std::pair<int, int>;
EdgeKey KeyOf(int a, int b) { return {std::min(a, b), std::max(a, b)}; }

class CellCutter {
 public:
  explicit CellCutter(CellArrangement* arrangement) : a_(*arrangement) {}

  // Whole cells, those that the line passes between `from` and `to`, lengths along its direction.
  void Cut(const Line2& line, int id, double epsilon,
           double from = -std::numeric_limits<double>::infinity(),
           double to = std::numeric_limits<double>::infinity()) {
    const bool is_whole = std::isinf(from) && std::isinf(to);
    distances_.clear();
    for (const Eigen::Vector2d& x : a_.vertices) {
      const double d = line.SignedDistance(x);
      distances_.push_back(std::abs(d) <= epsilon ? 0 : d);
    }
    crossings_.clear();
    const size_t num_cells = a_.cells.size();
    for (size_t i = 0; i < num_cells; ++i) {
      std::vector<int> left, right;
      if (is_whole || Passes(line, a_.cells[i], from - epsilon, to + epsilon)) {
        Split(a_.cells[i], &left, &right);
      }
      if (left.size() < 3 || right.size() < 3) {
        NameEdges(a_.cells[i], id);
        continue;
      }
      NameEdges(left, id);
      a_.cells[i] = left;
      a_.cells.push_back(right);
    }
    if (!is_whole) AddCorners();
  }

 private:
  // The line meets the cell between `from` and `to`. Where it only touches it there, to cut it as
  // well does no harm.
  bool Passes(const Line2& line, const std::vector<int>& cell, double from, double to) const {
    const Eigen::Vector2d along = line.Direction();
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (size_t k = 0; k < cell.size(); ++k) {
      const int v = cell[k], next = cell[(k + 1) % cell.size()];
      const double d = distances_[v], d_next = distances_[next];
      if (d != 0 && d * d_next >= 0) continue;
      const Eigen::Vector2d& a = a_.vertices[v];
      const double share = d == 0 ? 0 : d / (d - d_next);
      const double at = along.dot(a + share * (a_.vertices[next] - a));
      low = std::min(low, at);
      high = std::max(high, at);
    }
    return low < to && high > from;
  }

  // Cells that were not cut get the corners that the cuts beside them have put on their edges, so
  // that cells still share whole edges.
  void AddCorners() {
    if (crossings_.empty()) return;
    for (std::vector<int>& cell : a_.cells) {
      for (size_t k = 0; k < cell.size(); ++k) {
        const int v = cell[k], next = cell[(k + 1) % cell.size()];
        if (distances_[v] * distances_[next] >= 0) continue;
        const auto crossing = crossings_.find(KeyOf(v, next));
        if (crossing == crossings_.end()) continue;
        cell.insert(cell.begin() + static_cast<std::ptrdiff_t>(k) + 1, crossing->second);
      }
    }
  }

  void Split(const std::vector<int>& cell, std::vector<int>* left, std::vector<int>* right) {
    bool any_left = false, any_right = false;
    for (const int v : cell) {
      any_left |= distances_[v] > 0;
      any_right |= distances_[v] < 0;
    }
    if (!any_left || !any_right) return;
    for (size_t k = 0; k < cell.size(); ++k) {
      const int v = cell[k], next = cell[(k + 1) % cell.size()];
      if (distances_[v] >= 0) left->push_back(v);
      if (distances_[v] <= 0) right->push_back(v);
      if (distances_[v] * distances_[next] >= 0) continue;
      const int crossing = Crossing(v, next);
      left->push_back(crossing);
      right->push_back(crossing);
    }
  }

  // One vertex per edge, whichever cell asks first.
  int Crossing(int from, int to) {
    const EdgeKey key = KeyOf(from, to);
    const auto [at, is_new] = crossings_.emplace(key, static_cast<int>(a_.vertices.size()));
    if (!is_new) return at->second;
    const auto& [a, b] = key;
    const double share = distances_[a] / (distances_[a] - distances_[b]);
    a_.vertices.push_back(a_.vertices[a] + share * (a_.vertices[b] - a_.vertices[a]));
    distances_.push_back(0);
    const auto line = a_.edge_lines.find(key);
    const int edge_line = line == a_.edge_lines.end() ? -1 : line->second;
    a_.edge_lines[KeyOf(a, at->second)] = edge_line;
    a_.edge_lines[KeyOf(at->second, b)] = edge_line;
    return at->second;
  }

  // Edges along the line that no other line has named.
  void NameEdges(const std::vector<int>& cell, int id) {
    for (size_t k = 0; k < cell.size(); ++k) {
      const int v = cell[k], next = cell[(k + 1) % cell.size()];
      if (distances_[v] != 0 || distances_[next] != 0) continue;
      const auto [at, is_new] = a_.edge_lines.emplace(KeyOf(v, next), id);
      if (!is_new && at->second < 0) at->second = id;
    }
  }

  CellArrangement& a_;
  std::vector<double> distances_;  // of every vertex from the line, 0 = on it
  std::map<EdgeKey, int> crossings_;
};

}  // namespace

Line2 Line2::Through(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d along = (b - a).normalized();
  Line2 line;
  line.normal = {along.y(), -along.x()};
  line.offset = line.normal.dot(0.5 * (a + b));
  return line;
}

Eigen::Vector2d CellArrangement::CentreOf(int cell) const {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const int v : cells[cell]) sum += vertices[v];
  return sum / static_cast<double>(cells[cell].size());
}

double CellArrangement::AreaOf(int cell) const {
  std::vector<Eigen::Vector2d> polygon;
  for (const int v : cells[cell]) polygon.push_back(vertices[v]);
  return PolygonArea(polygon);
}

namespace {

CellArrangement OneCell(const Eigen::AlignedBox2d& box) {
  CellArrangement arrangement;
  const Eigen::Vector2d low = box.min(), high = box.max();
  arrangement.vertices = {low, {high.x(), low.y()}, high, {low.x(), high.y()}};
  arrangement.cells = {{0, 1, 2, 3}};
  for (int k = 0; k < 4; ++k) arrangement.edge_lines[KeyOf(k, (k + 1) % 4)] = -1;
  return arrangement;
}

}  // namespace

CellArrangement ArrangeCells(const Eigen::AlignedBox2d& box, const std::vector<Line2>& lines,
                             double epsilon) {
  CellArrangement arrangement = OneCell(box);
  CellCutter cutter(&arrangement);
  for (size_t i = 0; i < lines.size(); ++i) cutter.Cut(lines[i], static_cast<int>(i), epsilon);
  return arrangement;
}

CellArrangement ArrangeInside(const std::vector<Eigen::Vector2d>& polygon,
                              const std::vector<Line2>& lines, double epsilon) {
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector2d& corner : polygon) box.extend(corner);
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(0.1 * box.diagonal().norm());
  CellArrangement arrangement = OneCell({box.min() - margin, box.max() + margin});
  CellCutter cutter(&arrangement);
  int id = 0;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    const Line2 line = Line2::Through(a, b);
    cutter.Cut(line, id++, epsilon, line.Direction().dot(a), line.Direction().dot(b));
  }
  std::vector<std::vector<int>> inside;
  for (size_t i = 0; i < arrangement.cells.size(); ++i) {
    if (IsInside(polygon, arrangement.CentreOf(static_cast<int>(i)))) {
      inside.push_back(arrangement.cells[i]);
    }
  }
  arrangement.cells = std::move(inside);
  for (const Line2& line : lines) cutter.Cut(line, id++, epsilon);
  return arrangement;
}

std::vector<std::vector<int>> OutlinesOf(const CellArrangement& arrangement,
                                         const std::vector<int>& labels, int label) {
  std::set<EdgeKey> edges;
  for (size_t i = 0; i < arrangement.cells.size(); ++i) {
    if (labels[i] != label) continue;
    const std::vector<int>& cell = arrangement.cells[i];
    for (size_t k = 0; k < cell.size(); ++k) {
      const int v = cell[k], next = cell[(k + 1) % cell.size()];
      if (edges.erase({next, v}) == 0) edges.emplace(v, next);
    }
  }
  const auto angle_of = [&](int from, int to) {
    const Eigen::Vector2d d = arrangement.vertices[to] - arrangement.vertices[from];
    return std::atan2(d.y(), d.x());
  };
  std::vector<std::vector<int>> loops;
  while (!edges.empty()) {
    const int start = edges.begin()->first;
    int v = edges.begin()->second;
    std::vector<int> loop = {start};
    edges.erase(edges.begin());
    while (v != start) {
      // The first edge clockwise from where we came: the same corner of the union.
      const double back = angle_of(v, loop.back());
      double best_turn = 10;
      auto best = edges.end();
      for (auto edge = edges.lower_bound({v, -1}); edge != edges.end() && edge->first == v;
           ++edge) {
        double turn = back - angle_of(v, edge->second);
        while (turn <= 1e-12) turn += 2 * kPi;
        if (turn < best_turn) best_turn = turn, best = edge;
      }
      loop.push_back(v);
      if (best == edges.end()) break;  // cannot be: every vertex is left as often as it is reached
      v = best->second;
      edges.erase(best);
    }
    loops.push_back(loop);
  }
  return loops;
}

double PolygonArea(const std::vector<Eigen::Vector2d>& polygon) {
  if (polygon.empty()) return 0;
  double twice = 0;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d a = polygon[i] - polygon[0];
    const Eigen::Vector2d b = polygon[(i + 1) % polygon.size()] - polygon[0];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return twice / 2;
}

bool IsInside(const std::vector<Eigen::Vector2d>& polygon, const Eigen::Vector2d& x) {
  bool inside = false;
  for (size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
    const Eigen::Vector2d &a = polygon[i], &b = polygon[j];
    if ((a.y() > x.y()) == (b.y() > x.y())) continue;
    inside ^= x.x() < (b.x() - a.x()) * (x.y() - a.y()) / (b.y() - a.y()) + a.x();
  }
  return inside;
}

}  // namespace roomtex
