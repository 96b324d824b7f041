#include "building/footprint_cells.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <Eigen/LU>
#include <opencv2/core.hpp>
#include <opencv2/imgproc/detail/gcgraph.hpp>

#include "core/frames.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr size_t kMaxLines = 70;
constexpr size_t kMaxSights = 40000;

// Squares of the top view: what lies or was seen through there.
class SightGrid {
 public:
  SightGrid(const Eigen::AlignedBox2d& box, double side) : low_(box.min()), side_(side) {
    const Eigen::Vector2d size = box.sizes() / side;
    columns_ = static_cast<int>(std::ceil(size.x())) + 1;
    rows_ = static_cast<int>(std::ceil(size.y())) + 1;
    squares_.resize(static_cast<size_t>(columns_) * static_cast<size_t>(rows_));
  }
  struct Square {
    int ground = 0, free = 0, roof = 0;
    std::map<int, int> by_roof;  // points of each roof segment
  };
  Square* At(const Eigen::Vector2d& x) {
    const Eigen::Vector2d at = (x - low_) / side_;
    if (!(at.x() >= 0 && at.y() >= 0 && at.x() < columns_ && at.y() < rows_)) return nullptr;
    return &squares_[static_cast<size_t>(at.y()) * static_cast<size_t>(columns_) +
                     static_cast<size_t>(at.x())];
  }
  // The squares whose centres lie in a convex polygon.
  template <typename Visit>
  void ForEachIn(const std::vector<Eigen::Vector2d>& polygon, const Visit& visit) const {
    Eigen::AlignedBox2d box;
    for (const Eigen::Vector2d& corner : polygon) box.extend(corner);
    const Eigen::Vector2d low = (box.min() - low_) / side_, high = (box.max() - low_) / side_;
    const int last_column = std::min(columns_ - 1, static_cast<int>(high.x()));
    const int last_row = std::min(rows_ - 1, static_cast<int>(high.y()));
    for (int row = std::max(0, static_cast<int>(low.y())); row <= last_row; ++row) {
      for (int column = std::max(0, static_cast<int>(low.x())); column <= last_column; ++column) {
        const Eigen::Vector2d centre = low_ + side_ * Eigen::Vector2d(column + 0.5, row + 0.5);
        if (!IsInside(polygon, centre)) continue;
        visit(squares_[static_cast<size_t>(row) * static_cast<size_t>(columns_) +
                       static_cast<size_t>(column)]);
      }
    }
  }
  double side() const { return side_; }

 private:
  Eigen::Vector2d low_;
  double side_;
  int columns_ = 0, rows_ = 0;
  std::vector<Square> squares_;
};

class FootprintFinder {
 public:
  FootprintFinder(const OutlineCloud& cloud, const GroundPlane& ground,
                  const std::vector<PlaneSegment>& segments, const std::vector<int>& group,
                  bool right_angles)
      : cloud_(cloud), ground_(ground), segments_(segments) {
    walls_ = FindWallLines(cloud, ground, segments, group, right_angles);
    for (const int s : group) {
      const SegmentRole role = RoleOf(cloud, ground, segments[static_cast<size_t>(s)]);
      if (role == SegmentRole::kRoof) roofs_.push_back(s);
      if (role == SegmentRole::kOther) continue;
      for (const int i : segments[static_cast<size_t>(s)].points) {
        const Eigen::Vector3d& x = cloud.points[static_cast<size_t>(i)];
        box_.extend(x.head<2>());
        heights_.push_back(x.z() - ground.HeightAt(x.head<2>()));
      }
    }
  }

  std::vector<FootprintRegion> Find() {
    if (walls_.empty() && roofs_.empty()) return {};
    AddInferredLines();
    Arrange();
    FillGrid();
    CountEvidence();
    Cut();
    return Regions();
  }

 private:
  // --- lines that close what the walls leave open

