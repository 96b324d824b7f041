#pragma once
// The rooms of a site in one plan, as roomtex-join placed them.

#include <string>

#include "core/report.h"

namespace roomtex {

// An <svg> of the rooms that stand in the scan frame of the room `frame`: the pictures of their
// plans, placed, with names, and the doorways that link them; "" if fewer than two have a plan.
// keys: of MakeSiteKeys(). to_rooms: from the page's folder to that of the rooms.
std::string DrawSitePlan(const Json& keys, const std::string& frame, const std::string& to_rooms);

}  // namespace roomtex
