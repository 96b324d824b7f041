#include "align/pick/mirror_picks.h"

#include "align/pick/pick_advice.h"
#include "importers/scan_record.h"

namespace roomtex {

std::string MirrorProblem(const PickScene& scene) {
  if (scene.azimuth().empty()) return "Only RTPI scans can be read the other way round.";
  if (!ReadAlignmentRecord(scene.input().AlignedPath()).scans.empty()) {
    return "This model is aligned to the scan as it is read now. To read it the other way round, "
           "start from the model that was not aligned yet.";
  }
  return "";
}

std::vector<SessionPick> MirrorPicks(const PickScene& scene, std::vector<SessionPick> picks) {
  constexpr double kNear = 0.05;  // metres
  std::vector<SessionPick> mirrored = picks;
  int near_as_they_are = 0, near_mirrored = 0;
  for (SessionPick& pick : mirrored) {
    if (!pick.x_in_scan || !scene.ScanOf(pick).is_rtpi) continue;
    near_as_they_are += DistanceFromSurface(scene, *pick.x_in_scan) < kNear;
    pick.x_in_scan = MirroredAt(scene.ScanOf(pick).scan_from_station, *pick.x_in_scan);
    near_mirrored += DistanceFromSurface(scene, *pick.x_in_scan) < kNear;
    pick.spot.reset();
  }
  if (near_mirrored <= near_as_they_are) return mirrored;
  for (SessionPick& pick : picks) pick.spot.reset();
  return picks;
}

}  // namespace roomtex
