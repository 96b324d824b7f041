#pragma once
// Photos along a wall whose neighbours overlap well while few points are seen three times: what
// PnP cannot register (docs/colmap.md, "Views the mapper leaves out").

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "tests/colmap_ext/simulated_views.h"

namespace roomtex {

// Keeps, of the points that three or more views see, `num_triple` per run of three neighbours and
// makes the others points of one pair of neighbours each (as matching does that finds every point
// in one pair only). Pairs that are no neighbours, or lie two apart, lose their other matches.
inline SimulatedViews ThinOutTriples(SimulatedViews views, const std::vector<int>& num_triple,
                                     int random_seed) {
  std::mt19937_64 random(random_seed * 104729 + 5);
  std::map<int, std::vector<uint32_t>> seen_by;  // point -> views
  for (const auto& [image_id, points] : views.point_of_keypoint) {
    for (const int point : points) seen_by[point].push_back(image_id);
  }
  std::vector<int> order;
  for (const auto& [point, images] : seen_by) order.push_back(point);
  for (size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random() % i]);
  std::vector<int> left = num_triple;
  std::map<int, std::pair<uint32_t, uint32_t>> views_of_point;  // first and last that may match it
  for (const int point : order) {
    const std::vector<uint32_t>& images = seen_by[point];
    const auto sees = [&](uint32_t image_id) {
      return std::count(images.begin(), images.end(), image_id) > 0;
    };
    uint32_t first = images[random() % images.size()];
    if (first == images.back() && images.size() > 1) --first;
    uint32_t last = std::min(first + 1, images.back());
    for (size_t k = 0; k < left.size(); ++k) {
      const uint32_t start = static_cast<uint32_t>(k + 1);
      if (left[k] == 0 || !sees(start) || !sees(start + 1) || !sees(start + 2)) continue;
      --left[k];
      first = start;
      last = start + 2;
      break;
    }
    views_of_point[point] = {first, last};
  }
  for (DatabasePair& pair : views.pairs) {
    const auto lost = [&](const Eigen::Vector2i& match) {
      const auto [first, last] =
          views_of_point.at(views.point_of_keypoint.at(pair.image_id1)[match.x()]);
      return pair.image_id1 < first || pair.image_id2 > last;
    };
    pair.matches.erase(std::remove_if(pair.matches.begin(), pair.matches.end(), lost),
                       pair.matches.end());
  }
  views.pairs.erase(std::remove_if(views.pairs.begin(), views.pairs.end(),
                                   [](const DatabasePair& pair) { return pair.matches.empty(); }),
                    views.pairs.end());
  return views;
}

// Eight photos, 3 m before the wall; 5 to 48 points in common to three neighbours.
inline SimulatedViews WeakWallSequence(SimulatedViewsOptions::Scene scene, int random_seed) {
  SimulatedViewsOptions options;
  options.scene = scene;
  options.num_views = 8;
  options.num_points = 3000;
  options.baseline = 0.5;
  options.outlier_share = 0.05;
  options.random_seed = random_seed;
  return ThinOutTriples(SimulateViews(options), {48, 40, 12, 30, 8, 20}, random_seed);
}

// The keypoints of one view that only one other view matches come from a photo taken elsewhere: its
// two-view geometry is consistent, and wrong for the points it shares with the rest.
inline SimulatedViews WithGhostView(SimulatedViews views, uint32_t ghost_id) {
  Rigid ghost_from_cam;
  ghost_from_cam.rotation = Eigen::AngleAxisd(0.06, Eigen::Vector3d::UnitY());
  ghost_from_cam.translation = Eigen::Vector3d(0.35, 0.2, 0.3);
  const Rigid ghost_from_scene = ghost_from_cam * views.cam_from_scene.at(ghost_id);
  std::map<int, int> num_pairs;  // by keypoint row
  for (const DatabasePair& pair : views.pairs) {
    if (pair.image_id1 != ghost_id && pair.image_id2 != ghost_id) continue;
    const int own = pair.image_id1 == ghost_id ? 0 : 1;
    for (const Eigen::Vector2i& match : pair.matches) ++num_pairs[match[own]];
  }
  const CameraProjection projection(views.cameras.at(views.images.at(ghost_id).camera_id));
  for (const auto& [row, count] : num_pairs) {
    if (count > 1) continue;
    const int point = views.point_of_keypoint.at(ghost_id)[row];
    const auto x_in_img = projection.ImgFromCam(ghost_from_scene * views.points_in_scene[point]);
    if (x_in_img) views.keypoints.at(ghost_id)[row] = *x_in_img;
  }
  return views;
}

// On a repeated texture (SimulatedViewsOptions::period): all matches of one pair go one period too
// far, as consistent among themselves as the right ones.
inline SimulatedViews WithShiftedPair(SimulatedViews views, uint32_t image_id1,
                                      uint32_t image_id2) {
  std::map<int, int> row_of_point;  // in image 2
  const std::vector<int>& points2 = views.point_of_keypoint.at(image_id2);
  for (size_t row = 0; row < points2.size(); ++row) {
    row_of_point[points2[row]] = static_cast<int>(row);
  }
  for (DatabasePair& pair : views.pairs) {
    if (pair.image_id1 != image_id1 || pair.image_id2 != image_id2) continue;
    pair.matches.clear();
    const std::vector<int>& points1 = views.point_of_keypoint.at(image_id1);
    for (size_t row = 0; row < points1.size(); ++row) {
      const auto found = row_of_point.find(views.next_in_period.at(points1[row]));
      if (found == row_of_point.end()) continue;
      pair.matches.emplace_back(static_cast<int>(row), found->second);
    }
  }
  return views;
}

// Keeps the pairs of neighbours only, each point matched in one of them: what chains up freely.
inline SimulatedViews WithoutTriples(const SimulatedViews& views, int random_seed) {
  return ThinOutTriples(views, {}, random_seed);
}

}  // namespace roomtex
