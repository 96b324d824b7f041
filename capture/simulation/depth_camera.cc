#include "capture/simulation/depth_camera.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>

#include "capture/simulation/scan_grid.h"
#include "core/decompositions.h"
#include "core/frames.h"
#include "core/twist.h"

namespace roomtex {
namespace {

// As of depth cameras with structured light (the first Kinect), whose noise and steps grow with the
// square of the range.
constexpr double kFarthest = 6;         // metres
constexpr double kFlattest = 0.2;       // cosine of the flattest incidence that is seen
constexpr float kDarkest = 0.07f;       // reflectance below which nothing comes back
constexpr double kStep = 0.0015;        // 1 / metres: steps of 1 / range; metres at 1 m
constexpr double kFootprint = 0.009;    // radians to the corners of what one sample averages
constexpr double kSameSurface = 0.03;   // metres across a surface
constexpr double kShareOfHoles = 0.35;  // of samples on an edge in depth; as many are mixed
constexpr double kBlobs = 40;           // waves per turn of the noise that is left after merging
// Mean square of a sum of these sines is that of one.
constexpr int kNumSines = 3;
// A drift of the position by d turns the camera by d / kLever, too.
constexpr double kLever = 2.5;  // metres

}  // namespace

DepthCamera::DepthCamera(const SimulatedRoomOptions& options, const RoomScene& scene, int station,
                         const Rigid& room_from_station)
    : options_(options),
      scene_(scene),
      seed_(MixBits(static_cast<uint64_t>(options.random_seed), 611, station)) {
  if (!options.depth_camera || options.depth_drift == 0) return;
  constexpr int kColumns = 72, kRows = 24;
  Eigen::Matrix<double, 6, 6> matrix = Eigen::Matrix<double, 6, 6>::Zero();
  Vector6d right = Vector6d::Zero();
  for (int i = 0; i < kColumns * kRows; ++i) {
    const double theta = 2 * kPi * ((i % kColumns + 0.5) / kColumns - 0.5);
    const double phi = kPi * ((i / kColumns + 0.5) / kRows - 0.5) * 0.75;
    const Eigen::Vector3d direction = ScanGrid::Direction(theta, phi);
    const auto hit =
        scene.Cast(room_from_station.translation, room_from_station.rotation * direction);
    if (!hit) continue;
    const Eigen::Vector3d x = hit->distance * direction;
    // x + shift + turn x (x), as a function of shift and turn.
    Eigen::Matrix<double, 3, 6> jacobian;
    jacobian << Eigen::Matrix3d::Identity(), -CrossMatrix(x);
    matrix += jacobian.transpose() * jacobian;
    right += jacobian.transpose() * (jacobian * DriftAt(theta, phi));
  }
  mean_drift_ = SolveSymmetric(matrix, right);
}

double DepthCamera::Field(int purpose, double theta, double phi, double waves) const {
  RandomStream random(MixBits(seed_, purpose));
  double sum = 0;
  for (int i = 0; i < kNumSines; ++i) {
    const double turn = random.Uniform(0, 2 * kPi), wave = waves * random.Uniform(0.6, 1.4);
    sum += std::sin(wave * (std::cos(turn) * theta + std::sin(turn) * phi) +
                    random.Uniform(0, 2 * kPi));
  }
  return sum / std::sqrt(kNumSines);
}

std::optional<DepthCamera::Echo> DepthCamera::Look(const Eigen::Vector3d& origin,
                                                   const Eigen::Vector3d& direction, double theta,
                                                   double phi, RandomStream* random) const {
  const Eigen::Vector3d side = direction.unitOrthogonal(), up = direction.cross(side);
  std::array<SceneHit, 5> hits;
  for (size_t i = 0; i < hits.size(); ++i) {
    const double extent = i == 0 ? 0 : kFootprint;
    const Eigen::Vector3d beside = extent * ((i & 1 ? 1 : -1) * side + (i & 2 ? 1 : -1) * up);
    const auto hit = scene_.Cast(origin, (direction + beside).normalized());
    if (!hit) return std::nullopt;
    hits[i] = *hit;
  }
  std::sort(hits.begin(), hits.end(),
            [](const auto& a, const auto& b) { return a.distance < b.distance; });
  Echo echo{hits[2], hits[2].distance};  // what most of the footprint meets
  const Eigen::Vector3d normal = scene_.patches()[echo.hit.patch].Normal();
  const bool is_edge = std::any_of(hits.begin(), hits.end(), [&](const SceneHit& hit) {
    return std::abs(normal.dot(hit.point - echo.hit.point)) > kSameSurface;
  });
  if (is_edge) {
    const double dice = random->Uniform();
    if (dice < kShareOfHoles) return std::nullopt;
    echo.mixed = dice < 2 * kShareOfHoles;
    if (echo.mixed) echo.range = (hits[0].distance + hits[4].distance) / 2;
  }
  if (scene_.SurfaceOf(echo.hit.patch).kind != Surface::Kind::kOpaque) return std::nullopt;
  if (echo.range > kFarthest || std::abs(direction.dot(normal)) < kFlattest ||
      scene_.InfraredReflectance(echo.hit) < kDarkest) {
    return std::nullopt;
  }
  const double square = echo.range * echo.range;
  const double sigma = options_.range_noise * square / std::sqrt(2.0);
  echo.range += sigma * (random->Gaussian() + std::sqrt(2.0) * Field(1, theta, phi, kBlobs));
  // The camera measures 1 / range, in whole steps: it shows a slanted wall as terraces.
  echo.range = 1 / (kStep * std::round(1 / (kStep * std::max(echo.range, 0.01))));
  return echo;
}

DepthCamera::Vector6d DepthCamera::DriftAt(double theta, double phi) const {
  // One wave and a half: where the turn closes, the ends do not meet.
  constexpr double kWaves = 1.5;
  const double size = std::sqrt(2.0) * options_.depth_drift;
  Vector6d drift;
  for (int i = 0; i < 3; ++i) {
    drift[i] = size * Field(10 + i, theta, phi, kWaves);
    drift[3 + i] = size / kLever * Field(20 + i, theta, phi, kWaves);
  }
  return drift;
}

std::pair<Eigen::Vector3d, Eigen::Vector3d> DepthCamera::Undrifted(double theta, double phi) const {
  const Eigen::Vector3d direction = ScanGrid::Direction(theta, phi);
  const Vector6d drift = DriftAt(theta, phi) - mean_drift_;
  return {-drift.head<3>(), (direction - drift.tail<3>().cross(direction)).normalized()};
}

}  // namespace roomtex
