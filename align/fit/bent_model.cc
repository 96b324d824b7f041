#include "align/fit/bent_model.h"

#include <map>
#include <memory>
#include <vector>

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "align/fit/plane_bundle_costs.h"

namespace roomtex {
namespace {

// Pixels; beyond this a point that the bend moves against the others counts linearly.
constexpr double kHuber_px = 5;
constexpr int kMinPoints = 6;  // fewer leave a photo's pose as it is

Rigid BentPose(const SparseModel& straight, const SparseImage& image, const ScanBend& bend) {
  const Camera& camera = straight.cameras.at(image.camera_id);
  const CameraProjection projection(camera);
  const Rigid& cam_from_straight = image.cam_from_model;
  PoseParameters pose(cam_from_straight);
  std::vector<Eigen::Vector3d> bent;
  bent.reserve(image.point3d_ids.size());  // Ceres keeps pointers into it
  ceres::HuberLoss loss(kHuber_px);
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  for (const uint64_t id : image.point3d_ids) {
    if (id == kInvalidPoint3dId) continue;
    const Eigen::Vector3d& x_in_scan = straight.points.at(id).x_in_model;
    const auto x_in_img = projection.ImgFromCam(cam_from_straight * x_in_scan);
    const Eigen::Vector3d bent_in_scan = bend.Bend(x_in_scan);
    if (!x_in_img || !projection.InImage(*x_in_img)) continue;
    if (!projection.ImgFromCam(cam_from_straight * bent_in_scan)) continue;
    bent.push_back(bent_in_scan);
    problem.AddResidualBlock(new ReprojectionCost(pose, camera, *x_in_img, 1, false), &loss,
                             pose.values, bent.back().data());
    problem.SetParameterBlockConstant(bent.back().data());
  }
  if (problem.NumResidualBlocks() < kMinPoints) return cam_from_straight;
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return summary.IsSolutionUsable() ? pose.CamFromScan() : cam_from_straight;
}

}  // namespace

SparseModel BendModel(const SparseModel& straight, const ScanBend& bend) {
  SparseModel bent = straight;
  if (bend.IsNone()) return bent;
  std::map<uint32_t, uint32_t> first_of_frame;  // photos of one frame follow its first
  for (auto& [id, image] : bent.images) {
    const uint32_t first =
        image.frame_id == kNoFrame ? id : first_of_frame.emplace(image.frame_id, id).first->second;
    if (first == id) {
      image.cam_from_model = BentPose(straight, straight.images.at(id), bend);
    } else {
      image.cam_from_model = straight.images.at(id).cam_from_model *
                             straight.images.at(first).cam_from_model.Inverse() *
                             bent.images.at(first).cam_from_model;
    }
  }
  for (auto& [id, point] : bent.points) point.x_in_model = bend.Bend(point.x_in_model);
  return bent;
}

}  // namespace roomtex
