#include "align/fit/pose_covariance.h"

#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "align/fit/plane_bundle_costs.h"
#include "align/surface/surface_cells.h"
#include "colmap_ext/lens_prior.h"
#include "colmap_ext/reduced_normal.h"
#include "core/robust_kernel.h"
#include "core/twist.h"

namespace roomtex {
namespace {

// The photos that took part: by the photo whose pose is theirs, which is the first of a frame.
std::map<uint32_t, std::vector<uint32_t>> PhotosOfPose(const PlaneBundle& bundle) {
  std::map<uint32_t, uint32_t> first_of_frame;
  std::map<uint32_t, std::vector<uint32_t>> photos;
  for (const auto& [id, image] : bundle.model.images) {
    if (bundle.idle_images.count(id) > 0) continue;
    const uint32_t first =
        image.frame_id == kNoFrame ? id : first_of_frame.emplace(image.frame_id, id).first->second;
    photos[first].push_back(id);
  }
  return photos;
}

// Of the photos that are named alone: what others know is left out.
class ReducedSystem {
 public:
  ReducedSystem(const PlaneBundleInput& input, const PlaneBundle& bundle,
                const PlaneBundleOptions& options, size_t max_poses,
                const std::map<uint32_t, std::vector<uint32_t>>& photos_of_pose)
      : input_(input),
        bundle_(bundle),
        with_lenses_(options.refine_intrinsics),
        hold_centre_(options.hold_centre) {
    for (const auto& [first, ids] : photos_of_pose) {
      const SparseImage& first_image = bundle.model.images.at(first);
      const Rigid& rig_from_scan = first_image.cam_from_model;
      const bool fixed = options.fix_clicked_view && first_image.name == input.clicked_image;
      for (const uint32_t id : ids) {
        const SparseImage& image = bundle.model.images.at(id);
        poses_.emplace(id, PoseParameters(rig_from_scan));
        cam_from_rig_[id] = first == id ? Rigid() : image.cam_from_model * rig_from_scan.Inverse();
        if (with_lenses_) camera_offset_[image.camera_id] = -1;
        if (!fixed) pose_offset_.emplace(id, 6 * num_poses_);
      }
      num_poses_ += !fixed;
    }
    num_unknowns_ = 6 * num_poses_;
    PlaceLenses();
    // Of more photos the matrix would be too large.
    if (2 * pose_offset_.size() <= max_poses) PlaceMotions();
  }

  BundleCovariances Find() const {
    ReducedNormal normal(num_unknowns_);
    const std::map<uint64_t, Eigen::Matrix3d> surface = SurfaceInformation();
    for (const auto& [id, point] : bundle_.model.points) {
      const auto at = surface.find(id);
      AddPoint(point, at == surface.end() ? Eigen::Matrix3d::Zero() : at->second, &normal);
    }
    AddPicks(&normal);
    for (const auto& [offset, camera_id] : lenses_) {
      const auto told = input_.told.find(camera_id);
      const Eigen::MatrixXd prior =
          LensPrior(told != input_.told.end() ? told->second : input_.model.cameras.at(camera_id),
                    hold_centre_);
      normal.AddInformation(offset, prior.transpose() * prior);
    }
    for (const auto& [id, offset] : motion_offset_) {
      normal.AddInformation(offset, RowMotionPrior().transpose() * RowMotionPrior());
    }
    std::vector<UnknownBlock> blocks;
    for (const auto& [id, offset] : pose_offset_) blocks.push_back({offset, 6});
    for (const auto& [id, offset] : camera_offset_) {
      blocks.push_back({offset, static_cast<int>(bundle_.model.cameras.at(id).params.size())});
    }
    const std::vector<Eigen::MatrixXd> covariances = normal.Covariances(blocks);
    BundleCovariances found;
    if (covariances.empty()) return found;
    auto next = covariances.begin();
    for (const auto& [id, offset] : pose_offset_) {
      found.poses[id] = *next++;
      if (bundle_.model.images.at(id).frame_id == kNoFrame) continue;
      const Eigen::Matrix<double, 6, 6> cam_by_rig = CameraByRig(id);
      found.poses[id] = cam_by_rig * found.poses[id] * cam_by_rig.transpose();
    }
    for (const auto& [id, offset] : camera_offset_) found.cameras[id] = *next++;
    for (const auto& [id, motion] : input_.row_motions) {
      const auto pose = found.poses.find(id);
      if (pose == found.poses.end() || motion_offset_.count(id) > 0) continue;
      pose->second = GrownByOwnMotion(id, pose->second, surface);
    }
    return found;
  }

