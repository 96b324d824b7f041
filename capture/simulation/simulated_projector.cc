#include "capture/simulation/simulated_projector.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "core/frames.h"
#include "core/photo.h"

namespace roomtex {
namespace {

constexpr double kBlackLevel = 1.0 / 800;  // light of a black pixel, white = 1
constexpr double kLensOpening = 0.008;     // metres
constexpr double kFromWall = 0.34;         // metres from the lens to both walls of a corner
constexpr double kLensHeight = 1.95;

}  // namespace

Projector::Projector(const Camera& camera, const Rigid& proj_from_room, const cv::Mat1b& pattern,
                     double white, double focus, double aperture)
    : camera_(camera),
      proj_from_room_(proj_from_room),
      lens_(proj_from_room.TargetOriginInSource()),
      pattern_(pattern),
      white_(white),
      focus_(focus),
      aperture_(aperture) {
  cv::Mat1f level(pattern.size());
  const std::array<float, 256>& linear = LinearFromSrgbByte();
  std::transform(pattern.begin(), pattern.end(), level.begin(), [&](uchar grey) {
    return static_cast<float>(kBlackLevel + (1 - kBlackLevel) * linear[grey]);
  });
  levels_.push_back(level);
  while (std::min(level.cols, level.rows) > 8) {
    cv::Mat1f half;
    cv::resize(level, half, {(level.cols + 1) / 2, (level.rows + 1) / 2}, 0, 0, cv::INTER_AREA);
    levels_.push_back(half);
    level = half;
  }
}

std::optional<Eigen::Vector2d> Projector::PatternFromRoom(const Eigen::Vector3d& x_in_room) const {
  const Eigen::Vector3d x = proj_from_room_ * x_in_room;
  if (x.z() < 1e-6) return std::nullopt;
  return Eigen::Vector2d(camera_.params[0] * x.x() / x.z() + camera_.params[2],
                         camera_.params[1] * x.y() / x.z() + camera_.params[3]);
}

double Projector::LightAt(const Eigen::Vector3d& x_in_room, const Eigen::Vector3d& normal_in_room,
                          const Eigen::Vector3d& side_x, const Eigen::Vector3d& side_y) const {
  const auto at = PatternFromRoom(x_in_room);
  if (!at) return 0;
  const Eigen::Vector3d to_lens = lens_ - x_in_room;
  const double distance = to_lens.norm();
  const double cosine = normal_in_room.dot(to_lens) / distance;
  if (cosine <= 0) return 0;
  const double z = (proj_from_room_ * x_in_room).z();
  // What the lens leaves unsharp, in pixels of the pattern; never sharper than its pixels.
  const double blur = camera_.params[0] * aperture_ * std::abs(1 / z - 1 / focus_);
  const double least = std::hypot(1.0, blur);
  const auto side_in_pattern = [&](const Eigen::Vector3d& side) -> Eigen::Vector2d {
    const auto next = PatternFromRoom(x_in_room + side);
    return next ? Eigen::Vector2d(*next - *at) : Eigen::Vector2d(0, 0);
  };
  // As RoomScene::Color: a long footprint is averaged from several short ones along it.
  const Eigen::Vector2d x = side_in_pattern(side_x), y = side_in_pattern(side_y);
  const Eigen::Vector2d& longer = x.squaredNorm() > y.squaredNorm() ? x : y;
  const double length = longer.norm();
  const double area = std::abs(x.x() * y.y() - x.y() * y.x());
  const double width = std::hypot(length > 0 ? area / length : 0.0, least);
  const int taps = std::clamp(static_cast<int>(std::ceil(length / width - 0.25)), 1, 6);
  const double footprint = std::max(width, length / taps);
  double shown = 0;
  for (int i = 0; i < taps; ++i) {
    shown += LookUp(*at + ((i + 0.5) / taps - 0.5) * longer, footprint) / taps;
  }
  // The intensity grows with 1 / cos^3 of the angle to the axis, as that of every projector that
  // lights a screen evenly; (distance / z)^3 / distance^2.
  return white_ * shown * cosine * distance / (z * z * z);
}

double Projector::LookUp(const Eigen::Vector2d& x_in_pattern, double width) const {
  const double level = std::clamp(std::log2(width), 0.0, static_cast<double>(levels_.size() - 1));
  const int finer = static_cast<int>(level);
  const double t = level - finer;
  const double fine = LookUpLevel(x_in_pattern, finer);
  return t > 0 ? (1 - t) * fine + t * LookUpLevel(x_in_pattern, finer + 1) : fine;
}

double Projector::LookUpLevel(const Eigen::Vector2d& x_in_pattern, int level) const {
  const cv::Mat1f& image = levels_[level];
  const double x = x_in_pattern.x() * image.cols / pattern_.cols - 0.5;
  const double y = x_in_pattern.y() * image.rows / pattern_.rows - 0.5;
  if (!(x > -1 && y > -1 && x < image.cols && y < image.rows)) return 0;
  const int column = static_cast<int>(std::floor(x)), row = static_cast<int>(std::floor(y));
  const double s = x - column, t = y - row;
  // Nothing shines beyond the picture.
  const auto value = [&](int r, int c) {
    return r < 0 || c < 0 || r >= image.rows || c >= image.cols ? 0.0f : image(r, c);
  };
  return (1 - t) * ((1 - s) * value(row, column) + s * value(row, column + 1)) +
         t * ((1 - s) * value(row + 1, column) + s * value(row + 1, column + 1));
}

double Projector::Flux() const {
  const double area_at_1m =
      (camera_.width / camera_.params[0]) * (camera_.height / camera_.params[1]);
  return white_ * area_at_1m * cv::mean(levels_[0])[0];
}

std::vector<Rigid> PlaceProjectors(const SimulatedRoomOptions& options) {
  const double w = options.width, d = options.depth, near = kFromWall;
  const Eigen::Vector2d places[kMaxProjectors] = {
      {near, near},    {w - near, d - near}, {w - near, near}, {near, d - near},
      {near, 0.5 * d}, {w - near, 0.5 * d},  {0.5 * w, near},  {0.5 * w, d - near}};
  std::vector<Rigid> room_from_proj;
  for (int k = 0; k < options.projectors; ++k) {
    const Eigen::Vector3d lens(places[k].x(), places[k].y(), kLensHeight);
    const Eigen::Vector3d aim(w - places[k].x(), d - places[k].y(), 0.5 * options.height - 0.25);
    const Eigen::Vector3d forward = (aim - lens).normalized();
    const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
    Eigen::Matrix3d axes;
    axes << right, forward.cross(right), forward;
    room_from_proj.push_back({Eigen::Quaterniond(axes), lens});
  }
  return room_from_proj;
}

void AddProjectorBody(const Rigid& room_from_proj, RoomScene* scene) {
  const int dark =
      scene->AddSurface({MakePlain(RgbFromSrgb(62, 62, 66)), {0.1f, 0.5f, {0.3f, 0.3f, 0.3f}}});
  // Level, the front a centimetre behind the lens; x right, y forward, z up.
  const Eigen::Vector3d axis = room_from_proj.rotation * Eigen::Vector3d::UnitZ();
  const double yaw = std::atan2(axis.y(), axis.x()) - kPi / 2;
  const Rigid room_from_body{Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())),
                             room_from_proj.translation};
  const auto placed = [&](double x, double y, double z) {
    return Rigid{room_from_body.rotation, room_from_body * Eigen::Vector3d(x, y, z)};
  };
  scene->AddBox(dark, placed(-0.16, -0.25, -0.06), {0.32, 0.24, 0.12});
  const double foot = -room_from_proj.translation.z();
  scene->AddBox(dark, placed(-0.02, -0.15, foot), {0.04, 0.04, -foot - 0.06}, 2);
  scene->AddBox(dark, placed(-0.15, -0.28, foot), {0.3, 0.3, 0.02});
}