  bool HasLineNear(const Line2& line, const Eigen::Vector2d& at) const {
    return std::any_of(walls_.begin(), walls_.end(), [&](const WallLine& wall) {
      return std::abs(wall.line.normal.dot(line.normal)) > std::cos(RadFromDeg(10)) &&
             std::abs(wall.line.SignedDistance(at)) < 0.5 * cloud_.step;
    });
  }
  void AddInferred(const Eigen::Vector2d& normal, const Eigen::Vector2d& at) {
    WallLine wall;
    wall.line.normal = normal;
    wall.line.offset = normal.dot(at);
    if (HasLineNear(wall.line, at)) return;
    wall.inferred = true;
    wall.sigma_offset = 0.25 * cloud_.step;
    wall.sigma_angle = RadFromDeg(1);
    walls_.push_back(wall);
  }

  void AddInferredLines() {
    const size_t num_seen = walls_.size();
    // Where roofs end, along the directions of the walls below them.
    for (const int s : roofs_) {
      const PlaneSegment& roof = segments_[static_cast<size_t>(s)];
      const Eigen::Vector2d centre = roof.plane.centre.head<2>();
      for (const Eigen::Vector2d& n : DirectionsFor(roof, num_seen)) {
        std::vector<double> along;
        for (const int i : roof.points) {
          along.push_back(n.dot(cloud_.points[static_cast<size_t>(i)].head<2>() - centre));
        }
        AddInferred(n, centre + n * Quantile(&along, 0.001));
        AddInferred(n, centre + n * Quantile(&along, 0.999));
      }
    }
    // Where walls end.
    for (size_t i = 0; i < num_seen; ++i) {
      const WallLine wall = walls_[i];
      if (wall.stretches.empty()) continue;
      const Eigen::Vector2d u = wall.line.Direction(), n = wall.line.normal;
      for (const double end : {wall.stretches.front().first, wall.stretches.back().second}) {
        AddInferred(u, n * wall.line.offset + u * end);
      }
    }
    if (walls_.size() > kMaxLines) walls_.resize(kMaxLines);
  }

  // Normals of the walls below a roof, and square to them.
  std::vector<Eigen::Vector2d> DirectionsFor(const PlaneSegment& roof, size_t num_seen) const {
    Eigen::AlignedBox2d box;
    for (const int i : roof.points) {
      box.extend(Eigen::Vector2d(cloud_.points[static_cast<size_t>(i)].head<2>()));
    }
    std::vector<Eigen::Vector2d> normals;
    for (size_t i = 0; i < num_seen; ++i) {
      const WallLine& wall = walls_[i];
      const auto below = std::count_if(wall.points.begin(), wall.points.end(), [&](const auto& x) {
        return box.exteriorDistance(x) < cloud_.step;
      });
      if (2 * static_cast<size_t>(below) > wall.points.size()) normals.push_back(wall.line.normal);
    }
    if (normals.empty()) normals = RoofDirections(roof);
    constexpr size_t kMostDirections = 6;
    std::vector<Eigen::Vector2d> directions;
    for (const Eigen::Vector2d& normal : normals) {
      for (const Eigen::Vector2d& n : {normal, Eigen::Vector2d(-normal.y(), normal.x())}) {
        const bool known =
            std::any_of(directions.begin(), directions.end(), [&](const Eigen::Vector2d& other) {
              return std::abs(other.dot(n)) > std::cos(RadFromDeg(10));
            });
        if (!known && directions.size() < kMostDirections) directions.push_back(n);
      }
    }
    return directions;
  }

  // Without walls: the direction that a roof falls in, or that its points take the least room in.
  std::vector<Eigen::Vector2d> RoofDirections(const PlaneSegment& roof) const {
    const Eigen::Vector2d slope = roof.plane.normal.head<2>();
    if (slope.norm() > 0.1) return {slope.normalized()};
    double best = std::numeric_limits<double>::infinity();
    Eigen::Vector2d best_normal = Eigen::Vector2d::UnitX();
    for (int deg = 0; deg < 90; ++deg) {
      const double angle = RadFromDeg(deg);
      const Eigen::Vector2d n(std::cos(angle), std::sin(angle)), u(-n.y(), n.x());
      std::vector<double> a, b;
      for (const int i : roof.points) {
        a.push_back(n.dot(cloud_.points[static_cast<size_t>(i)].head<2>()));
        b.push_back(u.dot(cloud_.points[static_cast<size_t>(i)].head<2>()));
      }
      const double area =
          (Quantile(a, 0.99) - Quantile(a, 0.01)) * (Quantile(b, 0.99) - Quantile(b, 0.01));
      if (area < best) best = area, best_normal = n;
    }
    return {best_normal};
  }

