#include "core/ray_caster.h"

#include <limits>
#include <new>

#include <embree3/rtcore.h>
#include <tbb/global_control.h>

#include "core/resource_limits.h"

namespace roomtex {
namespace {

// Metres. Embree squares in float and ends at its limits; no scan reaches that far.
constexpr double kFarthest = 1e12;

bool IsNear(const Eigen::Vector3d& point) { return point.cwiseAbs().maxCoeff() <= kFarthest; }

}  // namespace

struct RayCaster::Scene {
  const bool had_threads = ThreadsNotStarted() == 0;
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();

  ~Scene() {
    // Made with threads that could not all be started since: Embree would wait for them.
    if (had_threads && ThreadsNotStarted() > 0) return;
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

  // Embree's scheduler ends the process with the first thread that cannot be started. To the end of
  // the process, and beyond: giving the limit up would start threads.
  if (ThreadsNotStarted() > 0) {
    static const auto* const no_threads =
        new tbb::global_control(tbb::global_control::max_allowed_parallelism, 1);
    static_cast<void>(no_threads);
  }
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

namespace {

// Ericson 2005, "Real-Time Collision Detection", 5.1.5: by the region of the triangle's plane that
// the point lies over.
Eigen::Vector3f NearestOnTriangle(const Eigen::Vector3f& p, const Eigen::Vector3f& a,
                                  const Eigen::Vector3f& b, const Eigen::Vector3f& c) {
  const Eigen::Vector3f ab = b - a, ac = c - a;
  const float d1 = ab.dot(p - a), d2 = ac.dot(p - a);
  if (d1 <= 0 && d2 <= 0) return a;
  const float d3 = ab.dot(p - b), d4 = ac.dot(p - b);
  if (d3 >= 0 && d4 <= d3) return b;
  const float vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  const float d5 = ab.dot(p - c), d6 = ac.dot(p - c);
  if (d6 >= 0 && d5 <= d6) return c;
  const float vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  const float va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  }
  const float sum = va + vb + vc;
  return sum > 0 ? Eigen::Vector3f(a + vb / sum * ab + vc / sum * ac) : a;
}

bool NarrowToTriangle(RTCPointQueryFunctionArguments* arguments) {
  const auto scene = static_cast<RTCScene>(arguments->userPtr);
  const RTCGeometry geometry = rtcGetGeometry(scene, arguments->geomID);
  const auto* vertices =
      static_cast<const float*>(rtcGetGeometryBufferData(geometry, RTC_BUFFER_TYPE_VERTEX, 0));
  const auto* corners =
      static_cast<const unsigned*>(rtcGetGeometryBufferData(geometry, RTC_BUFFER_TYPE_INDEX, 0));
  const auto corner = [&](int k) {
    return Eigen::Vector3f(Eigen::Map<const Eigen::Vector3f>(
        vertices +
        3 * static_cast<size_t>(corners[3 * static_cast<size_t>(arguments->primID) + k])));
  };
  const Eigen::Vector3f point(arguments->query->x, arguments->query->y, arguments->query->z);
  const float distance = (NearestOnTriangle(point, corner(0), corner(1), corner(2)) - point).norm();
  if (distance >= arguments->query->radius) return false;
  arguments->query->radius = distance;
  return true;
}

}  // namespace

std::optional<double> RayCaster::DistanceTo(const Eigen::Vector3d& point,
                                            double max_distance) const {
  const Eigen::Vector3f place = (point - scene_->centre).cast<float>();
  RTCPointQuery query{};
  query.x = place.x();
  query.y = place.y();
  query.z = place.z();
  query.radius = static_cast<float>(max_distance);
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  if (!rtcPointQuery(scene_->scene, &query, &context, NarrowToTriangle, scene_->scene)) {
    return std::nullopt;
  }
  return query.radius;
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
