#include "align/fit/bent_model.h"

#include <map>
#include <memory>
#include <vector>

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "align/fit/plane_bundle_costs.h"
#include "colmap_ext/solver_log.h"

namespace roomtex {
namespace {

// Pixels; beyond this a point that the bend moves against the others counts linearly.
constexpr double kHuber_px = 5;
constexpr int kMinPoints = 6;  // fewer leave a photo's pose as it is

// Where the first of the photos of one frame (or a single one) goes; the others keep their place
// beside it.
Rigid BentPose(const SparseModel& straight, const std::vector<uint32_t>& frame,
               const ScanBend& bend) {
  const Rigid& first = straight.images.at(frame[0]).cam_from_model;
  PoseParameters pose(first);
  size_t num_points = 0;
  for (const uint32_t image_id : frame) num_points += straight.images.at(image_id).points2d.size();
  std::vector<Eigen::Vector3d> bent;
  bent.reserve(num_points);  // Ceres keeps pointers into it
  ceres::HuberLoss loss(kHuber_px);
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  for (const uint32_t image_id : frame) {
    const SparseImage& image = straight.images.at(image_id);
    const Camera& camera = straight.cameras.at(image.camera_id);
    const CameraProjection projection(camera);
    const Rigid cam_from_first = image.cam_from_model * first.Inverse();
    for (const uint64_t id : image.point3d_ids) {
      if (id == kInvalidPoint3dId) continue;
      const Eigen::Vector3d& x_in_scan = straight.points.at(id).x_in_model;
      const auto x_in_img = projection.ImgFromCam(image.cam_from_model * x_in_scan);
      const Eigen::Vector3d bent_in_scan = bend.Bend(x_in_scan);
      if (!x_in_img || !projection.InImage(*x_in_img)) continue;
      if (!projection.ImgFromCam(image.cam_from_model * bent_in_scan)) continue;
      bent.push_back(bent_in_scan);
      problem.AddResidualBlock(
          new ReprojectionCost(pose, camera, *x_in_img, 1, false, cam_from_first), &loss,
          pose.values, bent.back().data());
      problem.SetParameterBlockConstant(bent.back().data());
    }
  }
  if (problem.NumResidualBlocks() < kMinPoints) return first;
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  SilenceCeres();
  ceres::Solve(options, &problem, &summary);
  return summary.IsSolutionUsable() ? pose.CamFromScan() : first;
}

}  // namespace

SparseModel BendModel(const SparseModel& straight, const ScanBend& bend) {
  SparseModel bent = straight;
  if (bend.IsNone()) return bent;
  std::map<uint32_t, std::vector<uint32_t>> rig_frames;  // photos of one frame move together
  std::vector<std::vector<uint32_t>> frames;
  for (const auto& [id, image] : straight.images) {
    if (image.frame_id == kNoFrame) {
      frames.push_back({id});
    } else {
      rig_frames[image.frame_id].push_back(id);
    }
  }
  for (auto& [frame_id, photos] : rig_frames) frames.push_back(std::move(photos));
  for (const std::vector<uint32_t>& frame : frames) {
    const Rigid straight_from_first = straight.images.at(frame[0]).cam_from_model.Inverse();
    const Rigid first_from_scan = BentPose(straight, frame, bend);
    for (const uint32_t id : frame) {
      Rigid& cam_from_model = bent.images.at(id).cam_from_model;
      cam_from_model = cam_from_model * straight_from_first * first_from_scan;
    }
  }
  for (auto& [id, point] : bent.points) point.x_in_model = bend.Bend(point.x_in_model);
  return bent;
}

}  // namespace roomtex