  // --- cells and what speaks for them

  void Arrange() {
    const double margin = 2 * cloud_.step;
    box_.extend(box_.min() - Eigen::Vector2d::Constant(margin));
    box_.extend(box_.max() + Eigen::Vector2d::Constant(margin));
    std::vector<Line2> lines;
    for (const WallLine& wall : walls_) lines.push_back(wall.line);
    cells_ = ArrangeCells(box_, lines, 1e-6 * cloud_.step);
    polygons_.clear();
    for (const auto& cell : cells_.cells) {
      std::vector<Eigen::Vector2d> polygon;
      for (const int v : cell) polygon.push_back(cells_.vertices[static_cast<size_t>(v)]);
      polygons_.push_back(polygon);
    }
  }

  void FillGrid() {
    constexpr double kMostSquares = 1500;  // along a side
    const double side =
        std::max({1.2 * cloud_.spacing, cloud_.step / 4, box_.sizes().maxCoeff() / kMostSquares});
    grid_ = std::make_unique<SightGrid>(box_, side);
    for (const int s : roofs_) {
      for (const int i : segments_[static_cast<size_t>(s)].points) {
        SightGrid::Square* square = grid_->At(cloud_.points[static_cast<size_t>(i)].head<2>());
        if (square == nullptr) continue;
        ++square->roof;
        ++square->by_roof[s];
      }
    }
    const double near_ground = std::max(2 * PlaneTolerance(cloud_), 0.15 * cloud_.step);
    for (const Eigen::Vector3d& x : cloud_.points) {
      if (std::abs(x.z() - ground_.HeightAt(x.head<2>())) > near_ground) continue;
      if (SightGrid::Square* square = grid_->At(x.head<2>())) ++square->ground;
    }
    AddSights();
  }

  // Between an eye and what it saw there is nothing. Below the walls' tops only: above, nothing
  // stands anyway.
  void AddSights() {
    const double top = Quantile(heights_, 0.5);
    std::vector<int> targets;
    for (const PlaneSegment& segment : segments_) {
      targets.insert(targets.end(), segment.points.begin(), segment.points.end());
    }
    const size_t every = std::max<size_t>(1, targets.size() / kMaxSights);
    for (size_t k = 0; k < targets.size(); k += every) {
      const size_t i = static_cast<size_t>(targets[k]);
      const Eigen::Vector3d &x = cloud_.points[i], &eye = cloud_.eyes[i];
      if (!eye.allFinite()) continue;
      const Eigen::Vector3d way = eye - x;
      const double length = way.head<2>().norm();
      const double pace = 0.7 * grid_->side();
      if (!(length > 4 * pace) || length / pace > 1e5) continue;
      const double start = std::max(2 * grid_->side(), 0.5 * cloud_.step);
      SightGrid::Square* last = nullptr;
      for (double at = start; at < length; at += pace) {
        const Eigen::Vector3d here = x + way * (at / length);
        if (here.z() - ground_.HeightAt(here.head<2>()) > top) break;
        SightGrid::Square* square = grid_->At(here.head<2>());
        if (square == nullptr || square == last) continue;
        ++square->free;
        last = square;
      }
    }
  }

  void CountEvidence() {
    const size_t n = cells_.cells.size();
    inside_.assign(n, 0), outside_.assign(n, 0);
    by_roof_.assign(n, {});
    const double per_square = grid_->side() * grid_->side() / cloud_.step;
    constexpr double kUnknown = 0.04;  // what nobody sees into is rather a building
    for (size_t c = 0; c < n; ++c) {
      grid_->ForEachIn(polygons_[c], [&](const SightGrid::Square& square) {
        for (const auto& [s, count] : square.by_roof) by_roof_[c][s] += 1;
        if (square.roof > 0) {
          inside_[c] += per_square;
        } else if (square.ground > 0 || square.free > 2) {
          outside_[c] += per_square;
        } else {
          inside_[c] += kUnknown * per_square;
        }
      });
    }
  }

