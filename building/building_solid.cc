#include "building/building_solid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "building/cell_arrangement.h"

namespace roomtex {
namespace {

Eigen::Vector3d NewellNormal(const std::vector<Eigen::Vector3d>& corners) {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < corners.size(); ++i) {
    normal += (corners[i] - corners[0]).cross(corners[(i + 1) % corners.size()] - corners[0]);
  }
  return normal;
}

double TwiceArea(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

// Pairs of roof planes that meet anywhere in the box: of most pairs of many planes the line where
// they cross lies above a third one, and would only cut the cells into more.
std::set<std::pair<size_t, size_t>> MeetingPlanes(const std::vector<RoofPlane>& roof,
                                                  const Eigen::AlignedBox2d& box) {
  // Planes that are hardly above the others meet them, too.
  const double slack = 1e-6 * box.diagonal().norm();
  constexpr size_t kBorder = std::numeric_limits<size_t>::max();
  struct Corner {
    Eigen::Vector2d x;
    size_t plane;  // on the other side of the edge that begins here
  };
  std::set<std::pair<size_t, size_t>> pairs;
  for (size_t i = 0; i < roof.size(); ++i) {
    // Where it is the lowest: a convex polygon, cut off by one plane after the other.
    std::vector<Corner> where = {{box.min(), kBorder},
                                 {{box.max().x(), box.min().y()}, kBorder},
                                 {box.max(), kBorder},
                                 {{box.min().x(), box.max().y()}, kBorder}};
    for (size_t j = 0; j < roof.size(); ++j) {
      if (i == j) continue;
      std::vector<Corner> kept;
      for (size_t k = 0; k < where.size(); ++k) {
        const Corner &a = where[k], &b = where[(k + 1) % where.size()];
        const double above_a = roof[i].HeightAt(a.x) - roof[j].HeightAt(a.x) - slack;
        const double above_b = roof[i].HeightAt(b.x) - roof[j].HeightAt(b.x) - slack;
        if (above_a <= 0) kept.push_back({a.x, above_a == 0 && above_b > 0 ? j : a.plane});
        if (above_a * above_b >= 0) continue;
        const Eigen::Vector2d crossing = a.x + above_a / (above_a - above_b) * (b.x - a.x);
        kept.push_back({crossing, above_a < 0 ? j : a.plane});
      }
      where = std::move(kept);
    }
    for (const Corner& corner : where) {
      if (corner.plane != kBorder) pairs.insert(std::minmax(i, corner.plane));
    }
  }
  return pairs;
}

class SolidBuilder {
 public:
  explicit SolidBuilder(const OutlineBuilding& building) : building_(building) {}

  BuildingSolid Build() {
    Arrange();
    FindNeeded();
    AddRoof();
    AddGroundAndWalls();
    return std::move(solid_);
  }

 private:
  using Loop = std::vector<int>;

  void Arrange() {
    Eigen::AlignedBox2d box;
    for (const Eigen::Vector2d& corner : building_.footprint) box.extend(corner);
    size_ = box.diagonal().norm();
    epsilon_ = 1e-9 * size_;
    const Eigen::Vector2d margin = Eigen::Vector2d::Constant(0.1 * size_);
    const Eigen::AlignedBox2d wide(box.min() - margin, box.max() + margin);
    std::vector<Line2> lines;
    for (const auto& [i, j] : MeetingPlanes(building_.roof, wide)) {
      const RoofPlane &a = building_.roof[i], &b = building_.roof[j];
      const Eigen::Vector2d gradient = a.Gradient() - b.Gradient();
      if (gradient.norm() < 1e-9) continue;
      Line2 line;
      line.normal = gradient.normalized();
      line.offset = line.normal.dot(box.min()) +
                    (b.HeightAt(box.min()) - a.HeightAt(box.min())) / gradient.norm();
      lines.push_back(line);
    }
    cells_ = ArrangeInside(building_.footprint, lines, epsilon_);
    for (size_t cell = 0; cell < cells_.cells.size(); ++cell) {
      const Eigen::Vector2d centre = cells_.CentreOf(static_cast<int>(cell));
      int label = 0;
      for (size_t k = 1; k < building_.roof.size(); ++k) {
        if (building_.roof[k].HeightAt(centre) < building_.roof[label].HeightAt(centre)) {
          label = static_cast<int>(k);
        }
      }
      labels_.push_back(label);
    }
    outline_ = OutlinesOf(cells_, std::vector<int>(labels_.size(), 0), 0);
    for (size_t k = 0; k < building_.roof.size(); ++k) {
      patches_.push_back(OutlinesOf(cells_, labels_, static_cast<int>(k)));
    }
  }

  bool IsTurn(const Loop& loop, size_t i) const {
    const size_t n = loop.size();
    const Eigen::Vector2d &a = cells_.vertices[loop[(i + n - 1) % n]],
                          &b = cells_.vertices[loop[i]], &c = cells_.vertices[loop[(i + 1) % n]];
    return std::abs(TwiceArea(a, b, c)) > 1e-7 * (b - a).norm() * (c - b).norm();
  }

  void FindNeeded() {
    for (const Loop& loop : outline_) {
      for (size_t i = 0; i < loop.size(); ++i) {
        if (IsTurn(loop, i)) corners_.insert(loop[i]);
      }
    }
    needed_ = corners_;
    for (const auto& loops : patches_) {
      for (const Loop& loop : loops) {
        for (size_t i = 0; i < loop.size(); ++i) {
          if (IsTurn(loop, i)) needed_.insert(loop[i]);
        }
      }
    }
  }

  int VertexAt(int vertex, bool on_roof) {
    const auto [at, is_new] =
        index_.emplace(std::make_pair(vertex, on_roof), static_cast<int>(solid_.vertices.size()));
    if (is_new) {
      const Eigen::Vector2d& x = cells_.vertices[vertex];
      const double z = on_roof ? building_.RoofHeightAt(x) : building_.ground;
      solid_.vertices.emplace_back(x.x(), x.y(), z);
    }
    return at->second;
  }

  void AddFace(SolidFace::Kind kind, std::vector<int> corners) {
    if (corners.size() >= 3) solid_.faces.push_back({kind, std::move(corners)});
  }

  void AddRoof() {
    for (const auto& loops : patches_) {
      for (const Loop& loop : loops) {
        std::vector<int> corners;
        for (const int v : loop) {
          if (needed_.count(v) > 0) corners.push_back(VertexAt(v, true));
        }
        AddFace(SolidFace::Kind::kRoof, corners);
      }
    }
  }

  void AddGroundAndWalls() {
    for (const Loop& loop : outline_) {
      std::vector<int> floor;
      for (const int v : loop) {
        if (corners_.count(v) > 0) floor.push_back(v);
      }
      std::vector<int> ground;
      for (auto v = floor.rbegin(); v != floor.rend(); ++v) ground.push_back(VertexAt(*v, false));
      AddFace(SolidFace::Kind::kGround, ground);
      const size_t n = loop.size();
      const size_t first =
          static_cast<size_t>(std::find(loop.begin(), loop.end(), floor[0]) - loop.begin());
      for (size_t i = 0; i < n;) {
        // From corner to corner, and back along the roof.
        std::vector<int> top = {loop[(first + i) % n]};
        do {
          const int v = loop[(first + ++i) % n];
          if (needed_.count(v) > 0) top.push_back(v);
        } while (corners_.count(loop[(first + i) % n]) == 0);
        std::vector<int> wall = {VertexAt(top.front(), false), VertexAt(top.back(), false)};
        for (auto v = top.rbegin(); v != top.rend(); ++v) wall.push_back(VertexAt(*v, true));
        AddFace(SolidFace::Kind::kWall, wall);
      }
    }
  }

  const OutlineBuilding& building_;
  double size_ = 0, epsilon_ = 0;
  CellArrangement cells_;
  std::vector<int> labels_;  // the lowest roof plane of each cell
  std::vector<Loop> outline_;
  std::vector<std::vector<Loop>> patches_;  // of each roof plane
  std::set<int> corners_, needed_;          // of the footprint; of any face
  std::map<std::pair<int, bool>, int> index_;
  BuildingSolid solid_;
};

}  // namespace

double BuildingSolid::Volume() const {
  if (vertices.empty()) return 0;
  double volume = 0;
  for (const SolidFace& face : faces) {
    const std::vector<Eigen::Vector3d> corners = CornersOf(face);
    volume += NewellNormal(corners).dot(corners[0] - vertices[0]) / 6;
  }
  return volume;
}

std::pair<double, double> BuildingSolid::RoofHeights() const {
  double eaves = std::numeric_limits<double>::infinity(), ridge = -eaves;
  for (const SolidFace& face : faces) {
    if (face.kind != SolidFace::Kind::kRoof) continue;
    for (const int v : face.corners) {
      eaves = std::min(eaves, vertices[v].z());
      ridge = std::max(ridge, vertices[v].z());
    }
  }
  return {eaves, ridge};
}

std::vector<Eigen::Vector3d> BuildingSolid::CornersOf(const SolidFace& face) const {
  std::vector<Eigen::Vector3d> corners;
  for (const int v : face.corners) corners.push_back(vertices[v]);
  return corners;
}

BuildingSolid ExtrudeBuilding(const OutlineBuilding& building) {
  return SolidBuilder(building).Build();
}

// Ear clipping (Meisters 1975); of the ears the one with the largest smallest angle is cut.
std::vector<Triangle> TrianglesOf(const BuildingSolid& solid, const SolidFace& face) {
  const std::vector<Eigen::Vector3d> corners = solid.CornersOf(face);
  const Eigen::Vector3d normal = NewellNormal(corners).normalized();
  const Eigen::Vector3d u = normal.unitOrthogonal(), v = normal.cross(u);
  std::vector<Eigen::Vector2d> flat;
  for (const Eigen::Vector3d& corner : corners) {
    flat.emplace_back(u.dot(corner - corners[0]), v.dot(corner - corners[0]));
  }
  std::vector<size_t> left(corners.size());
  for (size_t i = 0; i < left.size(); ++i) left[i] = i;
  std::vector<Triangle> triangles;
  while (left.size() >= 3) {
    double best_quality = -1;
    size_t best = 0;
    for (size_t i = 0; i < left.size(); ++i) {
      const size_t ia = left[(i + left.size() - 1) % left.size()], ib = left[i],
                   ic = left[(i + 1) % left.size()];
      const Eigen::Vector2d &a = flat[ia], &b = flat[ib], &c = flat[ic];
      const double area = TwiceArea(a, b, c);
      const double longest =
          std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
      if (!(area > 1e-12 * longest)) continue;
      if (area / longest <= best_quality) continue;
      const bool blocked = std::any_of(left.begin(), left.end(), [&](size_t other) {
        if (other == ia || other == ib || other == ic) return false;
        const Eigen::Vector2d& p = flat[other];
        const double slack = -1e-12 * longest;
        return TwiceArea(a, b, p) >= slack && TwiceArea(b, c, p) >= slack &&
               TwiceArea(c, a, p) >= slack;
      });
      if (blocked) continue;
      best_quality = area / longest;
      best = i;
    }
    if (best_quality < 0) break;  // what is left has no area
    const size_t n = left.size();
    triangles.push_back({face.corners[left[(best + n - 1) % n]], face.corners[left[best]],
                         face.corners[left[(best + 1) % n]]});
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(best));
  }
  return triangles;
}

}  // namespace roomtex
