#include "capture/simulation/photo_renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <opencv2/imgproc.hpp>

#include "capture/simulation/camera_faults.h"
#include "capture/simulation/simulated_projector.h"
#include "core/parallel.h"
#include "core/photo.h"
#include "core/random_stream.h"

namespace roomtex {
namespace {

// Mean 0, standard deviation 1: the sum of four even 16-bit numbers. Its tails end at 3.5, which
// noise of a few grey levels does not show.
float NearlyGaussian(uint64_t bits) {
  const uint64_t sum =
      (bits & 0xffff) + (bits >> 16 & 0xffff) + (bits >> 32 & 0xffff) + (bits >> 48);
  return (static_cast<float>(sum) / 65536.0f - 2.0f + 2.0f / 65536.0f) * 1.7320508f;
}

// Light spread evenly over a straight way, whose middle stays where it is.
cv::Mat MotionKernel(const Eigen::Vector2d& motion) {
  const int radius = static_cast<int>(std::ceil(motion.cwiseAbs().maxCoeff() / 2)) + 1;
  cv::Mat kernel = cv::Mat::zeros(2 * radius + 1, 2 * radius + 1, CV_32F);
  const int steps = 16 * radius;
  for (int i = 0; i < steps; ++i) {
    const Eigen::Vector2d at =
        motion * ((i + 0.5) / steps - 0.5) + Eigen::Vector2d::Constant(radius);
    const int x = static_cast<int>(at.x()), y = static_cast<int>(at.y());
    const auto s = static_cast<float>(at.x() - x), t = static_cast<float>(at.y() - y);
    const float weight = 1.0f / static_cast<float>(steps);
    kernel.at<float>(y, x) += weight * (1 - s) * (1 - t);
    kernel.at<float>(y, x + 1) += weight * s * (1 - t);
    kernel.at<float>(y + 1, x) += weight * (1 - s) * t;
    kernel.at<float>(y + 1, x + 1) += weight * s * t;
  }
  return kernel;
}

}  // namespace

PhotoRenderer::PhotoRenderer(const RoomScene& scene, const CameraProjection& camera)
    : scene_(scene),
      width_(camera.camera().width),
      height_(camera.camera().height),
      principal_point_(camera.ImgFromCam(Eigen::Vector3d::UnitZ())
                           .value_or(Eigen::Vector2d(width_ / 2.0, height_ / 2.0))),
      lattice_columns_((width_ + kStep - 1) / kStep + 2) {
  const int rows = (height_ + kStep - 1) / kStep + 2;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < lattice_columns_; ++column) {
      Eigen::Vector2d at(column * kStep, row * kStep);
      if (camera.camera().IsPanorama()) at.y() = std::min<double>(at.y(), height_);
      const auto ray = camera.RayFromImg(at);
      lattice_.push_back(ray ? *ray : Eigen::Vector3d(nan, nan, nan));
    }
  }
}

Eigen::Vector3d PhotoRenderer::RayAt(double x_in_img, double y_in_img) const {
  const double x = x_in_img / kStep, y = y_in_img / kStep;
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  const double s = x - column, t = y - row;
  const Eigen::Vector3d* node = &lattice_[row * lattice_columns_ + column];
  return (1 - t) * ((1 - s) * node[0] + s * node[1]) +
         t * ((1 - s) * node[lattice_columns_] + s * node[lattice_columns_ + 1]);
}