  // --- the cut

  struct CellEdge {
    int left = -1, right = -1;  // cells, as the edge goes from the smaller vertex
  };

  void Cut() {
    std::map<std::pair<int, int>, CellEdge> edges;
    for (size_t c = 0; c < cells_.cells.size(); ++c) {
      const auto& cell = cells_.cells[c];
      for (size_t k = 0; k < cell.size(); ++k) {
        const int a = cell[k], b = cell[(k + 1) % cell.size()];
        CellEdge& edge = edges[{std::min(a, b), std::max(a, b)}];
        (a < b ? edge.left : edge.right) = static_cast<int>(c);
      }
    }
    const size_t n = cells_.cells.size();
    // Sources are inside, sinks outside.
    cv::detail::GCGraph<double> graph(static_cast<unsigned>(n), static_cast<unsigned>(4 * n));
    for (size_t c = 0; c < n; ++c) graph.addVtx();
    constexpr double kForced = 1e6, kAnyEdge = 0.08, kFacing = 0.6, kInferred = 1.3;
    for (const auto& [key, edge] : edges) {
      const Eigen::Vector2d &a = cells_.vertices[static_cast<size_t>(key.first)],
                            &b = cells_.vertices[static_cast<size_t>(key.second)];
      if (edge.left < 0 || edge.right < 0) {
        outside_[static_cast<size_t>(std::max(edge.left, edge.right))] = kForced;
        continue;
      }
      const auto line = cells_.edge_lines.find(key);
      const double length = (b - a).norm();
      double covered = 0, weight = 1;
      if (line != cells_.edge_lines.end() && line->second >= 0) {
        const WallLine& wall = walls_[static_cast<size_t>(line->second)];
        covered = wall.CoveredShare(a, b);
        weight = wall.inferred ? kInferred : 1;
        if (wall.oriented) {
          // The wall was seen from the side its normal points to.
          const size_t left = static_cast<size_t>(edge.left),
                       right = static_cast<size_t>(edge.right);
          const Eigen::Vector2d right_of(b.y() - a.y(), a.x() - b.x());
          const bool faces_right = wall.line.normal.dot(right_of) > 0;
          inside_[faces_right ? left : right] += kFacing * covered * length;
          outside_[faces_right ? right : left] += kFacing * covered * length;
        }
      }
      const double cost = weight * length * (kAnyEdge + (1 - covered));
      graph.addEdges(edge.left, edge.right, cost, cost);
    }
    for (size_t c = 0; c < n; ++c) {
      graph.addTermWeights(static_cast<int>(c), inside_[c], outside_[c]);
    }
    graph.maxFlow();
    labels_.assign(n, -1);
    for (size_t c = 0; c < n; ++c) {
      if (graph.inSourceSegment(static_cast<int>(c))) labels_[c] = 0;
    }
  }

  // --- parts with one roof each

  // Two planes of one roof: where either was seen it is the lower one.
  bool Together(int s, int t) const {
    const auto fits = [this](int seen, int other) {
      const FittedPlane& plane = segments_[static_cast<size_t>(other)].plane;
      const auto& points = segments_[static_cast<size_t>(seen)].points;
      int below = 0;
      for (const int i : points) {
        const Eigen::Vector3d& x = cloud_.points[static_cast<size_t>(i)];
        const double z =
            plane.centre.z() -
            plane.normal.head<2>().dot(x.head<2>() - plane.centre.head<2>()) / plane.normal.z();
        below += x.z() <= z + 2 * PlaneTolerance(cloud_);
      }
      return static_cast<double>(below) > 0.85 * static_cast<double>(points.size());
    };
    return fits(s, t) && fits(t, s);
  }

