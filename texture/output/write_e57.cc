#include "texture/output/write_e57.h"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/camera_formulas.h"
#include "core/photo.h"
#include "core/undistortion.h"
#include "importers/e57_writer.h"

namespace roomtex {
namespace {

constexpr int kPhotoJpegQuality = 95;

E57Writer::Photo PhotoForE57(const PhotoView& view) {
  E57Writer::Photo photo{view.name, "", view.camera, view.cam_from_scan};
  cv::Mat picture = ReadPhoto(view.path, view.pixels);
  const cv::Mat1b transparent = ReadTransparency(view.path, view.pixels);
  if (!transparent.empty()) {
    cv::cvtColor(picture, picture, cv::COLOR_BGR2BGRA);
    cv::insertChannel(transparent == 0, picture, 3);
  }
  const bool is_pinhole = view.camera.model == CameraModel::kPinhole ||
                          view.camera.model == CameraModel::kSimplePinhole;
  if (!is_pinhole && !view.camera.IsPanorama()) {
    photo.camera = UndistortedCamera(view.camera);
    picture = UndistortPhoto(picture, view.camera, photo.camera).picture;
  }
  std::vector<uchar> bytes;
  cv::imencode(transparent.empty() ? ".jpg" : ".png", picture, bytes,
               {cv::IMWRITE_JPEG_QUALITY, kPhotoJpegQuality});
  photo.bytes.assign(bytes.begin(), bytes.end());
  return photo;
}

}  // namespace

Camera UndistortedCamera(const Camera& camera) {
  Camera pinhole = camera;
  pinhole.model = CameraModel::kPinhole;
  const std::vector<double>& p = camera.params;
  pinhole.params = camera_formulas::HasOneFocalLength(camera.model)
                       ? std::vector<double>{p[0], p[0], p[1], p[2]}
                       : std::vector<double>(p.begin(), p.begin() + 4);
  return pinhole;
}

void WriteColoredE57(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                     const std::vector<PhotoView>* photos, const std::string& path) {
  E57Writer writer(path);
  for (size_t s = 0; s < scans.size(); ++s) {
    writer.AddScan(scans[s], &colored[s].samples.rgb);
  }
  if (photos != nullptr) {
    for (const PhotoView& view : *photos) writer.AddPhoto(PhotoForE57(view));
  }
  writer.Commit();
}

}  // namespace roomtex
