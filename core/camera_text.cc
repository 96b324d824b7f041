#include "core/camera_text.h"

#include "core/text.h"

namespace roomtex {
namespace {

std::string ParamsText(const Camera& camera, const char* separator, int digits) {
  std::string text;
  for (const double param : camera.params) {
    text += (text.empty() ? "" : separator) + Significant(param, digits);
  }
  return text;
}

}  // namespace

std::string CamerasTextLine(const Camera& camera, int digits) {
  return std::to_string(camera.camera_id) + " " + CameraModelName(camera.model) + " " +
         std::to_string(camera.width) + " " + std::to_string(camera.height) + " " +
         ParamsText(camera, " ", digits) + "\n";
}

std::string FeatureExtractorOptions(const Camera& camera, int digits) {
  return std::string("--ImageReader.single_camera 1 --ImageReader.camera_model ") +
         CameraModelName(camera.model) + " --ImageReader.camera_params " +
         ParamsText(camera, ",", digits);
}

}  // namespace roomtex
