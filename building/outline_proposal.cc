#include "building/outline_proposal.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <numeric>
#include <set>
#include <sstream>

#include "building/building_heights.h"
#include "building/footprint_cells.h"
#include "building/wall_lines.h"
#include "core/frames.h"
#include "core/option_fields.h"
#include "core/text.h"

namespace roomtex {
namespace {

// Segments whose points come near each other in the top view.
class SegmentGroups {
 public:
  SegmentGroups(const OutlineCloud& cloud, const std::vector<PlaneSegment>& segments,
                const std::vector<int>& members)
      : parents_(segments.size()) {
    std::iota(parents_.begin(), parents_.end(), 0);
    const double cell = 0.8 * cloud.step;
    std::map<std::pair<int64_t, int64_t>, std::set<int>> cells;  // a map grid may be in mm
    for (const int s : members) {
      for (const int i : segments[static_cast<size_t>(s)].points) {
        const Eigen::Vector3d& x = cloud.points[static_cast<size_t>(i)];
        cells[{static_cast<int64_t>(std::floor(x.x() / cell)),
               static_cast<int64_t>(std::floor(x.y() / cell))}]
            .insert(s);
      }
    }
    for (const auto& [at, here] : cells) {
      for (int dx = 0; dx <= 1; ++dx) {
        for (int dy = -1; dy <= 1; ++dy) {
          const auto near = cells.find({at.first + dx, at.second + dy});
          if (near == cells.end()) continue;
          for (const int s : near->second) Join(*here.begin(), s);
        }
      }
    }
    std::map<int, std::vector<int>> by_root;
    for (const int s : members) by_root[Root(s)].push_back(s);
    for (auto& [root, group] : by_root) groups_.push_back(std::move(group));
  }
  const std::vector<std::vector<int>>& groups() const { return groups_; }

 private:
  int Root(int s) {
    while (parents_[static_cast<size_t>(s)] != s) s = parents_[static_cast<size_t>(s)];
    return s;
  }
  void Join(int a, int b) {
    a = Root(a), b = Root(b);
    parents_[static_cast<size_t>(std::max(a, b))] = std::min(a, b);
  }

