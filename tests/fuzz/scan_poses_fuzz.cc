// Any bytes as the file of --scan_poses: an InputError or poses that are rigid motions; never a
// crash.

#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "core/error.h"
#include "importers/scan_poses.h"
#include "tests/fuzz/memory_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const roomtex::MemoryFile file(data, size);
  for (const int count : {1, 2}) {
    try {
      roomtex::ScanPoses poses(file.path());
      for (int number = 1; number <= count; ++number) {
        const auto placed = poses.Take({"rooms/a.rtpi", number, count, Eigen::Vector3d::UnitZ()});
        if (!placed) continue;
        const roomtex::Rigid& pose = placed->scan_from_station;
        if (!(std::abs(pose.rotation.norm() - 1) < 1e-3)) std::abort();
        if (!pose.translation.allFinite()) std::abort();
      }
      poses.RequireAllPlaced();
    } catch (const roomtex::InputError&) {
    }
  }
  return 0;
}
