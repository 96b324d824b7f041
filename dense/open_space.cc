#include "dense/open_space.h"

#include <algorithm>

#include "colmap_ext/dense_workspace.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

constexpr int kBlockPx = 4;          // of the raster of open space
constexpr double kNearest = 0.35;    // metres: nearer than any thing that is photographed sharply
constexpr double kBeyondRoom = 0.1;  // metres that surfaces may lie outside the scan's box
constexpr int kNormalRadiusPx = 3;   // of the scan's normals

}  // namespace

OpenSpace::OpenSpace(const ScanSpace& space, const StereoPicture& picture, double margin,
                     int num_threads)
    : scan_depth_(
          DepthOfSurface(space.surface(), picture.camera, picture.cam_from_scan, num_threads)),
      scan_normals_(NormalsOfDepth(scan_depth_, picture.camera.params, kNormalRadiusPx)),
      columns_((picture.camera.width + kBlockPx - 1) / kBlockPx),
      rows_((picture.camera.height + kBlockPx - 1) / kBlockPx) {
  const Eigen::Vector3d centre = picture.cam_from_scan.TargetOriginInSource();
  const Eigen::Vector3d size = space.bounds().max - space.bounds().min;
  const Eigen::Vector3d middle = 0.5 * (space.bounds().max + space.bounds().min);
  const double farthest = (centre - middle).norm() + 0.5 * size.norm() + kBeyondRoom;
  first_ = static_cast<float>(1 / farthest);
  // Of things smaller than a room all depths are nearer than kNearest.
  last_ = std::max(static_cast<float>(1 / kNearest), 2 * first_);
  const CameraProjection projection(picture.camera);
  const Rigid scan_from_cam = picture.cam_from_scan.Inverse();
  std::vector<uint64_t> raw(static_cast<size_t>(columns_) * rows_, 0);
  ParallelFor(num_threads, 0, rows_, [&](int row) {
    for (int column = 0; column < columns_; ++column) {
      const int x = std::min(column * kBlockPx + kBlockPx / 2, picture.camera.width - 1);
      const int y = std::min(row * kBlockPx + kBlockPx / 2, picture.camera.height - 1);
      const Eigen::Vector3d ray = *projection.RayFromImg({x + 0.5, y + 0.5});
      const double scan = scan_depth_(y, x) > 0 ? scan_depth_(y, x) - margin : farthest;
      uint64_t bins = 0;
      for (int bin = 0; bin < kBins; ++bin) {
        const double depth = 1 / (first_ + (last_ - first_) * (bin + 0.5) / kBins);
        if (depth > scan) continue;
        const Eigen::Vector3d place = scan_from_cam * (ray * depth);
        // A ray that nears a wall passes through what no scanner could see empty: nothing is there.
        if (space.IsInRoom(place, kBeyondRoom) && !space.IsSeenEmpty(place, margin) &&
            !space.surface().DistanceTo(place, 2 * margin)) {
          bins |= uint64_t{1} << bin;
        }
      }
      raw[static_cast<size_t>(row) * columns_ + column] = bins;
    }
  });
  // What is open beside a block or a bin may be open here: places are looked at one by one later.
  bins_ = raw;
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      uint64_t bins = 0;
      for (int r = std::max(row - 1, 0); r <= std::min(row + 1, rows_ - 1); ++r) {
        for (int c = std::max(column - 1, 0); c <= std::min(column + 1, columns_ - 1); ++c) {
          bins |= raw[static_cast<size_t>(r) * columns_ + c];
        }
      }
      bins_[static_cast<size_t>(row) * columns_ + column] = bins | bins << 1 | bins >> 1;
    }
  }
}

uint64_t OpenSpace::BinsAt(double x_share, double y_share) const {
  const int column =
      std::clamp(static_cast<int>(x_share * scan_depth_.cols) / kBlockPx, 0, columns_ - 1);
  const int row = std::clamp(static_cast<int>(y_share * scan_depth_.rows) / kBlockPx, 0, rows_ - 1);
  return bins_[static_cast<size_t>(row) * columns_ + column];
}

uint64_t OpenSpace::BinsInFront(double x_share, double y_share) const {
  const float z = scan_depth_(static_cast<int>(y_share * scan_depth_.rows),
                              static_cast<int>(x_share * scan_depth_.cols));
  const uint64_t bins = BinsAt(x_share, y_share);
  if (!(z > 0)) return bins;
  const int last = Bin(1 / z);
  return last >= kBins - 1 ? 0 : bins >> (last + 1) << (last + 1);
}

}  // namespace roomtex