 private:
  // How (w, centre) of a camera go with those of its rig: w_cam = R w, and the camera's place c in
  // the rig turns with it.
  Eigen::Matrix<double, 6, 6> CameraByRig(uint32_t image_id) const {
    const Rigid& cam_from_rig = cam_from_rig_.at(image_id);
    const Rigid rig_from_scan = poses_.at(image_id).CamFromScan();
    Eigen::Matrix<double, 6, 6> cam_by_rig = Eigen::Matrix<double, 6, 6>::Identity();
    cam_by_rig.topLeftCorner<3, 3>() = cam_from_rig.rotation.toRotationMatrix();
    cam_by_rig.bottomLeftCorner<3, 3>() = rig_from_scan.rotation.conjugate().toRotationMatrix() *
                                          CrossMatrix(cam_from_rig.TargetOriginInSource());
    return cam_by_rig;
  }

  // Behind the poses.
  void PlaceLenses() {
    std::map<int, int> offset_of_lens;
    for (auto& [id, offset] : camera_offset_) {
      offset = num_unknowns_;
      const auto lens = input_.lens_of_camera.find(id);
      if (lens != input_.lens_of_camera.end()) {
        const auto [at, is_first] = offset_of_lens.emplace(lens->second, num_unknowns_);
        offset = at->second;
        if (!is_first) continue;
      }
      lenses_.emplace(offset, id);
      num_unknowns_ += static_cast<int>(bundle_.model.cameras.at(id).params.size());
    }
  }

  // Behind the lenses.
  void PlaceMotions() {
    for (const auto& [id, motion] : input_.row_motions) {
      if (poses_.count(id) == 0) continue;
      motion_offset_[id] = num_unknowns_;
      num_unknowns_ += 6;
    }
  }

  // Inverse covariance of the points by what is known of their surfaces.
  std::map<uint64_t, Eigen::Matrix3d> SurfaceInformation() const {
    std::vector<Eigen::Vector3d> places, normals;
    for (const SurfaceConstraint& c : bundle_.constraints) {
      places.push_back(c.point);
      normals.push_back(c.normal);
    }
    const SurfaceCells cells(places, normals);
    std::map<uint64_t, Eigen::Matrix3d> information;
    for (size_t i = 0; i < bundle_.constraints.size(); ++i) {
      const SurfaceConstraint& c = bundle_.constraints[i];
      const double variance = c.sigma * c.sigma * cells.NumPoints(cells.Cell(i));
      information[c.point3d_id] = c.normal * c.normal.transpose() / variance;
    }
    return information;
  }

  std::optional<int> MotionOffset(uint32_t image_id) const {
    const auto motion = motion_offset_.find(image_id);
    return motion == motion_offset_.end() ? std::nullopt : std::make_optional(motion->second);
  }

  // The observations of a point as one photo knows it whose pose, and rows' motion behind it, are
  // the only unknowns beside the point.
  std::vector<NormalTerms> ObservationsFor(uint32_t image_id, const SparsePoint& point) const {
    std::vector<NormalTerms> observations;
    for (const TrackElement& element : point.track) {
      NormalTerms terms;
      const SparseImage& image = bundle_.model.images.at(element.image_id);
      if (!Evaluate(element.image_id, point.x_in_model, image.points2d[element.point2d_index],
                    bundle_.sigma_px, num_unknowns_, &terms)) {
        continue;
      }
      NormalTerms::Block pose = terms.blocks.front(), motion = terms.blocks.back();
      pose.offset = 0;
      motion.offset = 6;
      terms.blocks.clear();
      if (element.image_id == image_id) terms.blocks = {std::move(pose), std::move(motion)};
      observations.push_back(std::move(terms));
    }
    return observations;
  }

