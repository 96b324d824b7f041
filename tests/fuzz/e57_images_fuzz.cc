// Any bytes as an E57 file with photos: an InputError or photos whose cameras can be used, and
// picks that lie in them; never a crash, a file outside of the folder or memory out of proportion.

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>

#include "core/error.h"
#include "core/partial_path.h"
#include "core/progress.h"
#include "importers/e57.h"
#include "importers/e57_images.h"
#include "importers/photo_picks.h"
#include "tests/fuzz/memory_file.h"

namespace {

void Extract(const std::string& path, bool cut_panoramas) {
  const roomtex::PartialFolder folder(std::filesystem::temp_directory_path().string());
  roomtex::E57ImageOptions options;
  options.check = false;
  options.cut_panoramas = cut_panoramas;
  options.faces.size = 8;
  options.faces.around = 4;
  roomtex::Progress quiet(true);
  const roomtex::E57Photos photos = roomtex::ExtractE57Images(path, folder.path(), options, &quiet);
  for (const roomtex::E57Photos::Photo& photo : photos.photos) {
    if (!std::filesystem::is_regular_file(folder / photo.file)) std::abort();
  }
  for (const roomtex::PosedPhoto& photo : photos.posed) {
    if (!photo.camera.Problems().empty()) std::abort();
    if (!(std::abs(photo.cam_from_scan.rotation.norm() - 1) < 1e-3)) std::abort();
    if (!photo.cam_from_scan.translation.allFinite()) std::abort();
  }
  roomtex::E57Options reading;
  reading.check = false;
  const auto scans = roomtex::ReadE57(path, "", reading, nullptr);
  for (const roomtex::PhotoPick& pick : roomtex::PicksOfPosedPhotos(photos.posed, scans)) {
    if (!pick.x_in_img.allFinite() || !pick.x_in_scan.allFinite()) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const roomtex::MemoryFile file(data, size);
  for (const bool cut_panoramas : {false, true}) {
    try {
      Extract(file.path(), cut_panoramas);
    } catch (const roomtex::InputError&) {
    }
  }
  return 0;
}