  std::vector<int> parents_;
  std::vector<std::vector<int>> groups_;
};

// Only the points in the area, and the segments that keep enough of theirs.
void LimitToArea(const std::array<double, 4>& area, const OutlineCloud& cloud,
                 std::vector<PlaneSegment>* segments) {
  for (PlaneSegment& segment : *segments) {
    auto& points = segment.points;
    const size_t before = points.size();
    points.erase(std::remove_if(points.begin(), points.end(),
                                [&](int i) {
                                  const Eigen::Vector3d& x = cloud.points[static_cast<size_t>(i)];
                                  return x.x() < area[0] || x.y() < area[1] || x.x() > area[2] ||
                                         x.y() > area[3];
                                }),
                 points.end());
    segment.area *= static_cast<double>(points.size()) / static_cast<double>(before);
  }
  segments->erase(std::remove_if(segments->begin(), segments->end(),
                                 [](const PlaneSegment& s) { return s.points.size() < 6; }),
                  segments->end());
}

std::vector<int> RoofSegments(const OutlineCloud& cloud, const GroundPlane& ground,
                              const std::vector<PlaneSegment>& segments) {
  std::vector<int> roof;
  for (size_t s = 0; s < segments.size(); ++s) {
    if (RoleOf(cloud, ground, segments[s]) == SegmentRole::kRoof)
      roof.push_back(static_cast<int>(s));
  }
  return roof;
}

}  // namespace

void ProposalOptions::Declare(OptionFields* fields) {
  fields->Text("area", &area,
               "x0,y0,x1,y1 of the outline's frame: buildings are proposed only from the points "
               "inside this rectangle; empty = everywhere.");
  fields->Require(area.empty() || Area().has_value(),
                  "--area must be four numbers x0,y0,x1,y1, with x0 < x1 and y0 < y1");
  fields
      ->Number("min_area", &min_area,
               "Smallest footprint that is proposed, square metres (units of the input, where it "
               "has no scale); 0 = 9, less for small things.")
      .NotNegative()
      .Finite();
  fields->Bool("right_angles", &right_angles,
               "Walls that are parallel or at right angles within their uncertainty are made so.");
}
std::vector<std::string> ProposalOptions::Problems() const { return ProblemsOf(*this); }

std::optional<std::array<double, 4>> ProposalOptions::Area() const {
  std::array<double, 4> box{};
  std::istringstream stream(area);
  size_t count = 0;
  for (std::string part; std::getline(stream, part, ','); ++count) {
    const std::optional<double> number = ParseNumber(Trimmed(part));
    if (!number || count >= 4) return std::nullopt;
    box[count] = *number;
  }
  if (count != 4 || !(box[0] < box[2]) || !(box[1] < box[3])) return std::nullopt;
  return box;
}

OutlineProposal ProposeOutline(const OutlineCloud& cloud, const std::vector<PlaneSegment>& all,
                               const ProposalOptions& options) {
  OutlineProposal proposal;
  proposal.outline = cloud.frame;
  std::vector<PlaneSegment> segments = all;
  if (const auto area = options.Area()) LimitToArea(*area, cloud, &segments);
  const GroundPlane ground = FindGround(cloud, segments);
  const double min_area = options.min_area > 0 ? options.min_area : 4 * cloud.step * cloud.step;

  std::vector<int> members;
  for (size_t s = 0; s < segments.size(); ++s) {
    const SegmentRole role = RoleOf(cloud, ground, segments[s]);
    if (role != SegmentRole::kOther) members.push_back(static_cast<int>(s));
  }
  std::vector<FootprintRegion> regions;
  const SegmentGroups groups(cloud, segments, members);
  for (const std::vector<int>& group : groups.groups()) {
    for (FootprintRegion& region :
         FindFootprints(cloud, ground, segments, group, options.right_angles)) {
      if (PolygonArea(region.polygon) >= min_area) regions.push_back(std::move(region));
    }
  }
  // From west to east, each from its south-western corner: names do not hang on chance.
  for (FootprintRegion& region : regions) {
    const auto first = std::min_element(region.polygon.begin(), region.polygon.end(),
                                        [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
                                          return a.x() + a.y() < b.x() + b.y();
                                        }) -
                       region.polygon.begin();
    std::rotate(region.polygon.begin(), region.polygon.begin() + first, region.polygon.end());
    std::rotate(region.walls.begin(), region.walls.begin() + first, region.walls.end());
  }
  std::stable_sort(regions.begin(), regions.end(),
                   [](const FootprintRegion& a, const FootprintRegion& b) {
                     return a.polygon[0].x() < b.polygon[0].x();
                   });
  for (const FootprintRegion& region : regions) {
    OutlineBuilding building;
    building.footprint = region.polygon;
    BuildingEvidence evidence;
    if (!FindHeights(cloud, ground, segments, region.roof, &building, &evidence)) continue;
    building.name = std::to_string(proposal.outline.buildings.size() + 1);
    AddWallEvidence(cloud, ground, region.walls, building, &evidence);
    AddExplained(cloud, ground, building, &evidence);
    evidence.doubts = FindDoubts(cloud, evidence);
    // What is proposed must be what the file can hold: two corners may become one there.
    building = AsWritten(building);
    if (!building.Problems().empty()) continue;
    proposal.outline.buildings.push_back(building);
    proposal.evidence.push_back(evidence);
  }
  proposal.explained = ExplainedShare(cloud, ground, proposal.outline.buildings);
  return proposal;
}

OutlineProposal JudgeOutline(const OutlineCloud& cloud, const std::vector<PlaneSegment>& segments,
                             const Outline& outline) {
  OutlineProposal judged;
  judged.outline = outline;
  const GroundPlane ground = FindGround(cloud, segments);
  const std::vector<int> roof = RoofSegments(cloud, ground, segments);
  for (const OutlineBuilding& building : outline.buildings) {
    BuildingEvidence evidence;
    // What the points say of floor and roof; the building keeps its own.
    OutlineBuilding measured = building;
    FindHeights(cloud, ground, segments, roof, &measured, &evidence);
    AddWallEvidence(cloud, ground, {}, building, &evidence);
    AddExplained(cloud, ground, building, &evidence);
    evidence.doubts = FindDoubts(cloud, evidence);
    judged.evidence.push_back(evidence);
  }
  judged.explained = ExplainedShare(cloud, ground, outline.buildings);
  return judged;
}

std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> WallStretches(
    const OutlineCloud& cloud, const std::vector<PlaneSegment>& segments) {
  const GroundPlane ground = FindGround(cloud, segments);
  std::vector<int> all(segments.size());
  std::iota(all.begin(), all.end(), 0);
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> ends;
  for (const WallLine& wall : FindWallLines(cloud, ground, segments, all, false)) {
    const Eigen::Vector2d foot = wall.line.normal * wall.line.offset, u = wall.line.Direction();
    for (const auto& [low, high] : wall.stretches)
      ends.emplace_back(foot + low * u, foot + high * u);
  }
  return ends;
}

std::optional<OutlineBuilding> HeightsFromPoints(const OutlineCloud& cloud,
                                                 const std::vector<PlaneSegment>& segments,
                                                 const OutlineBuilding& building) {
  const GroundPlane ground = FindGround(cloud, segments);
  OutlineBuilding measured = building;
  BuildingEvidence evidence;
  const std::vector<int> roof = RoofSegments(cloud, ground, segments);
  if (!FindHeights(cloud, ground, segments, roof, &measured, &evidence)) return std::nullopt;
  return measured;
}

}  // namespace roomtex
