// Any bytes as a .glb, for the viewer and for pictures: an InputError or a mesh that can be drawn;
// never a crash.

#include <cstdint>
#include <cstdlib>

#include "core/error.h"
#include "tests/fuzz/memory_file.h"
#include "texture/render/mesh_renderer.h"
#include "texture/view/view_model.h"

namespace {

void Draw(const roomtex::ColoredMesh& mesh) {
  if (mesh.triangles.size() > 1000) return;
  const roomtex::RoomBox box = roomtex::FindRoomBox(mesh);
  roomtex::Camera camera;
  camera.model = roomtex::CameraModel::kSimplePinhole;
  camera.width = camera.height = 4;
  camera.params = {2, 2, 2};
  roomtex::RenderSettings settings;
  settings.num_threads = 1;
  const Eigen::Vector3d eye = box.Centre() + Eigen::Vector3d(0, 0, 1);
  roomtex::MeshRenderer(mesh).Render(
      camera, roomtex::LookAt(eye, box.Centre(), Eigen::Vector3d::UnitY()), settings);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const roomtex::MemoryFile file(data, size);
  try {
    const roomtex::ViewModel model = roomtex::ReadViewGlb(file.path(), true);
    if (model.triangles.size() != model.page_of_triangle.size()) std::abort();
    for (size_t i = 0; i < model.triangles.size(); ++i) {
      const int page = model.page_of_triangle[i];
      if (page >= static_cast<int>(model.images.size())) std::abort();
      for (const int corner : model.triangles[i]) {
        const auto at = static_cast<size_t>(corner);
        if (corner < 0 || at >= model.points.size()) std::abort();
        if (page >= 0 ? at >= model.uv.size() : at >= model.colors.size()) std::abort();
      }
    }
  } catch (const roomtex::InputError&) {
  }
  try {
    Draw(roomtex::ReadTexturedMesh(file.path()));
  } catch (const roomtex::InputError&) {
  }
  return 0;
}
