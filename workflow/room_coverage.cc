#include "workflow/room_coverage.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>

#include "core/frames.h"
#include "core/similarity.h"
#include "core/statistics.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr double kCell = 0.1;          // metres
constexpr double kNearFloor = 0.15;    // metres from floor or ceiling that count as such
constexpr double kPlaceStep = 0.35;    // metres between places that are tried
constexpr double kRoomToStand = 0.3;   // metres around a place without anything
constexpr double kLowestThing = 0.35;  // metres above the floor: what is lower is stepped over
constexpr double kNearest = 0.6, kFarthest = 5;  // metres between a place and what it shows
constexpr size_t kMaxPlaces = 4, kMaxTargets = 2500;
constexpr double kLeastGain = 0.25;      // square metres that make a place worth while
constexpr double kOutermost = 0.005;     // share of the samples beyond the room on each side
constexpr double kLargestRoom = 1e4;     // metres; what lies beyond is not looked at
constexpr double kMaxCandidates = 5000;  // places that are tried
constexpr double kInSight = 50;          // metres; nobody looks for a place farther from all photos

Eigen::Vector3d ToVector(const Json& json) {
  return {json.at(0).get<double>(), json.at(1).get<double>(), json.at(2).get<double>()};
}

// Angle of the walls to the first axis, radians in [0, pi/2): four times it is averaged, by area.
double AngleOfWalls(const Json& planes, const Eigen::Vector3d& up, const Eigen::Vector3d& first,
                    const Eigen::Vector3d& second) {
  if (!planes.is_array()) return 0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Json& plane : planes) {
    const Eigen::Vector3d normal = ToVector(plane.at("normal"));
    if (std::abs(normal.dot(up)) > 0.2) continue;
    const double angle = 4 * std::atan2(normal.dot(second), normal.dot(first));
    sum += plane.at("area_m2").get<double>() * Eigen::Vector2d(std::cos(angle), std::sin(angle));
  }
  return sum.norm() > 0 ? std::atan2(sum.y(), sum.x()) / 4 : 0;
}

// Cells of the room that hold surface.
class CellGrid {
 public:
  struct Cell {
    int num_points = 0, num_seen = 0;
    bool IsUnseen() const { return num_points >= 2 && 2 * num_seen < num_points; }
  };

  CellGrid(const std::vector<EvidencePoint>& points, const PlanFrame& frame) {
    for (int axis = 0; axis < 3; ++axis) {
      counts_[axis] = static_cast<int>(std::ceil(frame.Size()[axis] / kCell)) + 1;
    }
    for (const EvidencePoint& point : points) {
      const auto index = IndexOf(frame.InPlan(point.x_in_scan));
      if (!index) continue;
      Cell& cell = cells_[*index];
      ++cell.num_points;
      cell.num_seen += point.views > 0;
    }
  }

