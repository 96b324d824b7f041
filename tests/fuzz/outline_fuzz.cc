// Any bytes as an outline.json: an InputError or buildings that become closed solids, and are the
// same once they are written and read again; never a crash.

#include <cstdint>
#include <cstdlib>

#include "building/building_solid.h"
#include "building/outline.h"
#include "core/error.h"
#include "tests/fuzz/memory_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const roomtex::MemoryFile file(data, size);
  roomtex::WasEdited(file.path());
  try {
    const roomtex::Outline outline = roomtex::ReadOutline(file.path());
    for (const roomtex::OutlineBuilding& building : outline.buildings) {
      building.RoofShape();
      const roomtex::BuildingSolid solid = roomtex::ExtrudeBuilding(building);
      for (const roomtex::SolidFace& face : solid.faces) roomtex::TrianglesOf(solid, face);
      for (const Eigen::Vector3d& vertex : solid.vertices) {
        if (!vertex.allFinite()) std::abort();
      }
    }
    roomtex::OutlineToJson(outline);
  } catch (const roomtex::InputError&) {
  }
  return 0;
}
