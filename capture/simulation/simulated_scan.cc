#include "capture/simulation/simulated_scan.h"

#include <algorithm>
#include <cmath>

#include "core/frames.h"
#include "core/random_stream.h"

namespace roomtex {
namespace {

constexpr double kShareLost = 0.002;    // samples without an echo for no visible reason
constexpr double kFlattestEcho = 0.02;  // cosine of the flattest incidence that comes back

}  // namespace

RoomScanner::RoomScanner(const SimulatedRoomOptions& options, const RoomScene& scene, int station,
                         const Rigid& room_from_station)
    : options_(options),
      scene_(scene),
      station_(station),
      room_from_station_(room_from_station),
      grid_{options.scan_columns, options.scan_rows},
      depth_camera_(options, scene, station, room_from_station) {}

// Its intensity is what its own colour camera sees.
ScanSample RoomScanner::MeasureByDepthCamera(double theta, double phi, RandomStream* random) const {
  const auto [origin, direction] = depth_camera_.Undrifted(theta, phi);
  ScanSample sample;
  const auto echo = depth_camera_.Look(room_from_station_ * origin,
                                       room_from_station_.rotation * direction, theta, phi, random);
  if (!echo) return sample;
  sample.missing = false;
  sample.floats = echo->mixed;
  sample.hit = echo->hit;
  sample.x_in_station = std::max(echo->range, 0.01) * ScanGrid::Direction(theta, phi);
  const double grey = scene_.Color(echo->hit).mean() * (1 + 0.02 * random->Gaussian());
  sample.intensity = static_cast<float>(std::clamp(std::round(4095 * grey), 1.0, 4095.0));
  return sample;
}

ScanSample RoomScanner::Measure(int index) const {
  RandomStream random(
      MixBits(MixBits(static_cast<uint64_t>(options_.random_seed), 301, station_), index));
  const double theta = grid_.Theta(index % grid_.num_columns);
  const double phi = grid_.Phi(index / grid_.num_columns);
  if (options_.depth_camera) return MeasureByDepthCamera(theta, phi, &random);
  const Eigen::Vector3d direction = room_from_station_.rotation * ScanGrid::Direction(theta, phi);
  ScanSample sample;
  const auto hit = scene_.Cast(room_from_station_.translation, direction);
  if (!hit) return sample;
  sample.hit = *hit;
  // Drawn whether it counts or not, so that what follows is the same either way.
  const bool is_lost = random.Uniform() < kShareLost;
  const double cosine = std::abs(direction.dot(scene_.patches()[hit->patch].Normal()));
  if (options_.missing_samples) {
    if (scene_.SurfaceOf(hit->patch).kind != Surface::Kind::kOpaque) return sample;
    if (is_lost || cosine < kFlattestEcho) return sample;
  }
  sample.missing = false;
  const double range = hit->distance;
  const double noise = options_.range_noise * (1 + options_.range_noise_growth * range);
  const double bend = 0.6 * std::sin(theta + 0.7) + 0.4 * std::cos(2 * theta + 1) * std::cos(phi);
  const double measured = range * (1 + options_.bend * bend) + noise * random.Gaussian();
  const double drift =
      RadFromDeg(options_.azimuth_drift_deg) * (index % grid_.num_columns) / grid_.num_columns;
  sample.x_in_station = std::max(measured, 0.01) * ScanGrid::Direction(theta + drift, phi);
  const double echo = scene_.InfraredReflectance(*hit) * (0.35 + 0.65 * cosine) /
                      (1 + range * range / 100) * (1 + 0.015 * random.Gaussian());
  sample.intensity = static_cast<float>(std::clamp(std::round(4095 * echo), 1.0, 4095.0));
  return sample;
}

}  // namespace roomtex
