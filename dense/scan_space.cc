#include "dense/scan_space.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "core/decompositions.h"
#include "core/frames.h"
#include "core/parallel.h"
#include "core/scan_mesh.h"

namespace roomtex {
namespace {

constexpr double kNearDepth = 0.05;  // metres: no photo and no scanner sees nearer
constexpr int kMinColumns = 720, kMaxColumns = 3000;
constexpr int kAround = 1;  // cells of the raster of directions

RayCaster MakeSurface(const std::vector<Scan>& scans) {
  std::vector<Eigen::Vector3d> points;
  std::vector<Triangle> triangles;
  for (const Scan& scan : scans) {
    const int first = static_cast<int>(points.size());
    points.insert(points.end(), scan.points.begin(), scan.points.end());
    for (const Triangle& t : BuildScanMesh(scan, {})) {
      triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    }
  }
  return RayCaster(points, triangles);
}

}  // namespace

ScanSpace::ScanSpace(const std::vector<Scan>& scans, int num_threads)
    : surface_(MakeSurface(scans)) {
  for (const Scan& scan : scans) {
    const Bounds bounds = FindBounds(scan);
    bounds_.min = bounds_.min.cwiseMin(bounds.min);
    bounds_.max = bounds_.max.cwiseMax(bounds.max);
    if (!scan.organised) continue;
    // What this station saw: where it has no echo, another scan's wall farther off says nothing of
    // what stands before it. Another scan's surface before its own is taken for there.
    std::unique_ptr<const RayCaster> own;
    if (scans.size() > 1) own = std::make_unique<RayCaster>(scan.points, BuildScanMesh(scan, {}));
    Station station;
    station.place = scan.Station();
    station.station_from_scan =
        RotationBetween(scan.up, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    const int columns = std::clamp(scan.num_columns, kMinColumns, kMaxColumns);
    cv::Mat1f range(columns / 2, columns, 0.0f);
    ParallelFor(num_threads, 0, range.rows, [&](int row) {
      const double elevation = kPi * ((row + 0.5) / range.rows - 0.5);
      for (int column = 0; column < range.cols; ++column) {
        const double azimuth = 2 * kPi * (column + 0.5) / range.cols - kPi;
        const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth),
                                        std::cos(elevation) * std::sin(azimuth),
                                        std::sin(elevation));
        const Eigen::Vector3d along = station.station_from_scan.transpose() * direction;
        if (own && !own->Cast(station.place, along, kNearDepth)) continue;
        const auto hit = surface_.Cast(station.place, along, kNearDepth);
        if (hit) range(row, column) = static_cast<float>(hit->distance);
      }
    });
    // Seen empty is what all directions around say; where one has no echo (a missing sample, the
    // crack beside a depth jump), the others do. Nothing is known where none has.
    constexpr float kNoEcho = 1e9f;
    range.setTo(kNoEcho, range == 0);
    cv::copyMakeBorder(range, range, 0, 0, kAround, kAround, cv::BORDER_WRAP);
    cv::erode(range, range,
              cv::getStructuringElement(cv::MORPH_RECT, {2 * kAround + 1, 2 * kAround + 1}));
    station.range = range.colRange(kAround, range.cols - kAround).clone();
    station.range.setTo(0, station.range == kNoEcho);
    stations_.push_back(std::move(station));
  }
}

bool ScanSpace::IsSeenEmpty(const Eigen::Vector3d& x_in_scan, double margin) const {
  for (const Station& station : stations_) {
    const Eigen::Vector3d x = station.station_from_scan * (x_in_scan - station.place);
    const double distance = x.norm();
    if (!(distance > 0)) return true;
    const double azimuth = std::atan2(x.y(), x.x());
    const double elevation = std::asin(std::clamp(x.z() / distance, -1.0, 1.0));
    const cv::Mat1f& range = station.range;
    const int column =
        std::clamp(static_cast<int>((azimuth / kPi + 1) / 2 * range.cols), 0, range.cols - 1);
    const int row =
        std::clamp(static_cast<int>((elevation / kPi + 0.5) * range.rows), 0, range.rows - 1);
    if (distance + margin < range(row, column)) return true;
  }
  return false;
}

bool ScanSpace::IsInRoom(const Eigen::Vector3d& x_in_scan, double margin) const {
  return ((x_in_scan - bounds_.min).array() > -margin).all() &&
         ((bounds_.max - x_in_scan).array() > -margin).all();
}

cv::Mat1f DepthOfSurface(const RayCaster& surface, const Camera& pinhole,
                         const Rigid& cam_from_scan, int num_threads) {
  const CameraProjection projection(pinhole);
  const Rigid scan_from_cam = cam_from_scan.Inverse();
  cv::Mat1f depth(pinhole.height, pinhole.width, 0.0f);
  ParallelFor(num_threads, 0, depth.rows, [&](int y) {
    for (int x = 0; x < depth.cols; ++x) {
      const Eigen::Vector3d ray = *projection.RayFromImg({x + 0.5, y + 0.5});
      const double length = ray.norm();
      const auto hit = surface.Cast(scan_from_cam.translation,
                                    scan_from_cam.rotation * (ray / length), kNearDepth);
      if (hit) depth(y, x) = static_cast<float>(hit->distance / length);
    }
  });
  return depth;
}

}  // namespace roomtex
