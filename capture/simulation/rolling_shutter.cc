#include "capture/simulation/rolling_shutter.h"

#include <cmath>

#include "core/frames.h"
#include "core/random_stream.h"
#include "core/row_motion.h"
#include "core/twist.h"

namespace roomtex {
namespace {

Eigen::Vector3d RandomDirection(RandomStream* random) {
  const double x = random->Gaussian(), y = random->Gaussian(), z = random->Gaussian();
  return Eigen::Vector3d(x, y, z).normalized();
}

}  // namespace

Rigid RowPoses::At(double row_share) const {
  const Rigid step{RotationFromVector(row_share * turn), row_share * shift};
  return step * cam_from_room;
}

std::optional<Eigen::Vector2d> RowPoses::Project(const CameraProjection& camera,
                                                 const Eigen::Vector3d& x_in_room) const {
  constexpr int kMostSteps = 50;
  constexpr double kExactPx = 1e-7;
  auto place = camera.ImgFromCam(cam_from_room * x_in_room);
  if (turn.isZero() && shift.isZero()) return place;
  for (int i = 0; i < kMostSteps && place; ++i) {
    const Eigen::Vector2d before = *place;
    place = camera.ImgFromCam(At(RowShare(camera.camera(), before)) * x_in_room);
    if (place && (*place - before).cwiseAbs().maxCoeff() < kExactPx) return place;
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
    photo.turn = seconds * RadFromDeg(options.hand_turn_deg) * RandomDirection(&random);
    photo.shift = seconds * options.hand_move * RandomDirection(&random);
    photos.push_back(photo);
  }
  return photos;
}

}  // namespace roomtex
