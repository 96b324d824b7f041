#include "core/panorama_faces.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "core/camera_formulas.h"
#include "core/frames.h"
#include "core/option_fields.h"

namespace roomtex {
namespace {

constexpr int kKernelPx = 4;  // reach of Lanczos' kernel

// Faces that look farther up or down than this see rows that the panorama draws out.
constexpr double kSteep_deg = 40;

}  // namespace

void FaceOptions::Declare(OptionFields* fields) {
  fields
      ->Int("Faces.around", &around,
            "Faces that are cut out of a panorama along its horizon, evenly turned; larger = more "
            "overlap, and more work for COLMAP.")
      .Within(3, 36);
  fields->Bool("Faces.poles", &poles, "Also a face straight up and one straight down.");
  fields
      ->Number(
          "Faces.field_of_view_deg", &field_of_view_deg,
          "Degrees; what a face sees across. Neighbours overlap where this is wider than 360 / "
          "Faces.around.")
      .Within(30, 120);
  fields
      ->Int("Faces.size", &size,
            "Pixels; side of a face; 0 = as fine in its middle as the panorama on its horizon.")
      .Within(64, 16384)
      .Or(0)
      .Says("must be 0 (automatic) or lie between 64 and 16384 pixels");
}

std::vector<std::string> FaceOptions::Problems() const { return ProblemsOf(*this); }

std::vector<Eigen::Quaterniond> FaceRotations(const FaceOptions& options) {
  std::vector<Eigen::Quaterniond> rotations;
  for (int i = 0; i < options.around; ++i) {
    // The face's z axis is the panorama's, turned to the right about y (down).
    const double turn = 2 * kPi * i / options.around;
    rotations.emplace_back(Eigen::AngleAxisd(-turn, Eigen::Vector3d::UnitY()));
  }
  if (options.poles) {
    rotations.emplace_back(Eigen::AngleAxisd(-kPi / 2, Eigen::Vector3d::UnitX()));
    rotations.emplace_back(Eigen::AngleAxisd(kPi / 2, Eigen::Vector3d::UnitX()));
  }
  return rotations;
}

Camera FaceCamera(const Camera& panorama, const FaceOptions& options) {
  const double half = std::tan(RadFromDeg(options.field_of_view_deg) / 2);
  Camera face;
  face.camera_id = panorama.camera_id;
  face.model = CameraModel::kSimplePinhole;
  const double fine = 2 * half * panorama.MeanFocalLength();
  face.width = options.size > 0 ? options.size : std::max(64, static_cast<int>(std::lround(fine)));
  face.height = face.width;
  face.params = {0.5 * face.width / half, 0.5 * face.width, 0.5 * face.width};
  face.has_prior_focal_length = true;
  return face;
}

cv::Mat CutFace(const cv::Mat& panorama, const Camera& face,
                const Eigen::Quaterniond& face_from_panorama) {
  const Eigen::Matrix3d panorama_from_face = face_from_panorama.conjugate().toRotationMatrix();
  const bool steep = std::abs(panorama_from_face(1, 2)) > std::sin(RadFromDeg(kSteep_deg));
  const int fine = steep ? 2 : 1;
  Camera camera = face;
  camera.Resize(fine * face.width, fine * face.height);
  const CameraProjection projection(camera);
  const double size[2] = {static_cast<double>(panorama.cols), static_cast<double>(panorama.rows)};
  cv::Mat2f positions(camera.height, camera.width);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const auto ray = projection.RayFromImg({x + 0.5, y + 0.5});
      const Eigen::Vector3d turned = panorama_from_face * ray.value_or(Eigen::Vector3d::UnitZ());
      Eigen::Vector2d at;
      camera_formulas::ProjectToPanorama(size, turned.x(), turned.y(), turned.z(), &at.x(),
                                         &at.y());
      at = OpenCvFromImg(at);
      positions(y, x) = {static_cast<float>(at.x()) + kKernelPx, static_cast<float>(at.y())};
    }
  }
  cv::Mat wrapped, picture;
  cv::copyMakeBorder(panorama, wrapped, 0, 0, kKernelPx, kKernelPx, cv::BORDER_WRAP);
  cv::remap(wrapped, picture, positions, cv::noArray(), cv::INTER_LANCZOS4, cv::BORDER_REPLICATE);
  if (fine > 1) {
    cv::resize(picture, picture, cv::Size(face.width, face.height), 0, 0, cv::INTER_AREA);
  }
  return picture;
}

}  // namespace roomtex
