#pragma once
// What no photo saw, and from where to photograph it: on a grid of cells over the scan.

#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/report.h"
#include "workflow/evidence_points.h"

namespace roomtex {

// A photo in the plan's frame.
struct PlanCamera {
  std::string name;
  Eigen::Vector3d centre, forward;  // metres; unit length
  double half_view = 0.5;           // radians, half of the angle that it sees across
};

// The frame of the plan: x and y along the walls, z up from the floor; metres.
struct PlanFrame {
  Eigen::Matrix3d plan_from_scan = Eigen::Matrix3d::Identity();
  Eigen::Vector3d low, high;  // the room, in the plan's frame before it is moved to `low`
  Eigen::Vector3d InPlan(const Eigen::Vector3d& x_in_scan) const {
    return plan_from_scan * x_in_scan - low;
  }
  Eigen::Vector3d Size() const { return high - low; }
};

// up: of the scan. planes: of roomtex-align's report, whose largest walls turn the plan; null =
// none.
PlanFrame MakePlanFrame(const std::vector<EvidencePoint>& points, const Eigen::Vector3d& up,
                        const Json& planes);

// The keys `cameras` of roomtex-render's report.
std::vector<PlanCamera> ReadPlanCameras(const Json& cameras, const PlanFrame& frame);

// A place to photograph from.
struct ViewingPlace {
  Eigen::Vector3d centre, forward;  // in the plan's frame
  double area_m2 = 0;               // of what no photo saw that is seen from there
  std::string nearest_photo;        // to find the place by
  double distance = 0;              // metres from that photo's place
};

Json PlaceToJson(const ViewingPlace& place);
// Of what PlaceToJson made. Throws Json::exception for anything else.
ViewingPlace PlaceFromJson(const Json& json);
// "0.4 m from where photo_003.jpg was taken, 1.5 m above the floor, level: about 2.1 m² more."
std::string PlaceText(const ViewingPlace& place);

// Shares are of the surface, every cell counted once.
struct RoomCoverage {
  double walls = 0, floor = 0, ceiling = 0, all = 0;
  double unseen_m2 = 0, surface_m2 = 0;
  std::vector<ViewingPlace> places;  // the best first
};

RoomCoverage MeasureCoverage(const std::vector<EvidencePoint>& points, const PlanFrame& frame,
                             const std::vector<PlanCamera>& cameras);

}  // namespace roomtex