  // Roofs of the cells with label 0, the largest first: surfaces that fit together. Never empty.
  std::vector<std::vector<int>> FindRoofs() const {
    std::map<int, double> squares;
    double total = 0;
    for (size_t c = 0; c < labels_.size(); ++c) {
      if (labels_[c] < 0) continue;
      for (const auto& [s, count] : by_roof_[c]) squares[s] += count, total += count;
    }
    std::vector<std::pair<double, int>> order;
    for (const auto& [s, count] : squares) order.emplace_back(-count, s);
    std::sort(order.begin(), order.end());
    std::vector<std::vector<int>> roofs;
    for (const auto& [minus_count, surface] : order) {
      const int s = surface;
      const double area = -minus_count * grid_->side() * grid_->side();
      if (-minus_count < 0.04 * total || area < 1.5 * cloud_.step * cloud_.step) continue;
      auto roof = std::find_if(roofs.begin(), roofs.end(), [&](const auto& members) {
        return std::all_of(members.begin(), members.end(), [&](int t) { return Together(s, t); });
      });
      if (roof == roofs.end()) roofs.emplace_back(), roof = roofs.end() - 1;
      roof->push_back(s);
    }
    if (roofs.empty()) roofs.emplace_back();
    return roofs;
  }

  // Of each cell with label 0 the roof with the most points there; -1 without any.
  std::vector<int> RoofOfCells(const std::vector<std::vector<int>>& roofs) const {
    std::vector<int> roof_of(labels_.size(), -1);
    for (size_t c = 0; c < labels_.size(); ++c) {
      if (labels_[c] < 0) continue;
      int most = 0;
      for (size_t f = 0; f < roofs.size(); ++f) {
        int count = 0;
        for (const int s : roofs[f]) {
          const auto at = by_roof_[c].find(s);
          if (at != by_roof_[c].end()) count += at->second;
        }
        if (count > most) most = count, roof_of[c] = static_cast<int>(f);
      }
    }
    return roof_of;
  }

  // Cells without a roof take that of their neighbours, by the length of the edges between them.
  void FollowNeighbors(std::vector<int>* roof_of) const {
    std::map<std::pair<int, int>, size_t> owner;  // of a directed edge
    for (size_t c = 0; c < labels_.size(); ++c) {
      const auto& cell = cells_.cells[c];
      for (size_t k = 0; k < cell.size(); ++k) owner[{cell[k], cell[(k + 1) % cell.size()]}] = c;
    }
    for (bool changed = true; changed;) {
      changed = false;
      std::vector<std::map<int, double>> votes(labels_.size());
      for (const auto& [edge, c] : owner) {
        const auto twin = owner.find({edge.second, edge.first});
        if (twin == owner.end() || labels_[c] < 0 || (*roof_of)[c] >= 0) continue;
        const int roof = (*roof_of)[twin->second];
        if (roof < 0) continue;
        votes[c][roof] += (cells_.vertices[static_cast<size_t>(edge.first)] -
                           cells_.vertices[static_cast<size_t>(edge.second)])
                              .norm();
      }
      for (size_t c = 0; c < votes.size(); ++c) {
        if (votes[c].empty()) continue;
        const auto by_length = [](const auto& x, const auto& y) { return x.second < y.second; };
        (*roof_of)[c] = std::max_element(votes[c].begin(), votes[c].end(), by_length)->first;
        changed = true;
      }
    }
  }

  // The union of cells with label 0 becomes one label per roof, which are returned.
  std::vector<std::vector<int>> SplitByRoofs() {
    std::vector<std::vector<int>> roofs = FindRoofs();
    if (roofs.size() < 2) return roofs;
    std::vector<int> roof_of = RoofOfCells(roofs);
    FollowNeighbors(&roof_of);
    for (size_t c = 0; c < labels_.size(); ++c) {
      if (labels_[c] >= 0) labels_[c] = std::max(0, roof_of[c]);
    }
    return roofs;
  }

