// Any bytes as model.ply or evidence.ply, for the viewer, for pictures and for the export: an
// InputError or values for every point; never a crash.

#include <cstdint>
#include <cstdlib>

#include "tests/fuzz/memory_file.h"
#include "tests/fuzz/try_read.h"
#include "texture/export/export_scene.h"
#include "texture/output/evidence.h"
#include "texture/render/mesh_renderer.h"
#include "texture/view/view_model.h"

namespace {

// A scan whose colours the file has.
roomtex::Scan OfTheSamePoints(const std::string& path) {
  const roomtex::ColoredMesh mesh = roomtex::ReadColoredMesh(path);
  roomtex::Scan scan;
  scan.organised = false;
  scan.points = mesh.points;
  scan.num_columns = static_cast<int>(mesh.points.size());
  scan.num_rows = 1;
  return scan;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const roomtex::MemoryFile file(data, size);
  const std::string path = file.path();
  roomtex::TryRead([&] {
    const roomtex::ViewModel model = roomtex::ReadViewPly(path);
    for (const roomtex::Triangle& triangle : model.triangles) {
      for (const int corner : triangle) {
        if (corner < 0 || static_cast<size_t>(corner) >= model.points.size()) std::abort();
      }
    }
  });
  roomtex::TryRead([&] {
    const roomtex::ColoredMesh mesh = roomtex::ReadColoredMesh(path);
    if (mesh.colors.size() != mesh.points.size()) std::abort();
    roomtex::FindRoomBox(mesh);
  });
  roomtex::TryRead([&] { roomtex::ReadScanColors({OfTheSamePoints(path)}, path); });
  roomtex::TryRead([&] {
    const roomtex::Evidence evidence = roomtex::ReadEvidence(path);
    if (evidence.disagreement.size() != evidence.points.size()) std::abort();
  });
  return 0;
}
