#pragma once
// The surfaces of the simulated room, their colour under its light and what a ray meets.
// Frame: `room` (simulated_room.h).

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "capture/simulation/room_texture.h"
#include "core/ray_caster.h"
#include "core/similarity.h"

namespace roomtex {

// What the scanner's infrared light meets: reflectance = base + gain * (weights . albedo), 0..1.
// Dyes are nearly transparent there, soot is black, plants are bright: so it is not the photos'
// brightness.
struct Infrared {
  float base = 0.15f;
  float gain = 0.5f;
  Eigen::Vector3f weights{0.7f, 0.3f, 0.0f};  // red, green, blue
};

struct Surface {
  enum class Kind {
    kOpaque,
    kMirror,   // a photo sees the reflection, the scanner gets no echo
    kOutside,  // beyond the window: shines by itself, the scanner gets no echo
  };
  TexturePtr texture;
  Infrared infrared;
  Kind kind = Kind::kOpaque;
  bool shines = false;     // looks the same under any light: a lamp, the sky
  bool varnished = false;  // may mirror a part of the light: SimulatedRoomOptions::gloss
};

// A parallelogram, or the half of it with s + t <= 1. Seen from the front edge_s points right and
// edge_t down; metres.
struct Patch {
  Eigen::Vector3d origin, edge_s, edge_t;
  bool is_triangle = false;
  bool two_sided = false;  // thin: lit from both sides
  bool shines = false;
  int surface = 0;
  Eigen::Vector2f uv_origin, uv_s, uv_t;  // texture position = uv_origin + s * uv_s + t * uv_t

  Eigen::Vector3d Normal() const { return edge_t.cross(edge_s).normalized(); }
  Eigen::Vector3d At(double s, double t) const { return origin + s * edge_s + t * edge_t; }
};

struct SceneHit {
  int patch = -1;
  double s = 0, t = 0;
  double distance = 0;
  Eigen::Vector3d point;  // exactly on the patch
};

// What gives light, for SimulatedRoomOptions::shading.
struct AreaLight {
  Eigen::Vector3d corner, edge_s, edge_t;  // light leaves along edge_t x edge_s
  LinearRgb power;                         // irradiance that it gives at 1 m in front, times 1 m2
};

// Where the ray meets the plane through `point`, relative to `point`; kept short when it runs flat.
Eigen::Vector3d OffsetOnPlane(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                              const Eigen::Vector3d& point, const Eigen::Vector3d& normal);

class RoomScene {
 public:
  RoomScene();
  ~RoomScene();

  // Where what is added from now on stands: its frame is no longer the room's.
  void Place(const Rigid& room_from_part) { room_from_part_ = room_from_part; }

  // Gives the index for the calls below.
  int AddSurface(const Surface& surface);
  // Texture coordinates in metres from uv_origin.
  void AddQuad(int surface, const Eigen::Vector3d& origin, const Eigen::Vector3d& edge_s,
               const Eigen::Vector3d& edge_t, const Eigen::Vector2f& uv_origin = {0, 0});
  void AddPatch(const Patch& patch);  // sets `shines`
  // Closed box; its local frame is placed by room_from_box, z up; from (0, 0, 0) to size. The six
  // faces show different places of the texture. along: axis (0, 1, 2) that u follows where a face
  // has it (wood grain).
  void AddBox(int surface, const Rigid& room_from_box, const Eigen::Vector3d& size, int along = 0);
  // Upright frustum with `sides` sides; with_caps closes it.
  void AddFrustum(int surface, const Eigen::Vector3d& bottom_centre, double bottom_radius,
                  double top_radius, double height, int sides, bool with_caps);
  void AddLight(const AreaLight& light);

  // Colours are averaged over at least this width (metres), the photos' and the true ones alike.
  void SetFinestDetail(double width) {
    finest_detail_ = std::max(kTextureBandLimit, static_cast<float>(width));
  }

  // Builds the ray caster and, if `shading`, the light on every patch (smooth_light: see LightMap).
  // Call once, after the last Add.
  void Finish(bool shading, bool smooth_light, int num_threads);

  std::optional<SceneHit> Cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                               double min_distance = 0) const;
  // Something stands between the two points (the ends left out by 1 mm).
  bool IsOccluded(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const;

  // Linear light, EV 0, averaged over the parallelogram that side_x and side_y span around the hit
  // (tangential; zero = the finest detail there is). added: light on top of the room's, on the same
  // scale.
  LinearRgb Color(const SceneHit& hit, const Eigen::Vector3d& side_x, const Eigen::Vector3d& side_y,
                  const LinearRgb& added = LinearRgb::Zero()) const;
  LinearRgb Color(const SceneHit& hit) const;
  float InfraredReflectance(const SceneHit& hit) const;  // 0..1

  const std::vector<Patch>& patches() const { return patches_; }
  const Surface& SurfaceOf(int patch) const { return surfaces_[patches_[patch].surface]; }

 private:
  struct Light;
  LinearRgb Illumination(const SceneHit& hit) const;

  Rigid room_from_part_;
  float finest_detail_ = kTextureBandLimit;
  std::vector<Surface> surfaces_;
  std::vector<Patch> patches_;
  std::vector<AreaLight> lights_;
  std::vector<int> patch_of_triangle_;
  std::vector<Eigen::Matrix<double, 2, 3>> st_from_offset_;  // per patch
  std::unique_ptr<RayCaster> caster_;
  std::unique_ptr<Light> light_;
};

}  // namespace roomtex
