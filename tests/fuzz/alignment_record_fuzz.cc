// Any bytes as the alignment.json beside a model, and as a panoramas.json: an InputError or poses
// that are rotations; never a crash.

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>

#include "core/error.h"
#include "core/panorama_set.h"
#include "core/partial_path.h"
#include "importers/scan_record.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const roomtex::PartialFolder folder(std::filesystem::temp_directory_path().string());
  const std::string path = folder / "alignment.json";
  std::FILE* const file = std::fopen(path.c_str(), "wb");
  if (file == nullptr || std::fwrite(data, 1, size, file) != size) std::abort();
  std::fclose(file);
  try {
    for (const auto& record : roomtex::ReadAlignmentRecord(folder.path()).scans) {
      if (!(record.meters_per_unit > 0) || !(record.max_range >= 0)) std::abort();
      for (const auto& pose : record.poses) {
        const double norm = pose.scan_from_station.rotation.norm();
        if (!(std::abs(norm - 1) < 1e-3)) std::abort();
        if (!pose.scan_from_station.translation.allFinite()) std::abort();
      }
    }
  } catch (const roomtex::InputError&) {
  }
  try {
    for (const roomtex::CutPanorama& panorama : roomtex::ReadPanoramaSet(path)) {
      if (!panorama.face_camera.Problems().empty()) std::abort();
    }
  } catch (const roomtex::InputError&) {
  }
  return 0;
}