  // What stands for the motions of the rows where the matrix cannot hold them: the covariance of a
  // photo's pose grows as it would with its own motion open, all other photos being known. In a
  // room of 20 photos that is 1.2 times the standard deviation that all motions give (0.98 to 1.6),
  // and without it 0.66.
  Eigen::Matrix<double, 6, 6> GrownByOwnMotion(
      uint32_t image_id, const Eigen::Matrix<double, 6, 6>& covariance,
      const std::map<uint64_t, Eigen::Matrix3d>& surface) const {
    using Matrix6d = Eigen::Matrix<double, 6, 6>;
    ReducedNormal still(6), moving(12);
    moving.AddInformation(6, RowMotionPrior().transpose() * RowMotionPrior());
    for (const uint64_t point_id : bundle_.model.images.at(image_id).point3d_ids) {
      const auto point = bundle_.model.points.find(point_id);
      if (point == bundle_.model.points.end()) continue;
      std::vector<NormalTerms> observations = ObservationsFor(image_id, point->second);
      if (observations.size() < 2) continue;
      const auto at = surface.find(point_id);
      const Eigen::Matrix3d information =
          at == surface.end() ? Eigen::Matrix3d(Eigen::Matrix3d::Zero()) : at->second;
      moving.AddPoint(observations, information);
      for (NormalTerms& one : observations) {
        if (!one.blocks.empty()) one.blocks.pop_back();
      }
      still.AddPoint(observations, information);
    }
    const std::vector<Eigen::MatrixXd> of_still = still.Covariances({{0, 6}}),
                                       of_moving = moving.Covariances({{0, 6}});
    if (of_still.empty() || of_moving.empty()) return covariance;
    const Matrix6d root = Matrix6d(of_still[0]).llt().matrixL();
    const Matrix6d whitened = root.inverse();
    const Eigen::SelfAdjointEigenSolver<Matrix6d> growth(whitened * of_moving[0] *
                                                         whitened.transpose());
    const Matrix6d grow = root * growth.operatorSqrt() * whitened;
    return grow * covariance * grow.transpose();
  }

  // False where the photo does not see the point. motion_offset: of the unknowns of its rows'
  // motion; none where that is known. Of the blocks the pose comes first, the motion last.
  bool Evaluate(uint32_t image_id, const Eigen::Vector3d& x_in_scan,
                const Eigen::Vector2d& x_in_img, double sigma_px,
                const std::optional<int>& motion_offset, NormalTerms* terms) const {
    const auto pose = poses_.find(image_id);
    if (pose == poses_.end()) return false;
    const Camera& camera = bundle_.model.cameras.at(bundle_.model.images.at(image_id).camera_id);
    const bool rolls = motion_offset.has_value();
    const ReprojectionCost cost(pose->second, camera, x_in_img, 1 / sigma_px, with_lenses_,
                                cam_from_rig_.at(image_id), rolls);
    constexpr double kStill[6] = {0, 0, 0, 0, 0, 0};
    const double* parameters[4] = {pose->second.values, x_in_scan.data(), nullptr, nullptr};
    Eigen::Vector2d residual;
    Eigen::Matrix<double, 2, 6, Eigen::RowMajor> by_pose;
    NormalTerms::Block by_lens;
    by_lens.by.setZero(2, static_cast<int>(camera.params.size()));
    NormalTerms::Block by_motion;
    by_motion.by.setZero(2, 6);
    double* jacobians[4] = {by_pose.data(), terms->by_point.data(), nullptr, nullptr};
    int next = 2;
    if (with_lenses_) {
      parameters[next] = camera.params.data();
      jacobians[next++] = by_lens.by.data();
    }
    if (rolls) {
      parameters[next] = kStill;
      jacobians[next] = by_motion.by.data();
    }
    if (!cost.Evaluate(parameters, residual.data(), jacobians)) return false;
    const double weight = std::sqrt(HuberWeight(residual.norm(), kReprojectionHuber));
    const auto offset = pose_offset_.find(image_id);
    if (offset != pose_offset_.end()) {
      terms->blocks.push_back({offset->second, weight * by_pose});
    }
    if (with_lenses_) {
      by_lens.offset = camera_offset_.at(camera.camera_id);
      by_lens.by *= weight;
      terms->blocks.push_back(std::move(by_lens));
    }
    if (rolls) {
      by_motion.offset = *motion_offset;
      by_motion.by *= weight;
      terms->blocks.push_back(std::move(by_motion));
    }
    terms->by_point *= weight;
    return by_pose.allFinite() && terms->by_point.allFinite();
  }

