// Any bytes as a sparse model: an InputError or a model that holds together, never a crash.
// The first byte chooses the format; the rest is cut into the three files at a marker.

#include <cstdint>
#include <cstdlib>
#include <string>

#include "colmap_ext/sparse_model_files.h"
#include "core/error.h"

namespace {

// Every track element must answer its keypoint; aborts otherwise.
void RequireWhole(roomtex::SparseModel model) {
  for (const auto& [id, point] : model.points) {
    for (const roomtex::TrackElement& element : point.track) {
      const roomtex::SparseImage& image = model.images.at(element.image_id);
      if (image.point3d_ids.at(element.point2d_index) != id) std::abort();
    }
  }
  roomtex::UpdateReprojectionErrors(&model);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const roomtex::SparseModelFormat& format =
      data[0] % 2 == 0 ? roomtex::SparseModelBinary() : roomtex::SparseModelText();
  const std::string marker = "----";
  std::string rest(reinterpret_cast<const char*>(data) + 1, size - 1);
  std::string files[3];
  for (std::string& file : files) {
    const size_t end = rest.find(marker);
    file = rest.substr(0, end);
    rest = end == std::string::npos ? "" : rest.substr(end + marker.size());
  }
  try {
    RequireWhole(roomtex::AssembleSparseModel(
        format, "folder", format.parse_cameras(files[0], "cameras"),
        format.parse_images(files[1], "images"), format.parse_points(files[2], "points3D")));
  } catch (const roomtex::InputError&) {
  }
  return 0;
}
