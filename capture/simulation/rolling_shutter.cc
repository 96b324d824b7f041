#include "capture/simulation/rolling_shutter.h"

#include <cmath>

#include "core/frames.h"
#include "core/random_stream.h"
#include "core/twist.h"

namespace roomtex {
namespace {

Eigen::Vector3d RandomDirection(RandomStream* random) {
  const double x = random->Gaussian(), y = random->Gaussian(), z = random->Gaussian();
  return Eigen::Vector3d(x, y, z).normalized();
}

}  // namespace

Rigid RowPoses::At(double y_in_img) const {
  const double share = y_in_img / height - 0.5;
  const Rigid step{RotationFromVector(share * turn), share * shift};
  return step * cam_from_room;
}

std::optional<Eigen::Vector2d> RowPoses::Project(const CameraProjection& camera,
                                                 const Eigen::Vector3d& x_in_room) const {
  constexpr int kMostSteps = 50;
  constexpr double kExactPx = 1e-7;
  auto place = camera.ImgFromCam(cam_from_room * x_in_room);
  if (turn.isZero() && shift.isZero()) return place;
  for (int i = 0; i < kMostSteps && place; ++i) {
    const double row = place->y();
    place = camera.ImgFromCam(At(row) * x_in_room);
    if (place && std::abs(place->y() - row) < kExactPx) return place;
  }
  return std::nullopt;
}

std::vector<RowPoses> MoveByHand(const SimulatedRoomOptions& options,
                                 const std::vector<Rigid>& cam_from_room) {
  const double seconds = options.rolling_shutter_ms / 1000;
  std::vector<RowPoses> photos;
  for (size_t i = 0; i < cam_from_room.size(); ++i) {
    RandomStream random(MixBits(static_cast<uint64_t>(options.random_seed), 541, i));
    RowPoses photo;
    photo.cam_from_room = cam_from_room[i];
    photo.height = options.photo_height;
    photo.turn = seconds * RadFromDeg(options.hand_turn_deg) * RandomDirection(&random);
    photo.shift = seconds * options.hand_move * RandomDirection(&random);
    photos.push_back(photo);
  }
  return photos;
}

}  // namespace roomtex
