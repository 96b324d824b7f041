#include "colmap_ext/seed_model.h"

#include <cmath>

#include "core/frames.h"

namespace roomtex {
namespace {

// COLMAP's filter_min_tri_angle: its mapper would throw flatter points out again.
constexpr double kMinPointAngleDeg = 1.5;

void AddImage(const MatchedImages& images, uint32_t image_id, const Rigid& cam_from_model,
              SparseModel* model) {
  const DatabaseImage& entry = images.images().at(image_id);
  SparseImage image;
  image.image_id = image_id;
  image.camera_id = entry.camera_id;
  image.name = entry.name;
  image.cam_from_model = cam_from_model;
  model->images[image_id] = std::move(image);
  model->cameras[entry.camera_id] = images.cameras().at(entry.camera_id);
}

void AddKeypoints(MatchedImages* images, SparseImage* image) {
  image->points2d = images->Keypoints(image->image_id);
  image->point3d_ids.assign(image->points2d.size(), kInvalidPoint3dId);
}

}  // namespace

SparseModel MakePairModel(MatchedImages* images, const DatabasePair& pair,
                          const std::vector<RayMatch>& matches, const TwoViewHypothesis& solution) {
  SparseModel model;
  AddImage(*images, pair.image_id1, Rigid(), &model);
  AddImage(*images, pair.image_id2, solution.right_from_left, &model);
  SparseImage& left = model.images.at(pair.image_id1);
  SparseImage& right = model.images.at(pair.image_id2);
  AddKeypoints(images, &left);
  AddKeypoints(images, &right);
  for (size_t i = 0; i < solution.inliers.size(); ++i) {
    const RayMatch& match = matches[solution.inliers[i]];
    const double angle = TriangulationAngle(solution.right_from_left, solution.points[i]);
    if (!(angle >= RadFromDeg(kMinPointAngleDeg))) continue;
    uint64_t& left_id = left.point3d_ids[match.left_row];
    uint64_t& right_id = right.point3d_ids[match.right_row];
    if (left_id != kInvalidPoint3dId || right_id != kInvalidPoint3dId) continue;
    const uint64_t point_id = model.points.size() + 1;
    left_id = right_id = point_id;
    SparsePoint& point = model.points[point_id];
    point.x_in_model = PointInLeft(solution.points[i]);
    point.track = {{pair.image_id1, static_cast<uint32_t>(match.left_row)},
                   {pair.image_id2, static_cast<uint32_t>(match.right_row)}};
  }
  UpdateReprojectionErrors(&model);
  return model;
}

SparseModel MakePoseModel(const MatchedImages& images,
                          const std::map<uint32_t, Rigid>& cam_from_model) {
  SparseModel model;
  for (const auto& [image_id, pose] : cam_from_model) AddImage(images, image_id, pose, &model);
  return model;
}

}  // namespace roomtex
