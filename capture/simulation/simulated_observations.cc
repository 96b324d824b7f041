#include "capture/simulation/simulated_observations.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/photo.h"
#include "core/random_stream.h"
#include "core/row_motion.h"

namespace roomtex {
namespace {

struct SurfacePoint {
  Eigen::Vector3d x_in_room, normal;
  LinearRgb color;
};

// What a random pixel of a random photo shows; none where that is the mirror or lies outside.
std::optional<SurfacePoint> RandomPoint(const RoomPhotos& photos, RandomStream* random) {
  const int photo = random->Index(static_cast<int>(photos.poses.size()));
  const CameraProjection& projection = photos.CameraOf(photo);
  const Camera& camera = projection.camera();
  const Eigen::Vector2d x_in_img(random->Uniform(0, camera.width),
                                 random->Uniform(0, camera.height));
  const auto ray = projection.RayFromImg(x_in_img);
  if (!ray) return std::nullopt;
  const Rigid room_from_cam = photos.poses[photo].At(RowShare(camera, x_in_img)).Inverse();
  const auto hit =
      photos.scene.Cast(room_from_cam.translation, room_from_cam.rotation * ray->normalized());
  if (!hit || photos.scene.SurfaceOf(hit->patch).kind != Surface::Kind::kOpaque)
    return std::nullopt;
  return SurfacePoint{hit->point, photos.scene.patches()[hit->patch].Normal(),
                      photos.scene.Color(*hit)};
}

struct Observation {
  int photo;
  Eigen::Vector2d x_in_img;
};

}  // namespace

std::optional<Eigen::Vector2d> RoomPhotos::See(int photo, const Eigen::Vector3d& x_in_room,
                                               const Eigen::Vector3d& normal_in_room) const {
  const CameraProjection& projection = CameraOf(photo);
  const auto x_in_img = poses[photo].Project(projection, x_in_room);
  if (!x_in_img || !projection.InImage(*x_in_img)) return std::nullopt;
  const Eigen::Vector3d centre =
      poses[photo].At(RowShare(projection.camera(), *x_in_img)).TargetOriginInSource();
  const Eigen::Vector3d view = (centre - x_in_room).normalized();
  // Flatter than 80 degrees nobody finds a feature again.
  if (std::abs(view.dot(normal_in_room)) < 0.17) return std::nullopt;
  if (scene.IsOccluded(centre, x_in_room)) return std::nullopt;
  return x_in_img;
}

SparseModel MakeRoomSparseModel(const RoomPhotos& photos, const Similarity& sparse_from_room,
                                int num_points, double noise_px) {
  SparseModel model;
  const Camera& camera = photos.camera.camera();
  model.cameras[camera.camera_id] = camera;
  const int num_photos = static_cast<int>(photos.poses.size());
  for (int photo = 0; photo < num_photos; ++photo) {
    SparseImage& image = model.images[photo + 1];
    image.image_id = photo + 1;
    image.camera_id = camera.camera_id;
    const Rigid& pose = photos.poses[photo].cam_from_room;
    // x_in_cam = pose * sparse_from_room^-1 * x_in_sparse, its scale left out.
    image.cam_from_model.rotation = pose.rotation * sparse_from_room.rotation.conjugate();
    image.cam_from_model.translation = sparse_from_room.scale * pose.translation -
                                       image.cam_from_model.rotation * sparse_from_room.translation;
  }
  RandomStream random(MixBits(static_cast<uint64_t>(photos.options.random_seed), 401));
  const int max_attempts = 20 * num_points + 100;
  for (int attempt = 0; attempt < max_attempts; ++attempt) {
    if (static_cast<int>(model.points.size()) >= num_points) break;
    const auto surface = RandomPoint(photos, &random);
    if (!surface) continue;
    std::vector<Observation> observations;
    double error = 0;
    for (int photo = 0; photo < num_photos; ++photo) {
      auto x_in_img = photos.See(photo, surface->x_in_room, surface->normal);
      if (!x_in_img || random.Uniform() < 0.15) continue;  // not every feature is found everywhere
      const Eigen::Vector2d noise =
          noise_px * Eigen::Vector2d(random.Gaussian(), random.Gaussian());
      if (!photos.camera.InImage(*x_in_img + noise)) continue;
      observations.push_back({photo, *x_in_img + noise});
      error += noise.norm();
    }
    // Two views only as a last resort.
    if (observations.size() < (attempt < max_attempts / 2 ? 3u : 2u)) continue;
    const uint64_t id = model.points.size() + 1;
    SparsePoint& point = model.points[id];
    point.x_in_model = sparse_from_room * surface->x_in_room;
    for (int k = 0; k < 3; ++k) point.color[k] = SrgbByteFromLinear(surface->color[k]);
    point.error = error / static_cast<double>(observations.size());
    for (const Observation& observation : observations) {
      SparseImage& image = model.images[observation.photo + 1];
      point.track.push_back({image.image_id, static_cast<uint32_t>(image.points2d.size())});
      image.points2d.push_back(observation.x_in_img);
      image.point3d_ids.push_back(id);
      // Every fourth keypoint or so has no point.
      if (random.Uniform() < 0.3) {
        image.points2d.emplace_back(random.Uniform(0, camera.width),
                                    random.Uniform(0, camera.height));
        image.point3d_ids.push_back(kInvalidPoint3dId);
      }
    }
  }
  return model;
}

std::vector<PickCandidate> FindPickCandidates(const RoomPhotos& photos, const RoomScanner& scanner,
                                              const Rigid& room_from_station, int photo) {
  std::vector<PickCandidate> candidates;
  const Rigid station_from_room = room_from_station.Inverse();
  const auto& patches = photos.scene.patches();
  for (size_t i = 0; i < patches.size(); ++i) {
    const Patch& patch = patches[i];
    const double length_s = patch.edge_s.norm(), length_t = patch.edge_t.norm();
    if (patch.is_triangle || std::min(length_s, length_t) < 0.12) continue;
    if (photos.scene.SurfaceOf(static_cast<int>(i)).kind != Surface::Kind::kOpaque) continue;
    for (int corner = 0; corner < 4; ++corner) {
      // A centimetre inside, so that the sample lies on the thing itself.
      const double s = 0.012 / length_s, t = 0.012 / length_t;
      const Eigen::Vector3d near_corner = patch.At(corner & 1 ? 1 - s : s, corner & 2 ? 1 - t : t);
      if (!photos.See(photo, near_corner, patch.Normal())) continue;
      const int index = scanner.grid().Nearest(station_from_room * near_corner);
      if (index < 0) continue;
      const ScanSample sample = scanner.Measure(index);
      if (sample.missing || sample.floats || sample.hit.patch != static_cast<int>(i)) continue;
      const auto x_in_img = photos.See(photo, sample.hit.point, patch.Normal());
      if (!x_in_img) continue;
      const Rigid pose =
          photos.poses[photo].At(RowShare(photos.CameraOf(photo).camera(), *x_in_img));
      candidates.push_back(
          {*x_in_img, sample.x_in_station, photos.camera.Depth(pose * sample.hit.point)});
    }
  }
  return candidates;
}

std::vector<PickCandidate> SpreadPicks(const std::vector<PickCandidate>& candidates, int count,
                                       double photo_diagonal) {
  std::vector<PickCandidate> chosen;
  if (candidates.empty()) return chosen;
  // The first is the one farthest from the middle of all; then always the one farthest from those
  // chosen.
  const auto place = [&](const PickCandidate& c) {
    return Eigen::Vector3d(c.x_in_img.x() / photo_diagonal, c.x_in_img.y() / photo_diagonal,
                           0.35 * std::log(c.depth));
  };
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const PickCandidate& c : candidates)
    mean += place(c) / static_cast<double>(candidates.size());
  std::vector<double> distance(candidates.size());
  for (size_t i = 0; i < candidates.size(); ++i) distance[i] = (place(candidates[i]) - mean).norm();
  while (static_cast<int>(chosen.size()) < count) {
    const size_t next = std::max_element(distance.begin(), distance.end()) - distance.begin();
    if (distance[next] <= 0) break;
    const bool first = chosen.empty();
    chosen.push_back(candidates[next]);
    for (size_t i = 0; i < candidates.size(); ++i) {
      const double to_new = (place(candidates[i]) - place(candidates[next])).norm();
      distance[i] = first ? to_new : std::min(distance[i], to_new);
    }
  }
  return chosen;
}

}  // namespace roomtex
