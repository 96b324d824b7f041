#include "colmap_ext/database.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <set>
#include <tuple>

#include "colmap_ext/database_file.h"

namespace roomtex {
namespace {

// The images of a row whose first column is a pair id.
std::pair<uint32_t, uint32_t> PairOfRow(const DatabaseRow& row) {
  const auto pair_id = static_cast<uint64_t>(row.Integer(0, 0, INT64_MAX));
  const std::pair<uint32_t, uint32_t> pair = ImagesFromPairId(pair_id);
  if (pair_id / kMaxNumImages >= kMaxNumImages || pair.first >= pair.second) {
    row.Fail("is not the id of a pair of two images");
  }
  return pair;
}

// Calls use(values, num_columns) for every keypoint of an image.
void ForEachKeypoint(const DatabaseFile& file, uint32_t image_id,
                     const std::function<void(const float*, int64_t)>& use) {
  file.ForEachRow(
      "keypoints", "SELECT image_id, rows, cols, data FROM keypoints WHERE image_id = ?",
      [&](const DatabaseRow& row) {
        const int64_t num_rows = row.Integer(1, 0, INT32_MAX);
        const int64_t num_columns = row.Integer(2, 0, INT32_MAX);
        if (num_rows > 0 && num_columns != 2 && num_columns != 4 && num_columns != 6) {
          row.Fail("keypoints have " + std::to_string(num_columns) +
                   " columns, expected 2, 4 or 6");
        }
        const std::vector<float> values = row.Blob<float>(3, num_rows, num_columns);
        for (int64_t i = 0; i < num_rows; ++i) {
          const float* keypoint = values.data() + i * num_columns;
          if (!std::isfinite(keypoint[0]) || !std::isfinite(keypoint[1])) {
            row.Fail("keypoint " + std::to_string(i) + " is not a finite position");
          }
          use(keypoint, num_columns);
        }
      },
      image_id);
}

// COLMAP's columns: x, y; then scale and orientation, or an affine shape by rows.
float KeypointScale(const float* values, int64_t num_columns) {
  const float scale =
      num_columns == 4   ? values[2]
      : num_columns == 6 ? (std::hypot(values[2], values[4]) + std::hypot(values[3], values[5])) / 2
                         : 1.0f;
  return std::isfinite(scale) ? scale : 0.0f;
}

}  // namespace

uint64_t PairIdFromImages(uint32_t image_id1, uint32_t image_id2) {
  return kMaxNumImages * std::min(image_id1, image_id2) + std::max(image_id1, image_id2);
}

std::pair<uint32_t, uint32_t> ImagesFromPairId(uint64_t pair_id) {
  return {static_cast<uint32_t>(pair_id / kMaxNumImages),
          static_cast<uint32_t>(pair_id % kMaxNumImages)};
}

Database::Database(const std::string& path) : file_(std::make_unique<DatabaseFile>(path)) {
  file_->RequireColumns("cameras",
                        {"camera_id", "model", "width", "height", "params", "prior_focal_length"});
  file_->RequireColumns("images", {"image_id", "name", "camera_id"});
  file_->RequireColumns("keypoints", {"image_id", "rows", "cols", "data"});
  file_->RequireColumns("two_view_geometries", {"pair_id", "rows", "cols", "data", "config"});
}

Database::~Database() = default;

const std::string& Database::path() const { return file_->path(); }

std::map<uint32_t, Camera> Database::ReadCameras() const {
  std::map<uint32_t, Camera> cameras;
  file_->ForEachRow(
      "cameras",
      "SELECT camera_id, model, width, height, params, prior_focal_length FROM cameras "
      "ORDER BY camera_id",
      [&](const DatabaseRow& row) {
        Camera camera;
        camera.camera_id = row.Id(0);
        camera.model = static_cast<CameraModel>(row.Integer(1, 0, kNumCameraModels - 1));
        camera.width = static_cast<int>(row.Integer(2, 1, INT32_MAX));
        camera.height = static_cast<int>(row.Integer(3, 1, INT32_MAX));
        camera.params = row.Blob<double>(4, NumCameraParams(static_cast<int>(camera.model)), 1);
        camera.has_prior_focal_length = row.Integer(5, INT32_MIN, INT32_MAX) != 0;
        const std::vector<std::string> problems = camera.Problems();
        if (!problems.empty()) row.Fail(problems[0]);
        cameras.emplace_hint(cameras.end(), camera.camera_id, std::move(camera));
      });
  return cameras;
}

std::map<uint32_t, DatabaseImage> Database::ReadImages() const {
  std::set<uint32_t> camera_ids;
  file_->ForEachRow("cameras", "SELECT camera_id FROM cameras",
                    [&](const DatabaseRow& row) { camera_ids.insert(row.Id(0)); });
  std::map<uint32_t, DatabaseImage> images;
  std::set<std::string> names;
  file_->ForEachRow("images", "SELECT image_id, camera_id, name FROM images ORDER BY image_id",
                    [&](const DatabaseRow& row) {
                      DatabaseImage image{row.Id(0), row.Id(1), row.Text(2)};
                      if (camera_ids.count(image.camera_id) == 0) {
                        row.Fail("names camera " + std::to_string(image.camera_id) +
                                 ", which the table cameras does not hold");
                      }
                      if (!names.insert(image.name).second)
                        row.Fail("has the name of another image");
                      images.emplace_hint(images.end(), image.image_id, std::move(image));
                    });
  return images;
}

std::map<uint32_t, size_t> Database::CountKeypoints() const {
  std::map<uint32_t, size_t> counts;
  file_->ForEachRow("keypoints", "SELECT image_id, rows FROM keypoints ORDER BY image_id",
                    [&](const DatabaseRow& row) {
                      counts[row.Id(0)] = static_cast<size_t>(row.Integer(1, 0, INT32_MAX));
                    });
  return counts;
}

std::vector<Eigen::Vector2d> Database::ReadKeypoints(uint32_t image_id) const {
  std::vector<Eigen::Vector2d> keypoints;
  ForEachKeypoint(*file_, image_id, [&](const float* values, int64_t) {
    keypoints.emplace_back(values[0], values[1]);
  });
  return keypoints;
}

DatabaseFeatures Database::ReadLargestFeatures(uint32_t image_id, int max_features) const {
  std::vector<Eigen::Vector2d> x_in_img;
  std::vector<float> scales;
  ForEachKeypoint(*file_, image_id, [&](const float* values, int64_t num_columns) {
    x_in_img.emplace_back(values[0], values[1]);
    scales.push_back(KeypointScale(values, num_columns));
  });
  std::vector<size_t> order(scales.size());
  std::iota(order.begin(), order.end(), size_t{0});
  const size_t count = std::min(order.size(), static_cast<size_t>(std::max(0, max_features)));
  std::partial_sort(
      order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count), order.end(),
      [&](size_t a, size_t b) { return scales[a] != scales[b] ? scales[a] > scales[b] : a < b; });
  DatabaseFeatures features;
  bool has_row = false;
  file_->RequireColumns("descriptors", {"image_id", "rows", "cols", "data"});
  file_->ForEachRow(
      "descriptors", "SELECT image_id, rows, cols, data FROM descriptors WHERE image_id = ?",
      [&](const DatabaseRow& row) {
        has_row = true;
        const int64_t num_rows = row.Integer(1, 0, INT32_MAX);
        const int64_t num_columns = row.Integer(2, 0, INT32_MAX);
        if (num_rows > 0 && num_columns != kSiftSize) {
          row.Fail("descriptors have " + std::to_string(num_columns) +
                   " bytes, expected the 128 of SIFT");
        }
        if (num_rows != static_cast<int64_t>(scales.size())) {
          row.Fail("has " + std::to_string(num_rows) + " descriptors for " +
                   std::to_string(scales.size()) + " keypoints");
        }
        const std::vector<uint8_t> bytes = row.Blob<uint8_t>(3, num_rows, num_columns);
        features.descriptors.reserve(count * kSiftSize);
        for (size_t i = 0; i < count; ++i) {
          const uint8_t* first = bytes.data() + order[i] * kSiftSize;
          features.descriptors.insert(features.descriptors.end(), first, first + kSiftSize);
          features.x_in_img.push_back(x_in_img[order[i]]);
        }
      },
      image_id);
  if (!has_row && !scales.empty()) {
    throw InputError(path(), "table descriptors, image_id " + std::to_string(image_id),
                     "is missing, but the image has keypoints", kDatabaseRemedy);
  }
  return features;
}

