#include "texture/output/write_e57.h"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/camera_formulas.h"
#include "core/frames.h"
#include "core/photo.h"
#include "importers/e57_writer.h"

namespace roomtex {
namespace {

constexpr int kJpegQuality = 95;
constexpr float kOutside = -1e6f;  // of every picture: black

cv::Mat Undistorted(const cv::Mat& photo, const Camera& camera, const Camera& pinhole) {
  const CameraProjection projection(camera), target(pinhole);
  cv::Mat map(pinhole.height, pinhole.width, CV_32FC2);
  for (int y = 0; y < map.rows; ++y) {
    auto* row = map.ptr<cv::Vec2f>(y);
    for (int x = 0; x < map.cols; ++x) {
      const Eigen::Vector2d x_in_img = ImgFromOpenCv(Eigen::Vector2d(x, y));
      const auto ray = target.RayFromImg(x_in_img);
      const auto from = ray ? projection.ImgFromCam(*ray) : std::nullopt;
      const Eigen::Vector2d at = from ? OpenCvFromImg(*from) : Eigen::Vector2d(kOutside, kOutside);
      row[x] = {static_cast<float>(at.x()), static_cast<float>(at.y())};
    }
  }
  cv::Mat result;
  cv::remap(photo, result, map, cv::noArray(), cv::INTER_CUBIC, cv::BORDER_CONSTANT);
  return result;
}

E57Writer::Photo PhotoForE57(const PhotoView& view) {
  E57Writer::Photo photo{view.name, "", view.camera, view.cam_from_scan};
  cv::Mat picture = ReadPhoto(view.path, view.pixels);
  const bool is_pinhole = view.camera.model == CameraModel::kPinhole ||
                          view.camera.model == CameraModel::kSimplePinhole;
  if (!is_pinhole && !view.camera.IsPanorama()) {
    photo.camera = UndistortedCamera(view.camera);
    picture = Undistorted(picture, view.camera, photo.camera);
  }
  std::vector<uchar> bytes;
  cv::imencode(".jpg", picture, bytes, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
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
