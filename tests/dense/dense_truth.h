#pragma once
// What a supplement is worth, against a room that knows every surface.

#include <vector>

#include "capture/simulation/room_furniture.h"
#include "capture/simulation/room_scene.h"
#include "capture/simulation/simulated_room.h"
#include "core/camera_model.h"
#include "core/ray_caster.h"
#include "core/scan_mesh.h"

namespace roomtex {

struct DenseScore {
  size_t num_points = 0, num_missed = 0;
  // Shares of the points within 5 and 20 mm of a true surface; of what the scan missed (2.5 cm and
  // more from it) and three photos see, with a point within 5 and 20 mm.
  double accurate_5mm = 0, accurate_20mm = 0, complete_5mm = 0, complete_20mm = 0;
  double in_free_space = 0;  // of the points: 5 cm and more from any surface
};

class DenseTruth {
 public:
  // Of what station 0 misses; the photos are looked through at every `step`-th pixel.
  DenseTruth(const SimulatedRoom& room, int step) {
    RoomScene scene;
    scene.SetFinestDetail(room.options().finest_detail);
    FurnishRoom(room.options(), &scene);
    scene.Finish(false, false, 1);
    scan_from_room_ = room.ScanFromRoom();
    std::vector<Eigen::Vector3d> corners;
    std::vector<Triangle> triangles;
    for (const Patch& patch : scene.patches()) {
      const int first = static_cast<int>(corners.size());
      for (const auto& [s, t] : {std::pair{0, 0}, {1, 0}, {0, 1}, {1, 1}}) {
        corners.push_back(scan_from_room_ * patch.At(s, t));
      }
      triangles.push_back({first, first + 1, first + 2});
      if (!patch.is_triangle) triangles.push_back({first + 1, first + 3, first + 2});
    }
    surface_ = std::make_unique<RayCaster>(corners, triangles);
    FindMissed(room, scene, step);
  }

  DenseScore Score(const std::vector<Eigen::Vector3d>& points) const {
    DenseScore score;
    score.num_points = points.size();
    score.num_missed = missed_.size();
    for (const Eigen::Vector3d& point : points) {
      const auto distance = surface_->DistanceTo(point, 0.02);
      score.accurate_20mm += distance.has_value();
      score.accurate_5mm += distance && *distance <= 0.005;
      score.in_free_space += !surface_->DistanceTo(point, 0.05);
    }
    // Points as triangles without an extent.
    std::vector<Triangle> triangles;
    for (int i = 0; i < static_cast<int>(points.size()); ++i) triangles.push_back({i, i, i});
    const RayCaster found(points, triangles);
    for (const Eigen::Vector3d& place : missed_) {
      const auto distance = found.DistanceTo(place, 0.02);
      score.complete_20mm += distance.has_value();
      score.complete_5mm += distance && *distance <= 0.005;
    }
    const auto count = static_cast<double>(std::max<size_t>(points.size(), 1));
    const auto missed = static_cast<double>(std::max<size_t>(missed_.size(), 1));
    score.accurate_5mm /= count, score.accurate_20mm /= count, score.in_free_space /= count;
    score.complete_5mm /= missed, score.complete_20mm /= missed;
    return score;
  }

 private:
  void FindMissed(const SimulatedRoom& room, const RoomScene& scene, int step) {
    const Scan scan = room.MakeScan();
    const RayCaster scanned(scan.points, BuildScanMesh(scan, {}));
    const CameraProjection projection(room.camera());
    std::vector<Rigid> cams;
    for (int i = 0; i < room.NumPhotos(); ++i) {
      const bool other_light = !room.Projectors().empty() && !room.IsPatterned(i);
      if (!other_light) cams.push_back(room.CamFromRoom(i));
    }
    for (const Rigid& cam : cams) {
      const Rigid room_from_cam = cam.Inverse();
      for (int y = step / 2; y < room.camera().height; y += step) {
        for (int x = step / 2; x < room.camera().width; x += step) {
          const auto ray = projection.RayFromImg({x + 0.5, y + 0.5});
          if (!ray) continue;
          const auto hit =
              scene.Cast(room_from_cam.translation, room_from_cam.rotation * ray->normalized());
          if (!hit || scene.SurfaceOf(hit->patch).kind != Surface::Kind::kOpaque) continue;
          const Eigen::Vector3d place = scan_from_room_ * hit->point;
          if (scanned.DistanceTo(place, 0.025)) continue;
          int views = 0;
          for (const Rigid& other : cams) {
            const auto at = projection.ImgFromCam(other * hit->point);
            views += at && projection.InImage(*at) &&
                     !scene.IsOccluded(other.TargetOriginInSource(), hit->point);
          }
          if (views >= 3) missed_.push_back(place);
        }
      }
    }
  }

  Rigid scan_from_room_;
  std::unique_ptr<RayCaster> surface_;
  std::vector<Eigen::Vector3d> missed_;
};

}  // namespace roomtex
