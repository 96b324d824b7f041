// Any bytes as a camera: the first line as --camera_model, the second as --camera_params, all of it
// as COLMAP's cameras.txt and cameras.bin. Problems in sentences, or a camera whose projection and
// its inverse agree; never a crash.

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "align/clicks/photo_model.h"
#include "colmap_ext/sparse_model_files.h"
#include "core/camera_model.h"
#include "core/error.h"

namespace {

void Project(const roomtex::Camera& camera) {
  if (!camera.Problems().empty()) return;
  const roomtex::CameraProjection projection(camera);
  if (!(projection.max_angle() > 0)) std::abort();
  for (const double across : {0.0, 0.3, 0.5, 1.0}) {
    const Eigen::Vector2d x(across * camera.width, (1 - across) * camera.height);
    const auto ray = projection.RayFromImg(x);
    if (!ray) continue;
    if (!ray->allFinite()) std::abort();
    const auto back = projection.ImgFromCam(*ray);
    if (back && !back->allFinite()) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  const size_t first = text.find('\n'), second = text.find('\n', first + 1);
  if (second != std::string::npos) {
    roomtex::PhotoCameraOptions options;
    options.camera_model = text.substr(0, first);
    options.camera_params = text.substr(first + 1, second - first - 1);
    if (options.Problems().empty() && !options.camera_params.empty()) {
      Project({1, *roomtex::CameraModelFromName(options.camera_model), 640, 480, options.Params()});
    }
  }
  for (const roomtex::SparseModelFormat* format :
       {&roomtex::SparseModelText(), &roomtex::SparseModelBinary()}) {
    try {
      for (const auto& placed : format->parse_cameras(text, "cameras")) Project(placed.entry);
    } catch (const roomtex::InputError&) {
    }
  }
  return 0;
}