PhotoRenderer::Shot PhotoRenderer::Shoot(const Pose& room_from_cam, double x_in_img,
                                         double y_in_img, double pixel_size,
                                         const PhotoSettings& settings) const {
  const auto direction_at = [&](double x, double y) -> Eigen::Vector3d {
    return room_from_cam.leftCols<3>() * RayAt(x, y).normalized();
  };
  Eigen::Vector3d origin = room_from_cam.col(3);
  Eigen::Vector3d direction = direction_at(x_in_img, y_in_img);
  Shot shot;
  if (!(direction.x() == direction.x())) return shot;
  Eigen::Vector3d next_x = direction_at(x_in_img + pixel_size, y_in_img);
  Eigen::Vector3d next_y = direction_at(x_in_img, y_in_img + pixel_size);
  std::optional<SceneHit> hit = scene_.Cast(origin, direction);
  LinearRgb tint = LinearRgb::Ones();
  if (hit && scene_.SurfaceOf(hit->patch).kind == Surface::Kind::kMirror) {
    // What the camera's mirror image sees beyond the glass.
    tint = scene_.SurfaceOf(hit->patch).texture->Albedo({0, 0}, 0);
    shot.place = hit->patch * 100000;
    const Eigen::Vector3d normal = scene_.patches()[hit->patch].Normal();
    const Eigen::Matrix3d reflection =
        Eigen::Matrix3d::Identity() - 2 * normal * normal.transpose();
    origin = hit->point + reflection * (origin - hit->point);
    direction = reflection * direction;
    next_x = reflection * next_x;
    next_y = reflection * next_y;
    hit = scene_.Cast(origin, direction, hit->distance + 1e-3);
  }
  if (!hit) {
    shot.color = LinearRgb(0.7f, 0.8f, 0.9f);
    return shot;
  }
  shot.place += hit->patch;
  const Eigen::Vector3d normal = scene_.patches()[hit->patch].Normal();
  const Eigen::Vector3d side_x = OffsetOnPlane(origin, next_x, hit->point, normal);
  const Eigen::Vector3d side_y = OffsetOnPlane(origin, next_y, hit->point, normal);
  LinearRgb added = LinearRgb::Zero();
  if (settings.projected != nullptr) {
    const ProjectedLight::Arrival arrival = settings.projected->At(*hit, side_x, side_y);
    added.setConstant(arrival.light);
    // A border of a shadow is a border like that of a surface.
    shot.place = static_cast<int>(MixBits(shot.place, arrival.lit_by));
  }
  LinearRgb color = scene_.Color(*hit, side_x, side_y, added);
  if (settings.gloss > 0 && scene_.SurfaceOf(hit->patch).varnished) {
    // Schlick 1994, "An Inexpensive BRDF Model for Physically-based Rendering" (15).
    const double flat = 1 - std::abs(normal.dot(direction));
    const auto mirrored =
        static_cast<float>(settings.gloss + (1 - settings.gloss) * std::pow(flat, 5));
    color = (1 - mirrored) * color + mirrored * Reflection(*hit, direction);
  }
  shot.color = tint.cwiseProduct(color);
  return shot;
}

LinearRgb PhotoRenderer::Reflection(const SceneHit& hit, const Eigen::Vector3d& direction) const {
  constexpr int kSide = 4;  // rays: its square
  constexpr double kSpread =
      0.12;  // side of the bundle of rays at distance 1: varnish is not glass
  // A photo shows lamp and sky as white, whatever their light.
  constexpr float kShine = 4;
  Eigen::Vector3d normal = scene_.patches()[hit.patch].Normal();
  if (normal.dot(direction) > 0) normal = -normal;
  const Eigen::Vector3d mirrored = direction - 2 * normal.dot(direction) * normal;
  const Eigen::Vector3d u = mirrored.unitOrthogonal(), v = mirrored.cross(u);
  LinearRgb sum = LinearRgb::Zero();
  for (int i = 0; i < kSide * kSide; ++i) {
    const double s = (i % kSide + 0.5) / kSide - 0.5, t = (i / kSide + 0.5) / kSide - 0.5;
    const auto towards = [&](double ds, double dt) -> Eigen::Vector3d {
      return (mirrored + kSpread * ((s + ds) * u + (t + dt) * v)).normalized();
    };
    Eigen::Vector3d ray = towards(0, 0);
    ray += std::max(0.0, 0.02 - normal.dot(ray)) * normal;  // not into the surface
    const std::optional<SceneHit> seen = scene_.Cast(hit.point, ray.normalized(), 1e-3);
    if (!seen) {
      sum += LinearRgb(0.7f, 0.8f, 0.9f);
      continue;
    }
    const Eigen::Vector3d facing = scene_.patches()[seen->patch].Normal();
    const LinearRgb light =
        scene_.Color(*seen, OffsetOnPlane(hit.point, towards(1.0 / kSide, 0), seen->point, facing),
                     OffsetOnPlane(hit.point, towards(0, 1.0 / kSide), seen->point, facing));
    sum += (scene_.SurfaceOf(seen->patch).shines ? kShine : 1.0f) * light;
  }
  return sum / (kSide * kSide);
}