Projector MakeProjector(const SimulatedRoomOptions& options, int k, const Rigid& room_from_proj) {
  const cv::Mat1b pattern = options.pattern(options.projector_width, options.projector_height,
                                            options.same_pattern ? 1 : k + 1);
  Camera camera;
  camera.camera_id = static_cast<uint32_t>(k + 1);
  camera.model = CameraModel::kPinhole;
  camera.width = pattern.cols;
  camera.height = pattern.rows;
  const double focal =
      0.5 * camera.width / std::tan(RadFromDeg(options.projector_field_of_view_deg) / 2);
  camera.params = {focal, focal, 0.5 * camera.width, 0.5 * camera.height};
  return Projector(camera, room_from_proj.Inverse(), pattern, options.projector_light,
                   options.projector_focus, kLensOpening);
}

double RoomArea(const SimulatedRoomOptions& options) {
  return 2 * (options.width * options.depth + options.width * options.height +
              options.depth * options.height);
}

ProjectedLight::ProjectedLight(const std::vector<Projector>& projectors, const RoomScene& scene,
                               double room_area)
    : projectors_(projectors), scene_(scene) {
  // An integrating sphere: of all light the share kReflected comes back, again and again.
  constexpr double kReflected = 0.55;
  for (const Projector& projector : projectors) {
    ambient_ += projector.Flux() * kReflected / (1 - kReflected) / room_area;
  }
}

ProjectedLight::Arrival ProjectedLight::At(const SceneHit& hit, const Eigen::Vector3d& side_x,
                                           const Eigen::Vector3d& side_y) const {
  Arrival arrival;
  const Patch& patch = scene_.patches()[hit.patch];
  if (patch.shines) return arrival;
  double light = ambient_;
  for (size_t k = 0; k < projectors_.size(); ++k) {
    const Eigen::Vector3d lens = projectors_[k].Lens();
    Eigen::Vector3d normal = patch.Normal();
    double share = 1;
    if (patch.two_sided) {
      // Thin: either side sends out half of it.
      if (normal.dot(lens - hit.point) < 0) normal = -normal;
      share = 0.5;
    }
    const double direct = share * projectors_[k].LightAt(hit.point, normal, side_x, side_y);
    if (direct <= 0 || scene_.IsOccluded(lens, hit.point)) continue;
    light += direct;
    arrival.lit_by |= 1u << k;
  }
  arrival.light = static_cast<float>(light);
  return arrival;
}

}  // namespace roomtex
