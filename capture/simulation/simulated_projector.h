#pragma once
// Projectors in the simulated room (thesis 5.1.2): where they stand and what light they throw.
// Frames: `room`, `proj` (as `cam`: x right, y down, z forward; pixels as `img`).

#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "capture/simulation/room_scene.h"
#include "capture/simulation/simulated_room_options.h"
#include "core/camera_model.h"
#include "core/similarity.h"

namespace roomtex {

// A pinhole that sends light out instead of taking it in.
class Projector {
 public:
  // camera: PINHOLE, of the pattern's size. pattern: sRGB grey. white: light at 1 m on the axis.
  // focus: metres; the blur elsewhere is that of a lens opening of `aperture` metres.
  Projector(const Camera& camera, const Rigid& proj_from_room, const cv::Mat1b& pattern,
            double white, double focus, double aperture);

  // Light that arrives at a surface with nothing in between (room light = 1), averaged over the
  // parallelogram that side_x and side_y span around the point (tangential; zero = a point).
  // A picture on a wall that the axis meets at a right angle is evenly bright; beyond that the
  // inverse-square and the cosine law hold. normal: unit; behind it there is no light.
  double LightAt(const Eigen::Vector3d& x_in_room, const Eigen::Vector3d& normal_in_room,
                 const Eigen::Vector3d& side_x, const Eigen::Vector3d& side_y) const;
  // The pixel of the pattern that shines at a point; none behind the projector.
  std::optional<Eigen::Vector2d> PatternFromRoom(const Eigen::Vector3d& x_in_room) const;
  // All light that leaves it: light times m2.
  double Flux() const;

  const Camera& camera() const { return camera_; }
  const Rigid& proj_from_room() const { return proj_from_room_; }
  Eigen::Vector3d Lens() const { return lens_; }  // in `room`
  const cv::Mat1b& pattern() const { return pattern_; }

 private:
  double LookUp(const Eigen::Vector2d& x_in_pattern, double width) const;
  double LookUpLevel(const Eigen::Vector2d& x_in_pattern, int level) const;

  Camera camera_;
  Rigid proj_from_room_;
  Eigen::Vector3d lens_;
  cv::Mat1b pattern_;
  double white_, focus_, aperture_;
  std::vector<cv::Mat1f> levels_;  // linear light, each half of the one before
};

// room_from_proj of every projector: in the corners first, above the heads, looking at the opposite
// corner, so that two of them light all walls; from the fifth on before the middle of a wall.
std::vector<Rigid> PlaceProjectors(const SimulatedRoomOptions& options);
// The dark box and the stand that carry the lens. They are in the scan and in the photos.
void AddProjectorBody(const Rigid& room_from_proj, RoomScene* scene);
// Projector k throws SimulatedRoomOptions::pattern of seed k + 1, or that of the first.
Projector MakeProjector(const SimulatedRoomOptions& options, int k, const Rigid& room_from_proj);
// Walls, floor and ceiling, m2.
double RoomArea(const SimulatedRoomOptions& options);

// The light of all projectors in the room.
class ProjectedLight {
 public:
  // Both must outlive it.
  ProjectedLight(const std::vector<Projector>& projectors, const RoomScene& scene,
                 double room_area);

  struct Arrival {
    float light = 0;      // room light = 1
    uint32_t lit_by = 0;  // bit k: projector k reaches the point
  };
  // Direct light where nothing stands between, and what the walls send back, evenly everywhere.
  Arrival At(const SceneHit& hit, const Eigen::Vector3d& side_x,
             const Eigen::Vector3d& side_y) const;

 private:
  const std::vector<Projector>& projectors_;
  const RoomScene& scene_;
  double ambient_ = 0;
};

}  // namespace roomtex