  void AddPoint(const SparsePoint& point, const Eigen::Matrix3d& surface_information,
                ReducedNormal* normal) const {
    std::vector<NormalTerms> observations;
    for (const TrackElement& element : point.track) {
      NormalTerms terms;
      const SparseImage& image = bundle_.model.images.at(element.image_id);
      if (Evaluate(element.image_id, point.x_in_model, image.points2d[element.point2d_index],
                   bundle_.sigma_px, MotionOffset(element.image_id), &terms)) {
        observations.push_back(std::move(terms));
      }
    }
    if (observations.size() >= 2) normal->AddPoint(observations, surface_information);
  }

  void AddPicks(ReducedNormal* normal) const {
    for (size_t i = 0; i < input_.picks.size(); ++i) {
      const Pick& pick = input_.picks[i];
      const SparseImage* const image = bundle_.model.FindImage(pick.image_name);
      if (!input_.used[i] || image == nullptr) continue;
      NormalTerms terms;
      if (!Evaluate(image->image_id, pick.x_in_scan, pick.x_in_img,
                    std::hypot(input_.pick_sigma_px / pick.weight, input_.pick_bend_px),
                    MotionOffset(image->image_id), &terms)) {
        continue;
      }
      normal->AddKnownPoint(terms);
    }
  }

  const PlaneBundleInput& input_;
  const PlaneBundle& bundle_;
  const bool with_lenses_, hold_centre_;
  std::map<uint32_t, PoseParameters> poses_;
  std::map<uint32_t, Rigid> cam_from_rig_;
  int num_poses_ = 0;
  std::map<uint32_t, int> pose_offset_, camera_offset_;
  std::map<int, uint32_t> lenses_;         // offset of a lens, one of its cameras
  std::map<uint32_t, int> motion_offset_;  // by image
  int num_unknowns_ = 0;
};

}  // namespace

BundleCovariances FindCovariances(const PlaneBundleInput& input, const PlaneBundle& bundle,
                                  const PlaneBundleOptions& options, size_t max_poses) {
  if (!bundle.usable) return {};
  const std::map<uint32_t, std::vector<uint32_t>> all = PhotosOfPose(bundle);
  const size_t num_groups = (all.size() + max_poses - 1) / max_poses;
  BundleCovariances found;
  auto next = all.begin();
  for (size_t group = 0; group < num_groups; ++group) {
    std::map<uint32_t, std::vector<uint32_t>> photos;
    const size_t end = all.size() * (group + 1) / num_groups;
    for (size_t i = all.size() * group / num_groups; i < end; ++i) photos.insert(*next++);
    BundleCovariances of_group = ReducedSystem(input, bundle, options, max_poses, photos).Find();
    found.poses.merge(of_group.poses);
    for (const auto& [camera_id, covariance] : of_group.cameras) {
      // Every group says at least what is open: the smallest comes nearest.
      const auto [at, is_first] = found.cameras.emplace(camera_id, covariance);
      if (!is_first && covariance.trace() < at->second.trace()) at->second = covariance;
    }
  }
  return found;
}

}  // namespace roomtex