cv::Mat PhotoRenderer::Render(const RowPoses& poses, const PhotoSettings& settings,
                              int num_threads) const {
  const bool upright = height_ > width_;  // RowsAreUpright()
  const int num_rows = upright ? width_ : height_;
  std::vector<Pose> room_from_row(num_rows);
  for (int i = 0; i < num_rows; ++i) {
    room_from_row[i] = poses.At((i + 0.5) / num_rows - 0.5).Inverse().Matrix();
  }
  cv::Mat linear(height_, width_, CV_32FC3);
  cv::Mat place(height_, width_, CV_32S);
  ParallelFor(num_threads, 0, height_, [&](int y) {
    for (int x = 0; x < width_; ++x) {
      const Pose& room_from_cam = room_from_row[upright ? x : y];
      const Shot shot = Shoot(room_from_cam, x + 0.5, y + 0.5, 1, settings);
      linear.at<cv::Vec3f>(y, x) = {shot.color.z(), shot.color.y(), shot.color.x()};
      place.at<int>(y, x) = shot.place;
    }
  });
  // Where surfaces meet, a pixel is the mean of 3 x 3 rays; elsewhere the texture itself averages.
  constexpr int kSide = 3;
  ParallelFor(num_threads, 0, height_, [&](int y) {
    for (int x = 0; x < width_; ++x) {
      const int here = place.at<int>(y, x);
      bool border = false;
      for (int dy = std::max(0, y - 1); dy <= std::min(height_ - 1, y + 1); ++dy) {
        for (int dx = std::max(0, x - 1); dx <= std::min(width_ - 1, x + 1); ++dx) {
          border = border || place.at<int>(dy, dx) != here;
        }
      }
      if (!border) continue;
      LinearRgb sum = LinearRgb::Zero();
      for (int k = 0; k < kSide * kSide; ++k) {
        sum += Shoot(room_from_row[upright ? x : y], x + (k % kSide + 0.5) / kSide,
                     y + (k / kSide + 0.5) / kSide, 1.0 / kSide, settings)
                   .color;
      }
      sum /= kSide * kSide;
      linear.at<cv::Vec3f>(y, x) = {sum.z(), sum.y(), sum.x()};
    }
  });
  cv::Mat photo;
  Develop(linear, settings, num_threads, &photo);
  return photo;
}

void PhotoRenderer::Develop(const cv::Mat& linear, const PhotoSettings& settings, int num_threads,
                            cv::Mat* photo) const {
  cv::Mat light = linear;
  if (settings.blur_px > 0) cv::GaussianBlur(linear, light, {0, 0}, settings.blur_px);
  if (!settings.motion_px.isZero()) {
    cv::Mat moved;
    cv::filter2D(light, moved, CV_32F, MotionKernel(settings.motion_px));
    light = moved;
  }
  photo->create(height_, width_, CV_8UC3);
  const Eigen::Vector3f gain =
      static_cast<float>(std::exp2(settings.exposure_ev)) * settings.white_balance;
  const ResponseTable response(settings.response);
  const double diagonal2 = (width_ * width_ + height_ * height_) / 4.0;
  const auto noise = static_cast<float>(settings.noise);
  ParallelFor(num_threads, 0, height_, [&](int y) {
    RandomStream random(MixBits(settings.noise_seed, y));
    for (int x = 0; x < width_; ++x) {
      const cv::Vec3f& value = light.at<cv::Vec3f>(y, x);
      const double radius2 =
          (Eigen::Vector2d(x + 0.5, y + 0.5) - principal_point_).squaredNorm() / diagonal2;
      const auto lens = static_cast<float>(VignettingAt(radius2, settings.vignetting));
      cv::Vec3b& pixel = photo->at<cv::Vec3b>(y, x);
      for (int k = 0; k < 3; ++k) {
        float grey = response.Grey(lens * gain[2 - k] * value[k]);
        if (noise > 0) grey += noise * NearlyGaussian(random.Bits());
        pixel[k] = cv::saturate_cast<uchar>(grey);
      }
    }
  });
}

}  // namespace roomtex
