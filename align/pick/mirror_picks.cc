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
  const auto scan_of = [&scene](const SessionPick& pick) -> const Scan& {
    return scene.scans()[pick.spot ? pick.spot->scan : 0];
  };
  std::vector<SessionPick> mirrored = picks;
  int near_as_they_are = 0, near_mirrored = 0;
  for (SessionPick& pick : mirrored) {
    if (!pick.x_in_scan || !scan_of(pick).is_rtpi) continue;
    const Rigid& scan_from_station = scan_of(pick).scan_from_station;
    Eigen::Vector3d x_in_station = scan_from_station.Inverse() * *pick.x_in_scan;
    x_in_station.x() *= -1;
    near_as_they_are += DistanceFromSurface(scene, *pick.x_in_scan) < kNear;
    pick.x_in_scan = scan_from_station * x_in_station;
    near_mirrored += DistanceFromSurface(scene, *pick.x_in_scan) < kNear;
    pick.spot.reset();
  }
  if (near_mirrored <= near_as_they_are) return mirrored;
  for (SessionPick& pick : picks) pick.spot.reset();
  return picks;
}

}  // namespace roomtex
