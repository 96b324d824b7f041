#pragma once
// The report's `cameras`: every lens as it was told, as it was found and how exactly, and whether
// it was used (docs/commands.md).

#include "align/alignment.h"
#include "core/report.h"

namespace roomtex {

Json CamerasToJson(const Alignment& alignment);

}  // namespace roomtex