  std::vector<FootprintRegion> Regions() {
    const std::vector<std::vector<int>> roofs = SplitByRoofs();
    std::vector<FootprintRegion> regions;
    for (size_t f = 0; f < roofs.size(); ++f) {
      for (const std::vector<int>& loop : OutlinesOf(cells_, labels_, static_cast<int>(f))) {
        FootprintRegion region = RegionOf(loop);
        region.roof = roofs[f];
        if (PolygonArea(region.polygon) > 0) regions.push_back(std::move(region));
      }
    }
    return regions;
  }

  FootprintRegion RegionOf(const std::vector<int>& loop) const {
    FootprintRegion region;
    const size_t n = loop.size();
    const auto line_after = [&](size_t i) {
      const int a = loop[i % n], b = loop[(i + 1) % n];
      const auto at = cells_.edge_lines.find({std::min(a, b), std::max(a, b)});
      return at == cells_.edge_lines.end() ? -1 : at->second;
    };
    for (size_t i = 0; i < n; ++i) {
      // A corner is where the line changes.
      if (line_after(i) == line_after(i + n - 1)) continue;
      region.polygon.push_back(cells_.vertices[static_cast<size_t>(loop[i])]);
      const int line = line_after(i);
      region.walls.push_back(line < 0 ? WallLine() : walls_[static_cast<size_t>(line)]);
    }
    MendCorners(&region);
    MergeCorners(&region);
    return region;
  }

  // A short wall that no points draw, between two that meet nearby, is their corner cut off.
  void MendCorners(FootprintRegion* region) const {
    for (size_t i = 0; i < region->walls.size() && region->walls.size() > 3;) {
      const size_t n = region->walls.size(), before = (i + n - 1) % n, after = (i + 1) % n;
      const Eigen::Vector2d a = region->polygon[i], b = region->polygon[after];
      const Line2 &one = region->walls[before].line, &two = region->walls[after].line;
      Eigen::Matrix2d normals;
      normals << one.normal.transpose(), two.normal.transpose();
      const bool is_short = region->walls[i].inferred && (b - a).norm() < 0.7 * cloud_.step &&
                            std::abs(normals.determinant()) > std::sin(RadFromDeg(20));
      if (!is_short) {
        ++i;
        continue;
      }
      const Eigen::Vector2d corner = normals.inverse() * Eigen::Vector2d(one.offset, two.offset);
      if ((corner - a).norm() > cloud_.step) {
        ++i;
        continue;
      }
      region->polygon[after] = corner;
      region->polygon.erase(region->polygon.begin() + static_cast<std::ptrdiff_t>(i));
      region->walls.erase(region->walls.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }

  // Walls that are hardly longer than nothing, where three lines nearly meet.
  void MergeCorners(FootprintRegion* region) const {
    for (size_t i = 0; i < region->walls.size() && region->walls.size() > 3;) {
      const size_t after = (i + 1) % region->walls.size();
      if ((region->polygon[after] - region->polygon[i]).norm() > 1e-3 * cloud_.step) {
        ++i;
        continue;
      }
      region->polygon.erase(region->polygon.begin() + static_cast<std::ptrdiff_t>(i));
      region->walls.erase(region->walls.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }

  const OutlineCloud& cloud_;
  const GroundPlane& ground_;
  const std::vector<PlaneSegment>& segments_;
  std::vector<WallLine> walls_;
  std::vector<int> roofs_;
  std::vector<double> heights_;
  Eigen::AlignedBox2d box_;
  CellArrangement cells_;
  std::vector<std::vector<Eigen::Vector2d>> polygons_;
  std::unique_ptr<SightGrid> grid_;
  std::vector<double> inside_, outside_;     // what speaks for either, units of length
  std::vector<std::map<int, int>> by_roof_;  // of each cell: squares of each roof segment
  std::vector<int> labels_;
};

}  // namespace

std::vector<FootprintRegion> FindFootprints(const OutlineCloud& cloud, const GroundPlane& ground,
                                            const std::vector<PlaneSegment>& segments,
                                            const std::vector<int>& group, bool right_angles) {
  return FootprintFinder(cloud, ground, segments, group, right_angles).Find();
}

}  // namespace roomtex