  const std::map<int64_t, Cell>& cells() const { return cells_; }
  Eigen::Vector3d CentreOf(int64_t index) const {
    const int64_t layer = int64_t{counts_[0]} * counts_[1];
    return kCell * (Eigen::Vector3d(static_cast<double>(index % counts_[0]),
                                    static_cast<double>(index / counts_[0] % counts_[1]),
                                    static_cast<double>(index / layer)) +
                    Eigen::Vector3d::Constant(0.5));
  }
  bool IsTaken(const Eigen::Vector3d& x) const {
    const auto index = IndexOf(x);
    return index && cells_.count(*index) > 0;
  }
  // Nothing between, but for what is right beside `to`.
  bool IsOpen(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const {
    const double length = (to - from).norm() - 1.8 * kCell;
    const Eigen::Vector3d direction = (to - from).normalized();
    for (double at = 1.5 * kCell; at < length; at += 0.7 * kCell) {
      if (IsTaken(from + at * direction)) return false;
    }
    return true;
  }
  // For somebody who holds a camera there: not over a table or in a shelf either.
  bool HasRoomToStand(const Eigen::Vector3d& x) const {
    for (double height = kLowestThing; height < x.z(); height += 2 * kCell) {
      if (!HasRoom({x.x(), x.y(), height})) return false;
    }
    return HasRoom(x);
  }

 private:
  bool HasRoom(const Eigen::Vector3d& x) const {
    for (double dx = -kRoomToStand; dx <= kRoomToStand; dx += kCell) {
      for (double dy = -kRoomToStand; dy <= kRoomToStand; dy += kCell) {
        if (IsTaken(x + Eigen::Vector3d(dx, dy, 0))) return false;
      }
    }
    return true;
  }
  std::optional<int64_t> IndexOf(const Eigen::Vector3d& x) const {
    int64_t index = 0;
    for (int axis = 2; axis >= 0; --axis) {
      const double i = std::floor(x[axis] / kCell);
      if (!(i >= 0 && i < counts_[axis])) return std::nullopt;
      index = index * counts_[axis] + static_cast<int64_t>(i);
    }
    return index;
  }

  int counts_[3];
  std::map<int64_t, Cell> cells_;
};

// Looks around from one place for the direction that shows most.
struct Look {
  Eigen::Vector3d forward = Eigen::Vector3d::UnitX();
  std::vector<size_t> targets;
};

Look BestLook(const std::vector<Eigen::Vector3d>& directions, const std::vector<size_t>& targets,
              double half_view) {
  Look best;
  const double least = std::cos(0.9 * half_view);
  for (int turn = 0; turn < 12; ++turn) {
    for (const double tilt_deg : {-30.0, -10.0, 10.0, 30.0}) {
      const double azimuth = turn * kPi / 6, tilt = RadFromDeg(tilt_deg);
      const Eigen::Vector3d forward(std::cos(azimuth) * std::cos(tilt),
                                    std::sin(azimuth) * std::cos(tilt), std::sin(tilt));
      std::vector<size_t> seen;
      for (size_t i = 0; i < targets.size(); ++i) {
        if (directions[i].dot(forward) > least) seen.push_back(targets[i]);
      }
      if (seen.size() > best.targets.size()) best = {forward, std::move(seen)};
    }
  }
  return best;
}

class PlaceSearch {
 public:
  PlaceSearch(const CellGrid& grid, const PlanFrame& frame, const std::vector<PlanCamera>& cameras)
      : grid_(grid), cameras_(cameras) {
    std::vector<Eigen::Vector3d> unseen;
    for (const auto& [index, cell] : grid.cells()) {
      if (cell.IsUnseen()) unseen.push_back(grid.CentreOf(index));
    }
    const size_t step = unseen.size() / kMaxTargets + 1;
    for (size_t i = 0; i < unseen.size(); i += step) targets_.push_back(unseen[i]);
    area_of_target_ = kCell * kCell * static_cast<double>(step);
    std::vector<double> heights, half_views;
    for (const PlanCamera& camera : cameras) {
      heights.push_back(camera.centre.z());
      half_views.push_back(camera.half_view);
    }
    half_view_ = Median(&half_views);
    const double height = std::clamp(Median(&heights), 0.0, frame.Size().z());
    const double width = frame.Size().x(), depth = frame.Size().y();
    const double place_step = std::max(kPlaceStep, std::sqrt(width * depth / kMaxCandidates));
    for (double x = place_step / 2; x < width; x += place_step) {
      for (double y = place_step / 2; y < depth; y += place_step) {
        const Eigen::Vector3d place(x, y, height);
        if (grid.HasRoomToStand(place) && IsReached(place)) places_.push_back(place);
      }
    }
  }

  std::vector<ViewingPlace> Best() const {
    std::vector<ViewingPlace> best;
    std::vector<bool> left(targets_.size(), true);
    while (best.size() < kMaxPlaces) {
      ViewingPlace place;
      Look look;
      for (const Eigen::Vector3d& candidate : places_) {
        Look one = LookFrom(candidate, left);
        if (one.targets.size() <= look.targets.size()) continue;
        look = std::move(one);
        place.centre = candidate;
      }
      place.forward = look.forward;
      place.area_m2 = area_of_target_ * static_cast<double>(look.targets.size());
      if (place.area_m2 < kLeastGain) break;
      for (const size_t target : look.targets) left[target] = false;
      SetNearest(&place);
      best.push_back(place);
    }
    return best;
  }

 private:
  // Where somebody has stood, or what was in sight from there.
  bool IsReached(const Eigen::Vector3d& place) const {
    return std::any_of(cameras_.begin(), cameras_.end(), [&](const PlanCamera& camera) {
      return (camera.centre - place).norm() < kInSight && grid_.IsOpen(camera.centre, place);
    });
  }
  Look LookFrom(const Eigen::Vector3d& place, const std::vector<bool>& left) const {
    std::vector<Eigen::Vector3d> directions;
    std::vector<size_t> seen;
    for (size_t i = 0; i < targets_.size(); ++i) {
      const double distance = (targets_[i] - place).norm();
      if (!left[i] || distance < kNearest || distance > kFarthest) continue;
      if (!grid_.IsOpen(place, targets_[i])) continue;
      seen.push_back(i);
      directions.push_back((targets_[i] - place) / distance);
    }
    return BestLook(directions, seen, half_view_);
  }
  void SetNearest(ViewingPlace* place) const {
    double nearest = std::numeric_limits<double>::infinity();
    for (const PlanCamera& camera : cameras_) {
      const double distance = (camera.centre - place->centre).norm();
      if (distance >= nearest) continue;
      nearest = place->distance = distance;
      place->nearest_photo = camera.name;
    }
  }

  const CellGrid& grid_;
  const std::vector<PlanCamera>& cameras_;
  std::vector<Eigen::Vector3d> targets_, places_;
  double area_of_target_ = 0, half_view_ = 0.5;
};

double Share(int part, int whole) { return whole > 0 ? static_cast<double>(part) / whole : 0; }

}  // namespace

