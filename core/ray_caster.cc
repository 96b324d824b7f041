#include "core/ray_caster.h"

#include <limits>
#include <new>

#include <embree3/rtcore.h>

namespace roomtex {
namespace {

// Metres. Embree squares in float and ends at its limits; no scan reaches that far.
constexpr double kFarthest = 1e12;

bool IsNear(const Eigen::Vector3d& point) { return point.cwiseAbs().maxCoeff() <= kFarthest; }

}  // namespace

struct RayCaster::Scene {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();

  ~Scene() {
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }
};

RayCaster::RayCaster(const std::vector<Eigen::Vector3d>& points,
                     const std::vector<Triangle>& triangles)
    : scene_(std::make_unique<Scene>()) {
  Bounds bounds;
  for (const Eigen::Vector3d& point : points) {
    if (!IsNear(point)) continue;
    bounds.min = bounds.min.cwiseMin(point);
    bounds.max = bounds.max.cwiseMax(point);
  }
  if (bounds.min.x() <= bounds.max.x()) scene_->centre = 0.5 * (bounds.min + bounds.max);

  scene_->device = rtcNewDevice(nullptr);
  if (scene_->device == nullptr) throw std::bad_alloc();  // all that it can lack
  scene_->scene = rtcNewScene(scene_->device);
  rtcSetSceneFlags(scene_->scene, RTC_SCENE_FLAG_ROBUST);
  if (!triangles.empty()) {
    RTCGeometry geometry = rtcNewGeometry(scene_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), points.size()));
    auto* corners = static_cast<unsigned*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                3 * sizeof(unsigned), triangles.size()));
    if (vertices == nullptr || corners == nullptr) throw std::bad_alloc();
    for (size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d p = points[i] - scene_->centre;
      for (int k = 0; k < 3; ++k) {
        vertices[3 * i + k] = IsNear(points[i]) ? static_cast<float>(p[k]) : 0.0f;
      }
    }
    for (size_t i = 0; i < triangles.size(); ++i) {
      const bool near = IsNear(points[triangles[i][0]]) && IsNear(points[triangles[i][1]]) &&
                        IsNear(points[triangles[i][2]]);
      for (int k = 0; k < 3; ++k) {
        corners[3 * i + k] = static_cast<unsigned>(triangles[i][near ? k : 0]);
      }
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_->scene, geometry);
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(scene_->scene);
}

RayCaster::~RayCaster() = default;
RayCaster::RayCaster(RayCaster&&) noexcept = default;
RayCaster& RayCaster::operator=(RayCaster&&) noexcept = default;

std::optional<RayHit> RayCaster::Cast(const Eigen::Vector3d& origin,
                                      const Eigen::Vector3d& direction, double min_distance,
                                      double max_distance) const {
  const Eigen::Vector3d start = origin - scene_->centre;
  if (!IsNear(start) || !IsNear(direction)) return std::nullopt;
  RTCRayHit query{};
  query.ray.org_x = static_cast<float>(start.x());
  query.ray.org_y = static_cast<float>(start.y());
  query.ray.org_z = static_cast<float>(start.z());
  query.ray.dir_x = static_cast<float>(direction.x());
  query.ray.dir_y = static_cast<float>(direction.y());
  query.ray.dir_z = static_cast<float>(direction.z());
  query.ray.tnear = static_cast<float>(min_distance);
  query.ray.tfar = static_cast<float>(max_distance);
  query.ray.mask = 0xffffffffu;
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene_->scene, &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  RayHit hit;
  hit.distance = query.ray.tfar;
  hit.triangle = static_cast<int>(query.hit.primID);
  hit.point = origin + hit.distance * direction;
  return hit;
}

bool RayCaster::IsOccluded(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                           double margin) const {
  const Eigen::Vector3d offset = to - from;
  const double length = offset.norm();
  if (!(length > 2 * margin)) return false;
  const Eigen::Vector3d direction = offset / length;
  const Eigen::Vector3d start = from - scene_->centre;
  if (!IsNear(start) || !(length <= kFarthest)) return false;
  RTCRay ray{};
  ray.org_x = static_cast<float>(start.x());
  ray.org_y = static_cast<float>(start.y());
  ray.org_z = static_cast<float>(start.z());
  ray.dir_x = static_cast<float>(direction.x());
  ray.dir_y = static_cast<float>(direction.y());
  ray.dir_z = static_cast<float>(direction.z());
  ray.tnear = static_cast<float>(margin);
  ray.tfar = static_cast<float>(length - margin);
  ray.mask = 0xffffffffu;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene_->scene, &context, &ray);
  return ray.tfar < 0;
}

}  // namespace roomtex
