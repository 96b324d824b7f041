#pragma once
// Results of other commands that colours are built on, and what those said of them.

#include <string>

#include "core/command_line.h"

namespace roomtex {

// The doubts that `command` (roomtex-dense) had about its result at `path`, by the report.json
// beside it, are those of what is built on it: exit 4, or a warning if accept. Of one station of
// many (station_0/model.ply) the report lies one folder above. Without a report nothing is said.
void TakeOverTrustOfResult(const std::string& path, const std::string& command, bool accept,
                           const Command::Context& context);

}  // namespace roomtex
