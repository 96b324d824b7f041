// Any bytes as what commands read of each other's results: panoramas.json, roomtex-mapper.json, and
// of report.json what the viewer shows; an InputError or an answer, never a crash.

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "colmap_ext/mapper_verdict.h"
#include "core/panorama_set.h"
#include "core/partial_path.h"
#include "tests/fuzz/try_read.h"
#include "texture/view/view_lumigraph.h"
#include "texture/view/view_shifts.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const roomtex::PartialFolder folder(std::filesystem::temp_directory_path().string());
  for (const char* name : {"roomtex-mapper.json", "report.json"}) {
    std::ofstream stream(folder / name, std::ios::binary);
    stream.write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  }
  roomtex::TryRead([&] {
    for (const roomtex::CutPanorama& one : roomtex::ReadPanoramaSet(folder / "report.json")) {
      one.PanoramaCamera();
      for (const roomtex::CutPanorama::Face& face : one.faces) {
        if (!(std::abs(face.face_from_panorama.norm() - 1) < 1e-3)) std::abort();
      }
    }
  });
  roomtex::TryRead([&] { roomtex::ReadMapperVerdict(folder.path(), roomtex::SparseModel()); });
  roomtex::TryRead([&] { roomtex::ReadViewShifts(folder.path()); });
  roomtex::TryRead([&] { roomtex::ReadViewTones(folder.path()); });
  return 0;
}
