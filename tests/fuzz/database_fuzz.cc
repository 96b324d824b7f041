// Any bytes as COLMAP's database: an InputError or rows that agree with each other, and a copy of
// them; never a crash, and nothing that a schema says is run.

#include <cstdint>
#include <cstdlib>
#include <filesystem>

#include "colmap_ext/database.h"
#include "core/error.h"
#include "core/partial_path.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const roomtex::PartialFolder folder(std::filesystem::temp_directory_path().string());
  const std::string path = folder / "database.db", copy = folder / "copy.db";
  std::FILE* const file = std::fopen(path.c_str(), "wb");
  if (file == nullptr || std::fwrite(data, 1, size, file) != size) std::abort();
  std::fclose(file);
  try {
    const roomtex::Database database(path);
    const auto cameras = database.ReadCameras();
    for (const auto& [image_id, image] : database.ReadImages()) {
      if (cameras.count(image.camera_id) == 0) std::abort();
      database.ReadKeypoints(image_id);
    }
    database.ReadPairs(0);
    std::filesystem::remove(copy);
    database.CopyWithCameras(copy, cameras);
    roomtex::Database(copy).ReadImages();
  } catch (const roomtex::InputError&) {
  }
  return 0;
}
