#include "capture/simulation/room_cameras.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "capture/simulation/simulated_projector.h"
#include "core/camera_formulas.h"
#include "core/frames.h"
#include "core/random_stream.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// Distortion of an ordinary lens: barrel, a few per cent at the border.
std::vector<double> DistortionOf(CameraModel model) {
  switch (model) {
    case CameraModel::kSimplePinhole:
    case CameraModel::kPinhole:
      return {};
    case CameraModel::kSimpleRadial:
      return {-0.06};
    case CameraModel::kRadial:
      return {-0.08, 0.03};
    case CameraModel::kOpenCv:
      return {-0.08, 0.03, 0.0008, -0.0006};
    case CameraModel::kFullOpenCv:
      return {-0.05, 0.02, 0.0008, -0.0006, 0.001, 0.03, 0.002, 0.0005};
    case CameraModel::kFov:
      return {0.6};
    case CameraModel::kSimpleRadialFisheye:
      return {0.02};
    case CameraModel::kRadialFisheye:
      return {0.02, -0.01};
    case CameraModel::kOpenCvFisheye:
      return {0.02, -0.01, 0.003, -0.001};
    case CameraModel::kThinPrismFisheye:
      return {0.02, -0.01, 0.0006, -0.0004, 0.003, -0.001, 0.0005, 0.0004};
    case CameraModel::kRadTanThinPrismFisheye:
      return {0.02,   -0.01,   0.003,  -0.001,  0.0003, -0.0001,
              0.0006, -0.0004, 0.0005, -0.0002, 0.0004, 0.0001};
    case CameraModel::kSimpleDivision:
    case CameraModel::kDivision:
      return {-0.07};
    case CameraModel::kSimpleFisheye:
    case CameraModel::kFisheye:
    case CameraModel::kEquirectangular:
      return {};
    case CameraModel::kEucm:
      return {0.55, 1.05};
  }
  return {};
}

// Distance to the nearest surface, over directions all around.
double ClearanceAround(const RoomScene& scene, const Eigen::Vector3d& place) {
  double nearest = std::numeric_limits<double>::infinity();
  constexpr int kDirections = 120;
  for (int i = 0; i < kDirections; ++i) {
    // Spiral of even density on the sphere.
    const double z = 1 - (2 * i + 1.0) / kDirections, radius = std::sqrt(1 - z * z),
                 turn = 2.399963 * i;
    const auto hit = scene.Cast(place, {radius * std::cos(turn), radius * std::sin(turn), z});
    if (hit) nearest = std::min(nearest, hit->distance);
  }
  return nearest;
}

// x right, y down, z forward; yaw from the x axis of the room, counter-clockwise; pitch up.
Eigen::Quaterniond CamFromRoomRotation(double yaw, double pitch, double roll) {
  const Eigen::Vector3d forward(std::cos(pitch) * std::cos(yaw), std::cos(pitch) * std::sin(yaw),
                                std::sin(pitch));
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d room_from_cam;
  room_from_cam << right, forward.cross(right), forward;
  const Eigen::AngleAxisd about_axis(roll, Eigen::Vector3d::UnitZ());
  return Eigen::Quaterniond(room_from_cam * about_axis.toRotationMatrix()).conjugate();
}

Rigid PoseAt(const Eigen::Vector3d& place, double yaw, double pitch, double roll) {
  Rigid pose;
  pose.rotation = CamFromRoomRotation(yaw, pitch, roll);
  pose.translation = -(pose.rotation * place);
  return pose;
}

// Free space around a tripod of this height.
double TripodClearance(const RoomScene& scene, double x, double y, double height) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const double z : {0.15, 0.5, 0.85, 1.2, height, height + 0.2}) {
    for (int i = 0; i < 24; ++i) {
      const double angle = 2 * kPi * i / 24;
      const auto hit = scene.Cast({x, y, z}, {std::cos(angle), std::sin(angle), 0});
      if (hit) nearest = std::min(nearest, hit->distance);
    }
  }
  return nearest;
}

