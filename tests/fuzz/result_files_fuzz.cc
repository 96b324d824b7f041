// Any bytes as what commands read of each other's results: panoramas.json, roomtex-mapper.json, and
// of report.json what the viewer shows; an InputError or an answer, never a crash.

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "colmap_ext/mapper_verdict.h"
#include "core/error.h"
#include "core/panorama_set.h"
#include "core/partial_path.h"
#include "texture/view/view_lumigraph.h"
#include "texture/view/view_shifts.h"

namespace {

template <typename Read>
void Try(const Read& read) {
  try {
    read();
  } catch (const roomtex::InputError&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const roomtex::PartialFolder folder(std::filesystem::temp_directory_path().string());
  for (const char* name : {"roomtex-mapper.json", "report.json"}) {
    std::ofstream stream(folder / name, std::ios::binary);
    stream.write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  }
  Try([&] {
    for (const roomtex::CutPanorama& one : roomtex::ReadPanoramaSet(folder / "report.json")) {
      one.PanoramaCamera();
      for (const roomtex::CutPanorama::Face& face : one.faces) {
        if (!(std::abs(face.face_from_panorama.norm() - 1) < 1e-3)) std::abort();
      }
    }
  });
  Try([&] { roomtex::ReadMapperVerdict(folder.path(), roomtex::SparseModel()); });
  Try([&] { roomtex::ReadViewShifts(folder.path()); });
  Try([&] { roomtex::ReadViewTones(folder.path()); });
  return 0;
}
