#pragma once
// Databases that hold less than the kitchen's: only what lies on one plane, or only a chain of
// neighbours with few points in common to three. Real keypoints, real noise, and an answer to
// compare with: the model of all matches.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <random>
#include <set>
#include <string>
#include <vector>

#include <Eigen/Dense>
#include <SQLiteCpp/SQLiteCpp.h>

#include "colmap_ext/matched_images.h"
#include "colmap_ext/sparse_model.h"
#include "colmap_ext/two_view_geometry.h"
#include "core/statistics.h"

namespace roomtex {

// n . x = offset, in the model's frame.
struct ModelPlane {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double offset = 0;
  int num_points = 0;
};

// The planes with most points of a model, each without the points near those before it.
inline std::vector<ModelPlane> LargestPlanes(const SparseModel& model, int count) {
  std::vector<Eigen::Vector3d> points;
  for (const auto& [point_id, point] : model.points) points.push_back(point.x_in_model);
  const Eigen::Vector3d centre = model.images.begin()->second.cam_from_model.TargetOriginInSource();
  std::vector<double> distances;
  for (const Eigen::Vector3d& x : points) distances.push_back((x - centre).norm());
  const double tolerance = 0.006 * Median(&distances);
  std::mt19937_64 random(1);
  std::vector<ModelPlane> planes;
  for (int k = 0; k < count; ++k) {
    ModelPlane best;
    for (int sample = 0; sample < 4000; ++sample) {
      const Eigen::Vector3d& a = points[random() % points.size()];
      const Eigen::Vector3d& b = points[random() % points.size()];
      const Eigen::Vector3d& c = points[random() % points.size()];
      ModelPlane plane;
      plane.normal = (b - a).cross(c - a).normalized();
      if (!(plane.normal.norm() > 0.5)) continue;  // the same point twice
      plane.offset = plane.normal.dot(a);
      for (const Eigen::Vector3d& x : points) {
        plane.num_points += std::abs(plane.normal.dot(x) - plane.offset) < tolerance;
      }
      if (plane.num_points > best.num_points) best = plane;
    }
    planes.push_back(best);
    points.erase(std::remove_if(points.begin(), points.end(),
                                [&](const Eigen::Vector3d& x) {
                                  return std::abs(best.normal.dot(x) - best.offset) < 2 * tolerance;
                                }),
                 points.end());
  }
  return planes;
}

// A copy of a database whose verified matches are those given, and whose images are those of them.
class SubsetWriter {
 public:
  SubsetWriter(const std::string& database_path, const std::string& subset_path)
      : database_(Copy(database_path, subset_path), SQLite::OPEN_READWRITE) {
    database_.exec("BEGIN; DELETE FROM matches; DELETE FROM two_view_geometries");
  }
  // rows: of image_id1 and image_id2 in turn, image_id1 < image_id2.
  void AddPair(uint32_t image_id1, uint32_t image_id2, const std::vector<uint32_t>& rows) {
    SQLite::Statement insert(database_,
                             "INSERT INTO two_view_geometries (pair_id, rows, cols, data, config) "
                             "VALUES (?, ?, 2, ?, 2)");
    insert.bind(1, static_cast<int64_t>(PairIdFromImages(image_id1, image_id2)));
    insert.bind(2, static_cast<int>(rows.size() / 2));
    insert.bind(3, rows.data(), static_cast<int>(rows.size() * sizeof(uint32_t)));
    insert.exec();
    images_.insert({image_id1, image_id2});
  }
  // The number of images left.
  int Finish() {
    std::string ids;
    for (const uint32_t image_id : images_) {
      ids += (ids.empty() ? "" : ", ") + std::to_string(image_id);
    }
    database_.exec("DELETE FROM images WHERE image_id NOT IN (" + ids +
                   "); DELETE FROM keypoints WHERE image_id NOT IN (" + ids + "); COMMIT");
    return static_cast<int>(images_.size());
  }

 private:
  static std::string Copy(const std::string& from, const std::string& to) {
    std::filesystem::copy_file(from, to);
    return to;
  }
  SQLite::Database database_;
  std::set<uint32_t> images_;
};

// Only matches that lie on the plane (2.5 px), in pairs that keep 30 of them. The number of images.
inline int WritePlanarSubset(const std::string& database_path, const SparseModel& model,
                             const ModelPlane& plane, const std::string& subset_path) {
  const Database database(database_path);
  MatchedImages images(model.cameras, database.ReadImages(), database.ReadPairs(1),
                       [&](uint32_t image_id) { return database.ReadKeypoints(image_id); });
  SubsetWriter subset(database_path, subset_path);
  for (const DatabasePair& pair : images.pairs()) {
    const Rigid& left = model.images.at(pair.image_id1).cam_from_model;
    const Rigid right_from_left = model.images.at(pair.image_id2).cam_from_model * left.Inverse();
    const Eigen::Vector3d normal_in_left = left.rotation * plane.normal;
    const double offset = plane.offset + normal_in_left.dot(left.translation);
    // x_r ~ (R + t n^T / d) x_l on the plane n . x = d.
    const Eigen::Matrix3d homography =
        right_from_left.rotation.toRotationMatrix() +
        right_from_left.translation * normal_in_left.transpose() / offset;
    std::vector<uint32_t> rows;
    for (const RayMatch& match : images.Matches(pair)) {
      if (!(HomographyError2(homography, match) < 2.5 * 2.5)) continue;
      rows.push_back(static_cast<uint32_t>(match.left_row));
      rows.push_back(static_cast<uint32_t>(match.right_row));
    }
    if (rows.size() >= 2 * 30) subset.AddPair(pair.image_id1, pair.image_id2, rows);
  }
  return subset.Finish();
}

// Only neighbours in the order of names, the first `count` photos; a keypoint that the pair before
// matched is used again num_triples times a pair at most; seed: which of them. The number of
// images.
inline int WriteChainSubset(const std::string& database_path, int count, int num_triples, int seed,
                            const std::string& subset_path) {
  const Database database(database_path);
  std::vector<std::pair<std::string, uint32_t>> order;
  for (const auto& [image_id, image] : database.ReadImages())
    order.emplace_back(image.name, image_id);
  std::sort(order.begin(), order.end());
  std::map<std::pair<uint32_t, uint32_t>, DatabasePair> pairs;
  for (const DatabasePair& pair : database.ReadPairs(1)) {
    pairs[{pair.image_id1, pair.image_id2}] = pair;
  }
  std::mt19937_64 random(seed);
  SubsetWriter subset(database_path, subset_path);
  std::set<int> rows_before;  // of the left photo, matched with its own left neighbour
  for (int k = 0; k + 1 < count; ++k) {
    const uint32_t left = order[k].second, right = order[k + 1].second;
    const int own = left < right ? 0 : 1;
    std::vector<Eigen::Vector2i> matches = pairs.at(std::minmax(left, right)).matches;
    for (size_t i = matches.size(); i > 1; --i) std::swap(matches[i - 1], matches[random() % i]);
    std::vector<uint32_t> rows;
    std::set<int> right_rows;
    int num_used_again = 0;
    for (const Eigen::Vector2i& match : matches) {
      if (rows_before.count(match[own]) > 0 && num_used_again++ >= num_triples) continue;
      rows.push_back(static_cast<uint32_t>(match[0]));
      rows.push_back(static_cast<uint32_t>(match[1]));
      right_rows.insert(match[1 - own]);
    }
    subset.AddPair(std::min(left, right), std::max(left, right), rows);
    rows_before = std::move(right_rows);
  }
  return subset.Finish();
}

}  // namespace roomtex