// A light meter of 40 x 27 places; the window may burn out. The brightest channel of each, EV 0.
std::vector<float> MeterPlaces(const RoomScene& scene, const ProjectedLight* projected,
                               const CameraProjection& projection, const Rigid& cam_from_room) {
  std::vector<float> brightest;
  const Camera& camera = projection.camera();
  const Rigid room_from_cam = cam_from_room.Inverse();
  const Eigen::Vector3d point_like = Eigen::Vector3d::Zero();
  for (int k = 0; k < 40 * 27; ++k) {
    const Eigen::Vector2d at((k % 40 + 0.5) / 40 * camera.width,
                             (k / 40 + 0.5) / 27 * camera.height);
    const auto ray = projection.RayFromImg(at);
    if (!ray) continue;
    const Eigen::Vector3d direction = room_from_cam.rotation * ray->normalized();
    const auto hit = scene.Cast(room_from_cam.translation, direction);
    if (!hit || scene.patches()[hit->patch].shines) continue;
    LinearRgb added = LinearRgb::Zero();
    if (projected != nullptr) added.setConstant(projected->At(*hit, point_like, point_like).light);
    brightest.push_back(scene.Color(*hit, point_like, point_like, added).maxCoeff());
  }
  return brightest;
}

// The value that only 1 % of the places exceed.
float Brightest(std::vector<float> brightest) {
  return AtRank(&brightest, brightest.size() * 99 / 100);
}

constexpr double kBurnsOut = 0.95;
// A camera that sees all around is held almost upright.
constexpr double kLevelShare = 0.2;

}  // namespace

Camera MakeRoomCamera(const SimulatedRoomOptions& options) {
  Camera camera;
  camera.camera_id = 1;
  camera.model = *CameraModelFromName(options.camera_model);
  camera.width = options.photo_width;
  camera.height = options.photo_height;
  camera.has_prior_focal_length = true;
  if (camera.IsPanorama()) {
    camera.params = {static_cast<double>(camera.width), static_cast<double>(camera.height)};
    return camera;
  }
  const bool fisheye =
      camera_formulas::FlatteningOf(camera.model) == camera_formulas::Flattening::kEquidistant;
  const double half_angle = RadFromDeg(options.field_of_view_deg) / 2;
  std::vector<double> distortion = DistortionOf(camera.model);
  if (!options.distortion) std::fill(distortion.begin(), distortion.end(), 0.0);
  if (!options.distortion && camera.model == CameraModel::kEucm) distortion = {0, 1};  // a pinhole
  double border = fisheye ? half_angle : std::tan(half_angle);                         // flattened
  if (!fisheye && !camera.IsPerspective()) {
    double beside = 0;
    camera_formulas::Flatten(camera.model, distortion.data(), std::sin(half_angle), 0.0,
                             std::cos(half_angle), &border, &beside);
  }
  const double focal = 0.5 * camera.width / border;
  // The optical axis of a real camera misses the middle of the sensor a little.
  const double cx = 0.503 * camera.width, cy = 0.497 * camera.height;
  if (camera_formulas::HasOneFocalLength(camera.model)) {
    camera.params = {focal, cx, cy};
  } else {
    camera.params = {focal, 1.0006 * focal, cx, cy};
  }
  camera.params.insert(camera.params.end(), distortion.begin(), distortion.end());
  return camera;
}

