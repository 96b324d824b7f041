#pragma once
// The plan of the room as a picture in the page: cameras over coverage or disagreement.

#include <string>
#include <vector>

#include "workflow/room_coverage.h"

namespace roomtex {

enum class PlanShows { kCoverage, kDisagreement };

// The surface below the ceiling, seen from above, as the bytes of a PNG: over all of the frame's x
// and y, its first row at the largest y.
std::string PlanPicture(const std::vector<EvidencePoint>& points, const PlanFrame& frame,
                        PlanShows shows);
// An <svg> with the surface below the ceiling as a picture in it, cameras as wedges, places to
// photograph from as numbered arrows, a scale.
std::string DrawPlan(const std::vector<EvidencePoint>& points, const PlanFrame& frame,
                     const std::vector<PlanCamera>& cameras,
                     const std::vector<ViewingPlace>& places, PlanShows shows);

// Levels of 0-255 beyond which the disagreement is drawn as worst.
inline constexpr double kWorstDisagreement = 30;

}  // namespace roomtex
