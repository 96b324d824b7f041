#include "capture/simulation/room_scene.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "capture/simulation/room_light.h"
#include "core/frames.h"
#include "core/random_stream.h"

namespace roomtex {

struct RoomScene::Light {
  LightMap map;
};

RoomScene::RoomScene() = default;
RoomScene::~RoomScene() = default;

int RoomScene::AddSurface(const Surface& surface) {
  surfaces_.push_back(surface);
  return static_cast<int>(surfaces_.size()) - 1;
}

void RoomScene::AddPatch(const Patch& patch) {
  patches_.push_back(patch);
  Patch& added = patches_.back();
  added.origin = room_from_part_ * patch.origin;
  added.edge_s = room_from_part_.rotation * patch.edge_s;
  added.edge_t = room_from_part_.rotation * patch.edge_t;
  added.shines = surfaces_[patch.surface].shines;
}

void RoomScene::AddLight(const AreaLight& light) {
  lights_.push_back({room_from_part_ * light.corner, room_from_part_.rotation * light.edge_s,
                     room_from_part_.rotation * light.edge_t, light.power});
}

void RoomScene::AddQuad(int surface, const Eigen::Vector3d& origin, const Eigen::Vector3d& edge_s,
                        const Eigen::Vector3d& edge_t, const Eigen::Vector2f& uv_origin) {
  Patch patch;
  patch.origin = origin;
  patch.edge_s = edge_s;
  patch.edge_t = edge_t;
  patch.surface = surface;
  patch.uv_origin = uv_origin;
  patch.uv_s = {static_cast<float>(edge_s.norm()), 0.0f};
  patch.uv_t = {0.0f, static_cast<float>(edge_t.norm())};
  AddPatch(patch);
}

void RoomScene::AddBox(int surface, const Rigid& room_from_box, const Eigen::Vector3d& size,
                       int along) {
  // Per face: corner, edge to the right and edge downwards, in units of the size.
  struct Face {
    Eigen::Vector3d corner, right, down;
  };
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY(),
                        z = Eigen::Vector3d::UnitZ();
  const Face faces[6] = {{z, x, -z},      {x + y + z, -x, -z}, {x + z, y, -z},
                         {y + z, -y, -z}, {y + z, x, -y},      {Eigen::Vector3d::Zero(), x, y}};
  RandomStream random(MixBits(patches_.size(), surface));
  for (const Face& face : faces) {
    Patch patch;
    patch.origin = room_from_box * face.corner.cwiseProduct(size);
    patch.edge_s = room_from_box.rotation * face.right.cwiseProduct(size);
    patch.edge_t = room_from_box.rotation * face.down.cwiseProduct(size);
    patch.surface = surface;
    patch.uv_origin = {static_cast<float>(random.Uniform(0, 9)),
                       static_cast<float>(random.Uniform(0, 9))};
    const auto length_s = static_cast<float>(patch.edge_s.norm());
    const auto length_t = static_cast<float>(patch.edge_t.norm());
    // u follows the axis `along`; a face without that axis takes its longer side.
    const bool s_is_along = std::abs(face.right[along]) > 0.5;
    const bool t_is_along = std::abs(face.down[along]) > 0.5;
    const bool turned = t_is_along || (!s_is_along && length_t > length_s);
    patch.uv_s = turned ? Eigen::Vector2f(0, length_s) : Eigen::Vector2f(length_s, 0);
    patch.uv_t = turned ? Eigen::Vector2f(length_t, 0) : Eigen::Vector2f(0, length_t);
    AddPatch(patch);
  }
}

void RoomScene::AddFrustum(int surface, const Eigen::Vector3d& bottom_centre, double bottom_radius,
                           double top_radius, double height, int sides, bool with_caps) {
  const Eigen::Vector3d up = height * Eigen::Vector3d::UnitZ();
  const auto corner = [&](int i, bool top) -> Eigen::Vector3d {
    const double angle = 2 * kPi * i / sides;
    const Eigen::Vector3d direction(std::cos(angle), std::sin(angle), 0);
    return bottom_centre + (top ? up : Eigen::Vector3d(0, 0, 0)) +
           (top ? top_radius : bottom_radius) * direction;
  };
  const double radius = std::max(bottom_radius, top_radius);
  const auto uv = [&](double i, bool top) {
    return Eigen::Vector2f(static_cast<float>(2 * kPi * radius * i / sides),
                           static_cast<float>(top ? 0.0 : height));
  };
  const auto add = [&](const Eigen::Vector3d& origin, const Eigen::Vector3d& s,
                       const Eigen::Vector3d& t, const Eigen::Vector2f& uv0,
                       const Eigen::Vector2f& uv1, const Eigen::Vector2f& uv2) {
    Patch patch;
    patch.origin = origin;
    patch.edge_s = s - origin;
    patch.edge_t = t - origin;
    patch.is_triangle = true;
    patch.two_sided = !with_caps;
    patch.surface = surface;
    patch.uv_origin = uv0;
    patch.uv_s = uv1 - uv0;
    patch.uv_t = uv2 - uv0;
    AddPatch(patch);
  };
  for (int i = 0; i < sides; ++i) {
    if (top_radius > 0) {
      add(corner(i, true), corner(i + 1, true), corner(i, false), uv(i, true), uv(i + 1, true),
          uv(i, false));
    }
    if (bottom_radius > 0) {
      add(corner(i + 1, false), corner(i, false), corner(i + 1, true), uv(i + 1, false),
          uv(i, false), uv(i + 1, true));
    }
    if (!with_caps) continue;
    for (const bool top : {false, true}) {
      if ((top ? top_radius : bottom_radius) <= 0) continue;
      const Eigen::Vector3d centre = bottom_centre + (top ? up : Eigen::Vector3d(0, 0, 0));
      const Eigen::Vector3d a = corner(top ? i : i + 1, top), b = corner(top ? i + 1 : i, top);
      const auto flat = [&](const Eigen::Vector3d& p) -> Eigen::Vector2f {
        return (p - centre).head<2>().cast<float>() + Eigen::Vector2f(5, top ? 5 : 8);
      };
      add(centre, b, a, flat(centre), flat(b), flat(a));
    }
  }
}

void RoomScene::Finish(bool shading, bool smooth_light, int num_threads) {
  std::vector<Eigen::Vector3d> corners;
  std::vector<Triangle> triangles;
  for (size_t i = 0; i < patches_.size(); ++i) {
    const Patch& patch = patches_[i];
    const int first = static_cast<int>(corners.size());
    corners.insert(corners.end(), {patch.origin, patch.At(1, 0), patch.At(0, 1)});
    triangles.push_back({first, first + 2, first + 1});
    patch_of_triangle_.push_back(static_cast<int>(i));
    if (!patch.is_triangle) {
      corners.push_back(patch.At(1, 1));
      triangles.push_back({first + 3, first + 1, first + 2});
      patch_of_triangle_.push_back(static_cast<int>(i));
    }
    Eigen::Matrix<double, 3, 2> edges;
    edges << patch.edge_s, patch.edge_t;
    st_from_offset_.push_back((edges.transpose() * edges).inverse() * edges.transpose());
  }
  caster_ = std::make_unique<RayCaster>(corners, triangles);
  if (!shading) return;
  const auto is_free = [this](const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
    return !caster_->IsOccluded(from, to, 0.0005);
  };
  LightMap::Sight sight;
  if (smooth_light) {
    sight = [this](const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
      const auto hit = caster_->Cast(from, direction, 0.0005);
      return hit ? hit->distance : std::numeric_limits<double>::infinity();
    };
  }
  light_.reset(new Light{LightMap(patches_, lights_, is_free, sight, num_threads)});
}

Eigen::Vector3d OffsetOnPlane(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                              const Eigen::Vector3d& point, const Eigen::Vector3d& normal) {
  const double slope = normal.dot(direction);
  const double distance = (point - origin).norm();
  const double along = normal.dot(point - origin) / slope;
  if (!(along > 0) || along > 1.5 * distance) {
    return 0.2 * distance * (direction - (point - origin) / distance);
  }
  return origin + along * direction - point;
}

std::optional<SceneHit> RoomScene::Cast(const Eigen::Vector3d& origin,
                                        const Eigen::Vector3d& direction,
                                        double min_distance) const {
  const std::optional<RayHit> found = caster_->Cast(origin, direction, min_distance);
  if (!found) return std::nullopt;
  SceneHit hit;
  hit.patch = patch_of_triangle_[found->triangle];
  const Patch& patch = patches_[hit.patch];
  const Eigen::Vector2d st = st_from_offset_[hit.patch] * (found->point - patch.origin);
  // Embree's distance is a float: put the point onto the patch, along the ray.
  const Eigen::Vector3d normal = patch.edge_t.cross(patch.edge_s);
  const double slope = normal.dot(direction);
  hit.distance = found->distance;
  if (std::abs(slope) > 1e-6 * normal.norm()) {
    hit.distance = normal.dot(patch.origin - origin) / slope;
  }
  hit.point = origin + hit.distance * direction;
  hit.s = st.x();
  hit.t = st.y();
  return hit;
}

bool RoomScene::IsOccluded(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const {
  return caster_->IsOccluded(from, to, 0.001);
}

LinearRgb RoomScene::Color(const SceneHit& hit, const Eigen::Vector3d& side_x,
                           const Eigen::Vector3d& side_y, const LinearRgb& added) const {
  const Patch& patch = patches_[hit.patch];
  const RoomTexture& texture = *surfaces_[patch.surface].texture;
  Eigen::Matrix2f uv_from_st;
  uv_from_st << patch.uv_s, patch.uv_t;
  const Eigen::Vector2f uv =
      patch.uv_origin +
      uv_from_st * Eigen::Vector2f(static_cast<float>(hit.s), static_cast<float>(hit.t));
  const Eigen::Vector2f x = uv_from_st * (st_from_offset_[hit.patch] * side_x).cast<float>();
  const Eigen::Vector2f y = uv_from_st * (st_from_offset_[hit.patch] * side_y).cast<float>();
  // A long footprint (floor seen flat) is averaged from several short ones along it.
  const Eigen::Vector2f& longer = x.squaredNorm() > y.squaredNorm() ? x : y;
  const float length = longer.norm();
  const float area = std::abs(x.x() * y.y() - x.y() * y.x());
  const float width = std::max(length > 0 ? area / length : 0.0f, finest_detail_);
  const int taps = std::clamp(static_cast<int>(std::ceil(length / width - 0.25f)), 1, 6);
  const float footprint = std::max(width, length / static_cast<float>(taps));
  LinearRgb albedo = LinearRgb::Zero();
  for (int i = 0; i < taps; ++i) {
    const float along = (static_cast<float>(i) + 0.5f) / static_cast<float>(taps) - 0.5f;
    albedo += texture.Albedo(uv + along * longer, footprint);
  }
  return albedo.cwiseProduct(Illumination(hit) + added) / static_cast<float>(taps);
}

LinearRgb RoomScene::Color(const SceneHit& hit) const {
  return Color(hit, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
}

LinearRgb RoomScene::Illumination(const SceneHit& hit) const {
  if (light_ == nullptr) return LinearRgb::Ones();
  return light_->map.At(hit.patch, hit.s, hit.t);
}

float RoomScene::InfraredReflectance(const SceneHit& hit) const {
  const Patch& patch = patches_[hit.patch];
  const Surface& surface = surfaces_[patch.surface];
  const Eigen::Vector2f uv = patch.uv_origin + static_cast<float>(hit.s) * patch.uv_s +
                             static_cast<float>(hit.t) * patch.uv_t;
  // The laser spot is a few millimetres wide.
  const LinearRgb albedo = surface.texture->Albedo(uv, 0.004f);
  const float value =
      surface.infrared.base + surface.infrared.gain * surface.infrared.weights.dot(albedo);
  return std::clamp(value, 0.0f, 1.0f);
}

}  // namespace roomtex