namespace {

// Of a drawn layout: from anywhere in the room, clear of what stands there, towards any other place
// that is not right before the camera.
Rigid DrawCamera(const SimulatedRoomOptions& options, const RoomScene& scene,
                 const Rigid& scene_from_room, int photo) {
  constexpr double kFromWall = 0.6, kClear = 0.35, kAhead = 1.5;
  RandomStream random(MixBits(static_cast<uint64_t>(options.layout_seed), 207, photo));
  const double pitch_share = MakeRoomCamera(options).IsPanorama() ? kLevelShare : 1;
  Rigid clearest;
  double most = -1;
  for (int attempt = 0; attempt < 40; ++attempt) {
    const Eigen::Vector3d place(random.Uniform(kFromWall, options.width - kFromWall),
                                random.Uniform(kFromWall, options.depth - kFromWall),
                                random.Uniform(1.1, 1.75));
    const Eigen::Vector3d way =
        Eigen::Vector3d(random.Uniform(0, options.width), random.Uniform(0, options.depth),
                        random.Uniform(0.4, 2.0)) -
        place;
    const double pitch =
        std::clamp(std::atan2(way.z(), way.head<2>().norm()), RadFromDeg(-25), RadFromDeg(15));
    const Rigid pose = PoseAt(place, std::atan2(way.y(), way.x()), pitch_share * pitch,
                              RadFromDeg(random.Uniform(-options.roll_deg, options.roll_deg)));
    const Eigen::Vector3d here = scene_from_room * place;
    const Eigen::Vector3d forward = pose.rotation.conjugate() * Eigen::Vector3d::UnitZ();
    const auto ahead = scene.Cast(here, scene_from_room.rotation * forward);
    const double clearance = ClearanceAround(scene, here);
    const bool is_clear = clearance > kClear && (!ahead || ahead->distance > kAhead);
    if (is_clear) return pose;
    if (clearance > most) {
      most = clearance;
      clearest = pose;
    }
  }
  return clearest;
}

// In the frame of a room of the scene.
std::vector<Rigid> PlaceCamerasInRoom(const SimulatedRoomOptions& options, const RoomScene& scene,
                                      const Rigid& scene_from_room) {
  std::vector<Rigid> poses;
  const Eigen::Vector2d middle(0.5 * options.width, 0.5 * options.depth);
  const bool level = MakeRoomCamera(options).IsPanorama();
  for (int i = 0; i < options.num_photos; ++i) {
    if (options.layout_seed >= 0) {
      poses.push_back(DrawCamera(options, scene, scene_from_room, i));
      continue;
    }
    RandomStream random(MixBits(static_cast<uint64_t>(options.random_seed), 201, i));
    const double around = 2 * kPi * (i + random.Uniform(-0.15, 0.15)) / options.num_photos;
    const bool high = i % 2 == 0;
    const double height = (high ? 1.66 : 1.3) + random.Uniform(-0.07, 0.07);
    const Eigen::Vector2d axes(0.5 * options.width - 0.95, 0.5 * options.depth - 0.8);
    Eigen::Vector2d offset(axes.x() * std::cos(around), axes.y() * std::sin(around));
    offset *= random.Uniform(0.86, 1.0);
    // Across the room: towards the opposite place of the oval.
    const double yaw = std::atan2(-offset.y(), -offset.x()) + RadFromDeg(random.Uniform(-9, 9));
    double pitch = RadFromDeg(high ? random.Uniform(-21, -11) : random.Uniform(1, 11));
    if (level) pitch *= kLevelShare;
    const double roll = RadFromDeg(random.Uniform(-options.roll_deg, options.roll_deg));
    Eigen::Vector3d place;
    for (int attempt = 0; attempt < 14; ++attempt, offset *= 0.93) {
      place << middle + offset, height;
      const Eigen::Quaterniond cam_from_room = CamFromRoomRotation(yaw, pitch, roll);
      const Eigen::Vector3d forward = cam_from_room.conjugate() * Eigen::Vector3d::UnitZ();
      const Eigen::Vector3d here = scene_from_room * place;
      const auto ahead = scene.Cast(here, scene_from_room.rotation * forward);
      if (ClearanceAround(scene, here) > 0.42 && (!ahead || ahead->distance > 1.5)) break;
    }
    poses.push_back(PoseAt(place, yaw, pitch, roll));
  }
  return poses;
}

// On the way through the door, there and back: a few steps before it, in it, and beyond it a look
// to either side.
std::vector<Rigid> PlaceCamerasInDoorway(const SimulatedRoomOptions& options,
                                         const RoomScene& scene) {
  struct Step {
    double before;  // metres before the door
    double yaw_deg;
  };
  constexpr Step kSteps[] = {{1.9, 0}, {1.2, 8}, {0.6, -8}, {0.1, 0}, {-0.15, 32}, {-0.2, -32}};
  std::vector<Rigid> poses;
  for (const bool back : {false, true}) {
    for (const Step& step : kSteps) {
      RandomStream random(MixBits(static_cast<uint64_t>(options.random_seed), 204, poses.size()));
      const double y = back ? -kPartitionThickness - step.before : step.before;
      Eigen::Vector3d place(options.DoorX() + random.Uniform(-0.08, 0.08), y,
                            1.55 + random.Uniform(-0.1, 0.1));
      for (int attempt = 0; attempt < 10 && ClearanceAround(scene, place) < 0.25; ++attempt) {
        place.y() = -kPartitionThickness / 2 + 0.9 * (place.y() + kPartitionThickness / 2);
      }
      poses.push_back(PoseAt(place, RadFromDeg((back ? 90 : -90) + step.yaw_deg),
                             RadFromDeg(random.Uniform(-12, -4)),
                             RadFromDeg(random.Uniform(-options.roll_deg, options.roll_deg))));
    }
  }
  return poses;
}

}  // namespace

std::vector<Rigid> PlaceCameras(const SimulatedRoomOptions& options, const RoomScene& scene) {
  std::vector<Rigid> poses = PlaceCamerasInRoom(options, scene, Rigid());
  if (!options.second_room) return poses;
  const Rigid place = options.RoomFromSecondRoom();
  for (const Rigid& pose : PlaceCamerasInRoom(options.SecondRoom(), scene, place)) {
    poses.push_back(pose * place.Inverse());
  }
  const std::vector<Rigid> between = PlaceCamerasInDoorway(options, scene);
  poses.insert(poses.end(), between.begin(), between.end());
  return poses;
}