PlanFrame MakePlanFrame(const std::vector<EvidencePoint>& points, const Eigen::Vector3d& up,
                        const Json& planes) {
  PlanFrame frame;
  const Eigen::Vector3d first = up.unitOrthogonal(), second = up.cross(first);
  const double angle = AngleOfWalls(planes, up, first, second);
  const Eigen::Vector3d along = std::cos(angle) * first + std::sin(angle) * second;
  frame.plan_from_scan.row(0) = along.transpose();
  frame.plan_from_scan.row(1) = up.cross(along).transpose();
  frame.plan_from_scan.row(2) = up.transpose();
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const EvidencePoint& point : points) {
      values.push_back(frame.plan_from_scan.row(axis).dot(point.x_in_scan));
    }
    if (values.empty()) values.push_back(0);
    const auto rank = static_cast<size_t>(kOutermost * static_cast<double>(values.size()));
    frame.low[axis] = AtRank(&values, rank) - kCell;
    frame.high[axis] = AtRank(&values, values.size() - 1 - rank) + kCell;
    frame.high[axis] = std::min(frame.high[axis], frame.low[axis] + kLargestRoom);
  }
  return frame;
}

std::vector<PlanCamera> ReadPlanCameras(const Json& cameras, const PlanFrame& frame) {
  std::vector<PlanCamera> result;
  if (!cameras.is_array()) return result;
  for (const Json& json : cameras) {
    PlanCamera camera;
    camera.name = json.at("name");
    camera.centre = frame.InPlan(ToVector(json.at("centre")));
    const Json& wxyz = json.at("rotation_wxyz");
    const Eigen::Quaterniond cam_from_scan =
        QuaternionFromWxyz({wxyz.at(0).get<double>(), wxyz.at(1).get<double>(),
                            wxyz.at(2).get<double>(), wxyz.at(3).get<double>()});
    camera.forward = frame.plan_from_scan * (cam_from_scan.conjugate() * Eigen::Vector3d::UnitZ());
    camera.half_view =
        std::atan(json.at("width").get<double>() / 2 / json.at("focal_px").get<double>());
    result.push_back(std::move(camera));
  }
  std::sort(result.begin(), result.end(),
            [](const PlanCamera& a, const PlanCamera& b) { return a.name < b.name; });
  return result;
}

RoomCoverage MeasureCoverage(const std::vector<EvidencePoint>& points, const PlanFrame& frame,
                             const std::vector<PlanCamera>& cameras) {
  const CellGrid grid(points, frame);
  int all[3] = {0, 0, 0}, seen[3] = {0, 0, 0};  // walls and things, floor, ceiling
  for (const auto& [index, cell] : grid.cells()) {
    const double height = grid.CentreOf(index).z();
    const int kind = height < kCell + kNearFloor                      ? 1
                     : height > frame.Size().z() - kCell - kNearFloor ? 2
                                                                      : 0;
    ++all[kind];
    seen[kind] += !cell.IsUnseen();
  }
  RoomCoverage coverage;
  coverage.walls = Share(seen[0], all[0]);
  coverage.floor = Share(seen[1], all[1]);
  coverage.ceiling = Share(seen[2], all[2]);
  const int num_all = all[0] + all[1] + all[2], num_seen = seen[0] + seen[1] + seen[2];
  coverage.all = Share(num_seen, num_all);
  coverage.surface_m2 = kCell * kCell * num_all;
  coverage.unseen_m2 = kCell * kCell * (num_all - num_seen);
  if (!cameras.empty()) coverage.places = PlaceSearch(grid, frame, cameras).Best();
  return coverage;
}

Json PlaceToJson(const ViewingPlace& place) {
  Json json;
  json["centre_in_plan"] = ToJson(place.centre);
  json["direction_in_plan"] = ToJson(place.forward);
  json["area_m2"] = place.area_m2;
  json["nearest_photo"] = place.nearest_photo;
  json["distance_m"] = place.distance;
  return json;
}

ViewingPlace PlaceFromJson(const Json& json) {
  ViewingPlace place;
  for (int i = 0; i < 3; ++i) {
    place.centre[i] = json.at("centre_in_plan").at(static_cast<size_t>(i));
    place.forward[i] = json.at("direction_in_plan").at(static_cast<size_t>(i));
  }
  place.area_m2 = json.at("area_m2");
  place.nearest_photo = json.at("nearest_photo");
  place.distance = json.at("distance_m");
  return place;
}

std::string PlaceText(const ViewingPlace& place) {
  const double tilt = DegFromRad(std::asin(std::clamp(place.forward.z(), -1.0, 1.0)));
  const std::string tilted = std::abs(tilt) < 15 ? "level" : tilt > 0 ? "tilted up" : "tilted down";
  return Number(place.distance, 1) + " m from where " + place.nearest_photo + " was taken, " +
         Number(place.centre.z(), 1) + " m above the floor, " + tilted + ": about " +
         Number(place.area_m2, 1) + " m² more.";
}

}  // namespace roomtex
