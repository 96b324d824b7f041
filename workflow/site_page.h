#pragma once
// site.html: one page over all rooms, in the look of their own reports.

#include <string>

#include "core/report.h"

namespace roomtex {

// keys: of MakeSiteKeys(). to_rooms: from the page's folder to that of the rooms, with a slash at
// its end, "" = the same.
std::string MakeSitePage(const Json& keys, const std::string& to_rooms);

}  // namespace roomtex
