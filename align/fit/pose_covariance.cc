#include "align/fit/pose_covariance.h"

#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "align/fit/plane_bundle_costs.h"
#include "align/surface/surface_cells.h"
#include "core/robust_kernel.h"
#include "core/twist.h"

namespace roomtex {
namespace {

using Matrix63 = Eigen::Matrix<double, 6, 3>;

// The parts of one residual of a photo: derivatives by its pose and by the point, over its noise.
struct Terms {
  Eigen::Matrix<double, 2, 6, Eigen::RowMajor> by_pose;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
};

class ReducedSystem {
 public:
  ReducedSystem(const PlaneBundleInput& input, const PlaneBundle& bundle,
                const PlaneBundleOptions& options)
      : input_(input), bundle_(bundle) {
    std::map<uint32_t, uint32_t> first_of_frame;
    for (const auto& [id, image] : bundle.model.images) {
      if (bundle.idle_images.count(id) > 0) continue;
      // Photos of one frame have one pose, that of its first.
      const uint32_t first = image.frame_id == kNoFrame
                                 ? id
                                 : first_of_frame.emplace(image.frame_id, id).first->second;
      const Rigid& rig_from_scan = bundle.model.images.at(first).cam_from_model;
      poses_.emplace(id, PoseParameters(rig_from_scan));
      cam_from_rig_[id] = first == id ? Rigid() : image.cam_from_model * rig_from_scan.Inverse();
      const bool fixed = options.fix_clicked_view && image.name == input.clicked_image;
      if (first != id && index_.count(first) > 0) {
        index_[id] = index_.at(first);
      } else if (first == id && !fixed) {
        index_[id] = num_poses_++;
      }
    }
  }

  size_t num_poses() const { return static_cast<size_t>(num_poses_); }

  void Assemble() {
    const int n = 6 * static_cast<int>(num_poses());
    matrix_ = Eigen::MatrixXd::Zero(n, n);
    std::map<uint64_t, Eigen::Matrix3d> surface = SurfaceInformation();
    for (const auto& [id, point] : bundle_.model.points) {
      const auto at = surface.find(id);
      AddPoint(point, at == surface.end() ? Eigen::Matrix3d::Zero() : at->second);
    }
    AddPicks();
  }

  PoseCovariances Invert() const {
    PoseCovariances covariances;
    const Eigen::VectorXd size = matrix_.diagonal().cwiseSqrt();
    if (!matrix_.allFinite() || !(size.minCoeff() > 0)) return covariances;
    const Eigen::VectorXd scale = size.cwiseInverse();
    const Eigen::LLT<Eigen::MatrixXd> solver(scale.asDiagonal() * matrix_ * scale.asDiagonal());
    if (solver.info() != Eigen::Success) return covariances;
    const Eigen::MatrixXd inverse =
        solver.solve(Eigen::MatrixXd::Identity(matrix_.rows(), matrix_.cols()));
    for (const auto& [id, index] : index_) {
      const auto own = scale.segment<6>(6 * index).asDiagonal();
      covariances[id] = own * inverse.block<6, 6>(6 * index, 6 * index) * own;
      if (bundle_.model.images.at(id).frame_id != kNoFrame) {
        const Eigen::Matrix<double, 6, 6> cam_by_rig = CameraByRig(id);
        covariances[id] = cam_by_rig * covariances[id] * cam_by_rig.transpose();
      }
    }
    return covariances;
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

  // False where the photo does not see the point.
  bool Evaluate(uint32_t image_id, const Eigen::Vector3d& x_in_scan,
                const Eigen::Vector2d& x_in_img, double sigma_px, Terms* terms) const {
    const auto pose = poses_.find(image_id);
    if (pose == poses_.end()) return false;
    const Camera& camera = bundle_.model.cameras.at(bundle_.model.images.at(image_id).camera_id);
    const ReprojectionCost cost(pose->second, camera, x_in_img, 1 / sigma_px, false,
                                cam_from_rig_.at(image_id));
    const double* const parameters[2] = {pose->second.values, x_in_scan.data()};
    Eigen::Vector2d residual;
    double* jacobians[2] = {terms->by_pose.data(), terms->by_point.data()};
    if (!cost.Evaluate(parameters, residual.data(), jacobians)) return false;
    const double deviations = residual.norm();
    const double weight = std::sqrt(HuberWeight(deviations, kReprojectionHuber));
    terms->by_pose *= weight;
    terms->by_point *= weight;
    return terms->by_pose.allFinite() && terms->by_point.allFinite();
  }

  void AddPoint(const SparsePoint& point, const Eigen::Matrix3d& surface_information) {
    std::vector<std::pair<int, Matrix63>> mixed;  // pose index, derivatives' product
    Eigen::Matrix3d information = surface_information;
    std::vector<std::pair<int, Eigen::Matrix<double, 6, 6>>> own;
    int num_seen = 0;
    for (const TrackElement& element : point.track) {
      Terms terms;
      const SparseImage& image = bundle_.model.images.at(element.image_id);
      if (!Evaluate(element.image_id, point.x_in_model, image.points2d[element.point2d_index],
                    bundle_.sigma_px, &terms)) {
        continue;
      }
      ++num_seen;
      information += terms.by_point.transpose() * terms.by_point;
      const auto at = index_.find(element.image_id);
      if (at == index_.end()) continue;
      mixed.emplace_back(at->second, terms.by_pose.transpose() * terms.by_point);
      own.emplace_back(at->second, terms.by_pose.transpose() * terms.by_pose);
    }
    const Eigen::Matrix3d covariance = information.inverse();
    if (num_seen < 2 || !covariance.allFinite()) return;
    for (const auto& [index, product] : own) matrix_.block<6, 6>(6 * index, 6 * index) += product;
    for (const auto& [i, by_i] : mixed) {
      const Matrix63 weighted = by_i * covariance;
      for (const auto& [j, by_j] : mixed) {
        matrix_.block<6, 6>(6 * i, 6 * j).noalias() -= weighted * by_j.transpose();
      }
    }
  }

  void AddPicks() {
    for (size_t i = 0; i < input_.picks.size(); ++i) {
      const Pick& pick = input_.picks[i];
      const SparseImage* const image = bundle_.model.FindImage(pick.image_name);
      if (!input_.used[i] || image == nullptr) continue;
      const auto at = index_.find(image->image_id);
      Terms terms;
      if (at == index_.end() || !Evaluate(image->image_id, pick.x_in_scan, pick.x_in_img,
                                          input_.pick_sigma_px / pick.weight, &terms)) {
        continue;
      }
      matrix_.block<6, 6>(6 * at->second, 6 * at->second) +=
          terms.by_pose.transpose() * terms.by_pose;
    }
  }

  const PlaneBundleInput& input_;
  const PlaneBundle& bundle_;
  std::map<uint32_t, PoseParameters> poses_;
  std::map<uint32_t, Rigid> cam_from_rig_;
  std::map<uint32_t, int> index_;
  int num_poses_ = 0;
  Eigen::MatrixXd matrix_;
};

}  // namespace

PoseCovariances FindPoseCovariances(const PlaneBundleInput& input, const PlaneBundle& bundle,
                                    const PlaneBundleOptions& options) {
  if (!bundle.usable) return {};
  ReducedSystem system(input, bundle, options);
  if (system.num_poses() == 0 || system.num_poses() > kMaxPosesWithCovariance) return {};
  system.Assemble();
  return system.Invert();
}

}  // namespace roomtex
