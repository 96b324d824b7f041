#pragma once
// The rooms of a site in one plan, as roomtex-join placed them, and each by itself.

#include <optional>
#include <string>

#include <Eigen/Core>

#include "core/report.h"

namespace roomtex {

// An <svg> of the rooms that stand in the scan frame of the room `frame`: the pictures of their
// plans, placed, with names, and the doorways that link them; "" if fewer than two have a plan.
// keys: of MakeSiteKeys(). to_rooms: from the page's folder to that of the rooms.
std::string DrawSitePlan(const Json& keys, const std::string& frame, const std::string& to_rooms);

// Metres along and across the plan of a room of MakeSiteKeys(); nothing if it has no plan that can
// be drawn.
std::optional<Eigen::Vector2d> PlanSize(const Json& room);
// An <svg> of the plan of one room in its own frame, which has a PlanSize(), with a scale. units:
// of the drawing, pixels of the page, in a metre.
std::string DrawRoomPlan(const Json& room, double units, const std::string& to_rooms);

}  // namespace roomtex