std::map<std::pair<uint32_t, uint32_t>, size_t> Database::CountMatches() const {
  const std::map<uint32_t, DatabaseImage> images = ReadImages();
  std::map<std::pair<uint32_t, uint32_t>, size_t> counts;
  file_->ForEachRow("two_view_geometries",
                    "SELECT pair_id, rows FROM two_view_geometries ORDER BY pair_id",
                    [&](const DatabaseRow& row) {
                      const auto pair = PairOfRow(row);
                      if (images.count(pair.first) == 0 || images.count(pair.second) == 0) return;
                      counts[pair] = static_cast<size_t>(row.Integer(1, 0, INT32_MAX));
                    });
  return counts;
}

std::vector<DatabasePair> Database::ReadPairs(int min_matches) const {
  const std::map<uint32_t, DatabaseImage> images = ReadImages();
  const std::map<uint32_t, size_t> num_keypoints = CountKeypoints();
  const auto count_of = [&](uint32_t image_id) {
    const auto found = num_keypoints.find(image_id);
    return found == num_keypoints.end() ? size_t{0} : found->second;
  };
  std::vector<DatabasePair> pairs;
  file_->ForEachRow(
      "two_view_geometries",
      "SELECT pair_id, rows, cols, data, config FROM two_view_geometries WHERE rows >= ? "
      "ORDER BY pair_id",
      [&](const DatabaseRow& row) {
        DatabasePair pair;
        std::tie(pair.image_id1, pair.image_id2) = PairOfRow(row);
        if (images.count(pair.image_id1) == 0 || images.count(pair.image_id2) == 0) return;
        const int64_t num_rows = row.Integer(1, 0, INT32_MAX);
        const int64_t num_columns = row.Integer(2, 0, INT32_MAX);
        if (num_rows > 0 && num_columns != 2) {
          row.Fail("matches have " + std::to_string(num_columns) + " columns, expected 2");
        }
        const std::vector<uint32_t> values = row.Blob<uint32_t>(3, num_rows, num_columns);
        pair.config = static_cast<int>(row.Integer(4, INT32_MIN, INT32_MAX));
        const size_t limit1 = count_of(pair.image_id1), limit2 = count_of(pair.image_id2);
        pair.matches.reserve(static_cast<size_t>(num_rows));
        for (size_t i = 0; i + 1 < values.size(); i += 2) {
          if (values[i] >= limit1 || values[i + 1] >= limit2) {
            row.Fail("match " + std::to_string(i / 2) + " joins keypoints " +
                     std::to_string(values[i]) + " and " + std::to_string(values[i + 1]) +
                     " of images " + std::to_string(pair.image_id1) + " and " +
                     std::to_string(pair.image_id2) + ", which have " + std::to_string(limit1) +
                     " and " + std::to_string(limit2));
          }
          pair.matches.emplace_back(static_cast<int>(values[i]), static_cast<int>(values[i + 1]));
        }
        pairs.push_back(std::move(pair));
      },
      min_matches);
  return pairs;
}

size_t Database::CountPairs() const {
  size_t count = 0;
  file_->ForEachRow(
      "two_view_geometries", "SELECT COUNT(*) FROM two_view_geometries WHERE rows > 0",
      [&](const DatabaseRow& row) { count = static_cast<size_t>(row.Integer(0, 0, INT64_MAX)); });
  return count;
}

}  // namespace roomtex