namespace {

// In the frame of a room of the scene.
std::vector<Rigid> PlaceStationsInRoom(const SimulatedRoomOptions& options, const RoomScene& scene,
                                       const Rigid& scene_from_room) {
  static constexpr double kPreferred[][2] = {{0.42, 0.52}, {0.78, 0.7}, {0.25, 0.75}, {0.6, 0.2}};
  std::vector<Rigid> stations;
  for (int k = 0; k < options.num_stations; ++k) {
    RandomStream random(MixBits(static_cast<uint64_t>(options.random_seed), 202, k));
    const double height = 1.5 + 0.04 * (k % 3);
    Eigen::Vector2d preferred(kPreferred[k % 4][0] * options.width + 0.1 * (k / 4),
                              kPreferred[k % 4][1] * options.depth - 0.1 * (k / 4));
    if (options.layout_seed >= 0) {
      RandomStream of_layout(MixBits(static_cast<uint64_t>(options.layout_seed), 206, k));
      preferred << of_layout.Uniform(0.2, 0.8) * options.width,
          of_layout.Uniform(0.2, 0.8) * options.depth;
    }
    Eigen::Vector3d place(preferred.x(), preferred.y(), height);
    double best = -std::numeric_limits<double>::infinity();
    for (double x = 0.5; x <= options.width - 0.5; x += 0.2) {
      for (double y = 0.5; y <= options.depth - 0.5; y += 0.2) {
        const Eigen::Vector3d foot = scene_from_room * Eigen::Vector3d(x, y, 0);
        double score = std::min(TripodClearance(scene, foot.x(), foot.y(), height), 0.6) -
                       0.12 * (Eigen::Vector2d(x, y) - preferred).norm();
        // A second scan from the same place shows nothing new.
        for (const Rigid& other : stations) {
          const double apart = (Eigen::Vector2d(x, y) - other.translation.head<2>()).norm();
          score -= 0.4 * std::max(0.0, 1.3 - apart);
        }
        if (score > best) {
          best = score;
          place << x, y, height;
        }
      }
    }
    // x right, y up, z backward: the y of the station is the z of the room.
    const double yaw = RadFromDeg(random.Uniform(20, 70) + 97 * k);
    const double tilt = k == 0 ? 0 : RadFromDeg(random.Uniform(-0.4, 0.4));
    const Eigen::Quaterniond upright(Eigen::AngleAxisd(kPi / 2, Eigen::Vector3d::UnitX()));
    Rigid room_from_station;
    room_from_station.rotation =
        Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())) *
        Eigen::Quaterniond(Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitX())) * upright;
    room_from_station.translation = place;
    stations.push_back(room_from_station);
  }
  return stations;
}

}  // namespace

std::vector<Rigid> PlaceStations(const SimulatedRoomOptions& options, const RoomScene& scene) {
  std::vector<Rigid> stations = PlaceStationsInRoom(options, scene, Rigid());
  if (!options.second_room) return stations;
  const Rigid place = options.RoomFromSecondRoom();
  for (const Rigid& station : PlaceStationsInRoom(options.SecondRoom(), scene, place)) {
    stations.push_back(place * station);
  }
  return stations;
}

std::vector<double> ChooseExposures(const SimulatedRoomOptions& options, const RoomScene& scene,
                                    const Camera& camera, const std::vector<Rigid>& cam_from_room) {
  const CameraProjection projection(camera);
  const int most = static_cast<int>(std::floor(3 * options.exposure_range_ev + 1e-9));
  std::vector<double> exposures;
  for (size_t i = 0; i < cam_from_room.size(); ++i) {
    RandomStream random(MixBits(static_cast<uint64_t>(options.random_seed), 203, i));
    const std::vector<float> places = MeterPlaces(scene, nullptr, projection, cam_from_room[i]);
    int thirds = random.Index(2 * most + 1) - most;
    if (!places.empty()) {
      const float brightest = Brightest(places);
      while (thirds > -most && brightest * std::exp2(thirds / 3.0) > kBurnsOut) --thirds;
    }
    exposures.push_back(thirds / 3.0);
  }
  return exposures;
}

double MeterExposure(const RoomScene& scene, const ProjectedLight* projected, const Camera& camera,
                     const Rigid& cam_from_room) {
  const std::vector<float> places =
      MeterPlaces(scene, projected, CameraProjection(camera), cam_from_room);
  int thirds = 6;
  if (places.empty()) return 0;
  const float brightest = Brightest(places);
  while (thirds > -18 && brightest * std::exp2(thirds / 3.0) > kBurnsOut) --thirds;
  return thirds / 3.0;
}

}  // namespace roomtex
