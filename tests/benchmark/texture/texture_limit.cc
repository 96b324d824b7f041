#include "tests/benchmark/texture/texture_limit.h"

#include <algorithm>
#include <array>
#include <ctime>

#include "core/photo.h"
#include "texture/sampling/mesh_tiles.h"
#include "texture/sampling/smoothed_scan.h"
#include "texture/sampling/visibility.h"

namespace roomtex {
namespace {

constexpr double kDepthMapSize = 1024;     // thesis 8.1.1
constexpr float kDepthTolerance = 0.008f;  // thesis 8.1.2

double ThreadSeconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// Adds the nearest pixel's light to every sample that passes the depth test.
size_t AddSamples(const PhotoProjector& projector, const std::vector<SampleTile>& tiles,
                  const DepthMap& map, const cv::Mat& image,
                  std::vector<Eigen::Vector4f>* light_sums) {
  const std::array<float, 256>& linear = LinearFromSrgbByte();
  ProjectedBlock projected;
  size_t count = 0;
  for (const SampleTile& tile : tiles) {
    if (!projector.MaySee(tile.points.origin, tile.points.radius)) continue;
    projector.Project(tile.points, &projected);
    for (int i = 0; i < tile.points.size(); ++i) {
      const float x = projected.x[i], y = projected.y[i], depth = projected.depth[i];
      const auto width = static_cast<float>(image.cols), height = static_cast<float>(image.rows);
      if (!(depth > 0) || !(x >= 0 && y >= 0 && x < width && y < height)) continue;
      const cv::Mat1f& w = map.inverse_depth();
      const int column = std::min(static_cast<int>(x * map.scale_x()), w.cols - 1);
      const int row = std::min(static_cast<int>(y * map.scale_y()), w.rows - 1);
      if (w(row, column) * depth > 1 + kDepthTolerance) continue;
      const auto& bgr = image.at<cv::Vec3b>(static_cast<int>(y), static_cast<int>(x));
      (*light_sums)[tile.index[i]] +=
          Eigen::Vector4f(linear[bgr[2]], linear[bgr[1]], linear[bgr[0]], 1);
      ++count;
    }
  }
  return count;
}

}  // namespace

TextureLimit MeasureTextureLimit(const Scan& scan, const std::vector<PhotoView>& photos) {
  const SmoothedScan surface = MakeSmoothedScan(scan, {}, {}, 1);
  const OccluderTiles occluders = MakeOccluderTiles(scan, surface);
  const std::vector<SampleTile> samples = MakeSampleTiles(
      scan.num_columns, scan.num_rows, scan.points, surface.normals, scan.Station());
  std::vector<Eigen::Vector4f> light_sums(scan.points.size(), Eigen::Vector4f::Zero());
  TextureLimit limit;
  for (const PhotoView& photo : photos) {
    const double start = ThreadSeconds();
    const cv::Mat image = ReadPhoto(photo.path);
    const double decoded = ThreadSeconds();
    const PhotoProjector projector(photo);
    const int size = std::max(projector.width(), projector.height());
    DepthMap map(projector.width(), projector.height(), std::min(1.0, kDepthMapSize / size));
    map.Draw(projector, occluders.surface);
    const double drawn = ThreadSeconds();
    limit.num_samples += AddSamples(projector, samples, map, image, &light_sums);
    limit.decode_seconds += decoded - start;
    limit.draw_seconds += drawn - decoded;
    limit.sample_seconds += ThreadSeconds() - drawn;
    for (const MeshTile& tile : occluders.surface) {
      if (projector.MaySee(tile.points.origin, tile.points.radius)) {
        limit.num_triangles += tile.triangles.size();
      }
    }
  }
  for (const Eigen::Vector4f& sum : light_sums) {
    limit.num_seen += sum[3] > 0;
    limit.mean_light.push_back(sum[3] > 0 ? Eigen::Vector3f(sum.head<3>() / sum[3])
                                          : Eigen::Vector3f(Eigen::Vector3f::Zero()));
  }
  return limit;
}

}  // namespace roomtex
