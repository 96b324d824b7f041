#include "colmap_ext/panorama_model.h"

#include <algorithm>
#include <array>
#include <map>
#include <memory>

#include <ceres/autodiff_cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/rotation.h>
#include <ceres/solver.h>

#include "colmap_ext/solver_log.h"
#include "core/camera_formulas.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/projections.h"
#include "core/twist.h"

namespace roomtex {
namespace {

// A face that stands farther off its panorama than this is wrong.
constexpr double kMaxTurn_deg = 3, kMaxMoveShare = 0.1;
constexpr double kHuber_px = 2;
constexpr int kMaxIterations = 50;

// One registered face of a panorama.
struct RegisteredFace {
  const SparseImage* image;
  Eigen::Quaterniond face_from_panorama;
  Rigid panorama_from_model;  // as its own pose says
  double depth = 0;           // median of its points
};

std::vector<RegisteredFace> FindFaces(const SparseModel& model, const CutPanorama& panorama,
                                      const std::map<std::string, const SparseImage*>& by_name) {
  std::vector<RegisteredFace> faces;
  for (const CutPanorama::Face& face : panorama.faces) {
    const auto found = by_name.find(face.name);
    if (found == by_name.end()) continue;
    const Rigid panorama_from_face{face.face_from_panorama.conjugate(), Eigen::Vector3d::Zero()};
    faces.push_back({found->second, face.face_from_panorama,
                     panorama_from_face * found->second->cam_from_model,
                     MedianDepth(model, *found->second)});
  }
  return faces;
}

// How far a face is off, in units of what is tolerated.
double Excess(const RegisteredFace& face, const Rigid& panorama_from_model) {
  const double turn =
      RotationAngle(face.panorama_from_model.rotation, panorama_from_model.rotation);
  const double move =
      (face.panorama_from_model.TargetOriginInSource() - panorama_from_model.TargetOriginInSource())
          .norm();
  return std::max(turn / RadFromDeg(kMaxTurn_deg),
                  face.depth > 0 ? move / (kMaxMoveShare * face.depth) : 0.0);
}

// The face that most others agree with decides; those that agree with it give the mean.
Rigid CommonPose(std::vector<RegisteredFace>* faces, const std::string& panorama,
                 std::vector<std::string>* warnings) {
  size_t best = 0;
  double least = -1;
  for (size_t i = 0; i < faces->size(); ++i) {
    double sum = 0;
    for (const RegisteredFace& other : *faces) {
      sum += std::min(1.0, Excess(other, (*faces)[i].panorama_from_model));
    }
    if (least < 0 || sum < least) {
      least = sum;
      best = i;
    }
  }
  const Rigid central = (*faces)[best].panorama_from_model;
  Eigen::Vector4d rotation = Eigen::Vector4d::Zero();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  std::vector<RegisteredFace> kept;
  for (const RegisteredFace& face : *faces) {
    if (Excess(face, central) > 1) {
      warnings->push_back(face.image->name + " is registered away from the other faces of " +
                          panorama + " and is left out.");
      continue;
    }
    const Eigen::Vector4d q = face.panorama_from_model.rotation.coeffs();
    rotation += q.dot(central.rotation.coeffs()) < 0 ? Eigen::Vector4d(-q) : q;
    centre += face.panorama_from_model.TargetOriginInSource();
    kept.push_back(face);
  }
  Rigid mean;
  mean.rotation = Eigen::Quaterniond(rotation).normalized();
  mean.translation = -(mean.rotation * (centre / static_cast<double>(kept.size())));
  *faces = std::move(kept);
  return mean;
}

// The faces' keypoints that have a point, one per point, in the panorama.
void TakeKeypoints(const SparseModel& model, const std::vector<RegisteredFace>& faces,
                   const CameraProjection& panorama, SparseImage* image) {
  struct Sighting {
    double off_axis;
    Eigen::Vector2d x_in_img;
  };
  std::map<uint64_t, Sighting> by_point;
  for (const RegisteredFace& face : faces) {
    const CameraProjection projection(model.cameras.at(face.image->camera_id));
    for (size_t i = 0; i < face.image->points2d.size(); ++i) {
      const uint64_t id = face.image->point3d_ids[i];
      const auto ray =
          id == kInvalidPoint3dId ? std::nullopt : projection.RayFromImg(face.image->points2d[i]);
      if (!ray) continue;
      const auto x_in_img = panorama.ImgFromCam(face.face_from_panorama.conjugate() * *ray);
      const Sighting sighting{AngleBetween(*ray, Eigen::Vector3d::UnitZ()), *x_in_img};
      const auto [at, is_new] = by_point.emplace(id, sighting);
      if (!is_new && sighting.off_axis < at->second.off_axis) at->second = sighting;
    }
  }
  for (const auto& [id, sighting] : by_point) {
    image->points2d.push_back(sighting.x_in_img);
    image->point3d_ids.push_back(id);
  }
}

// Tracks anew from what the images say; points with fewer than two images go.
void SetTracks(const SparseModel& from, SparseModel* model) {
  for (const auto& [id, image] : model->images) {
    for (size_t i = 0; i < image.point3d_ids.size(); ++i) {
      const uint64_t point_id = image.point3d_ids[i];
      if (point_id == kInvalidPoint3dId) continue;
      SparsePoint& point = model->points[point_id];
      if (point.track.empty()) {
        point = from.points.at(point_id);
        point.track.clear();
      }
      point.track.push_back({id, static_cast<uint32_t>(i)});
    }
  }
  for (auto at = model->points.begin(); at != model->points.end();) {
    if (at->second.track.size() >= 2) {
      ++at;
      continue;
    }
    for (const TrackElement& element : at->second.track) {
      model->images.at(element.image_id).point3d_ids[element.point2d_index] = kInvalidPoint3dId;
    }
    at = model->points.erase(at);
  }
}

// Parameters: angle-axis and translation of cam_from_model, point.
struct ObservationCost {
  template <typename T>
  bool operator()(const T* const pose, const T* const point, T* residual) const {
    T p[3];
    ceres::AngleAxisRotatePoint(pose, point, p);
    for (int k = 0; k < 3; ++k) p[k] += pose[3 + k];
    if (camera->IsPerspective() && p[2] < T(1e-9)) return false;
    T params[kMaxCameraParams];
    for (size_t k = 0; k < camera->params.size(); ++k) params[k] = T(camera->params[k]);
    camera_formulas::ImgError(camera->model, params, p[0], p[1], p[2], x_in_img, &residual[0],
                              &residual[1]);
    return true;
  }
  const Camera* camera;
  Eigen::Vector2d x_in_img;
};

void Adjust(SparseModel* model) {
  // In arrays: Ceres orders parameters by their addresses.
  std::vector<std::array<double, 6>> poses;
  std::map<uint32_t, size_t> pose_index;
  for (const auto& [id, image] : model->images) {
    pose_index[id] = poses.size();
    poses.emplace_back();
    Eigen::Map<Eigen::Vector3d>(poses.back().data()) =
        VectorFromRotation(image.cam_from_model.rotation);
    Eigen::Map<Eigen::Vector3d>(poses.back().data() + 3) = image.cam_from_model.translation;
  }
  std::vector<Eigen::Vector3d> points;
  for (const auto& [id, point] : model->points) points.push_back(point.x_in_model);
  ceres::HuberLoss loss(kHuber_px);
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  ceres::Solver::Options options;
  options.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  const auto projections = ProjectionsOf(model->cameras);
  double* x_in_model = points.empty() ? nullptr : points[0].data();
  for (const auto& [id, point] : model->points) {
    for (const TrackElement& element : point.track) {
      const SparseImage& image = model->images.at(element.image_id);
      const CameraProjection& projection = projections.at(image.camera_id);
      if (!projection.ImgFromCam(image.cam_from_model * point.x_in_model)) continue;
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<ObservationCost, 2, 6, 3>(
              new ObservationCost{&projection.camera(), image.points2d[element.point2d_index]}),
          &loss, poses[pose_index.at(element.image_id)].data(), x_in_model);
    }
    if (problem.HasParameterBlock(x_in_model)) {
      options.linear_solver_ordering->AddElementToGroup(x_in_model, 0);
    }
    x_in_model += 3;
  }
  bool is_held = false;  // one pose holds the frame
  for (auto& pose : poses) {
    if (!problem.HasParameterBlock(pose.data())) continue;
    options.linear_solver_ordering->AddElementToGroup(pose.data(), 1);
    if (!is_held) problem.SetParameterBlockConstant(pose.data());
    is_held = true;
  }
  if (!is_held) return;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.max_num_iterations = kMaxIterations;
  options.function_tolerance = 1e-7;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  SilenceCeres();
  ceres::Solve(options, &problem, &summary);
  size_t next = 0;
  for (auto& [id, point] : model->points) point.x_in_model = points[next++];
  for (auto& [id, image] : model->images) {
    const double* const pose = poses[pose_index.at(id)].data();
    image.cam_from_model.rotation = RotationFromVector(Eigen::Map<const Eigen::Vector3d>(pose));
    image.cam_from_model.translation = Eigen::Map<const Eigen::Vector3d>(pose + 3);
  }
}

}  // namespace

SparseModel MergeFaces(const SparseModel& faces, const std::vector<CutPanorama>& panoramas,
                       const std::string& path, std::vector<std::string>* warnings) {
  std::map<std::string, const SparseImage*> by_name;
  for (const auto& [id, image] : faces.images) by_name[image.name] = &image;
  SparseModel merged;
  std::map<std::pair<int, int>, uint32_t> camera_of_size;
  uint32_t next_camera = faces.cameras.empty() ? 1 : faces.cameras.rbegin()->first + 1;
  std::map<uint32_t, bool> is_face;
  for (const CutPanorama& panorama : panoramas) {
    std::vector<RegisteredFace> registered = FindFaces(faces, panorama, by_name);
    if (registered.empty()) continue;
    for (const RegisteredFace& face : registered) is_face[face.image->image_id] = true;
    const auto [camera_id, is_new] =
        camera_of_size.try_emplace({panorama.width, panorama.height}, next_camera);
    if (is_new) {
      Camera& camera = merged.cameras[next_camera] = panorama.PanoramaCamera();
      camera.camera_id = next_camera++;
    }
    SparseImage image;
    image.image_id = registered[0].image->image_id;
    image.camera_id = camera_id->second;
    image.name = panorama.name;
    image.cam_from_model = CommonPose(&registered, panorama.name, warnings);
    TakeKeypoints(faces, registered, CameraProjection(merged.cameras.at(image.camera_id)), &image);
    merged.images[image.image_id] = std::move(image);
  }
  if (merged.images.empty()) {
    throw InputError(path, "", "names no image of the model as a face",
                     "Give the panoramas.json of the faces that COLMAP was given, and --image_path "
                     "of their folder to COLMAP");
  }
  for (const auto& [id, image] : faces.images) {
    if (is_face.count(id) > 0) continue;
    merged.cameras[image.camera_id] = faces.cameras.at(image.camera_id);
    merged.images[id] = image;
  }
  SetTracks(faces, &merged);
  Adjust(&merged);
  UpdateReprojectionErrors(&merged);
  return merged;
}

std::string PanoramasHelp() {
  return "panoramas.json of faces that roomtex-import cut out of panoramas, if the model is one of "
         "faces: they become one image per panorama again, and --image_path is the folder of the "
         "panoramas.";
}

SparseModel ReadModelOfPanoramas(const std::string& folder, const std::string& panoramas_path,
                                 std::vector<std::string>* warnings) {
  SparseModel model = ReadSparseModel(folder);
  if (panoramas_path.empty()) return model;
  return MergeFaces(model, ReadPanoramaSet(panoramas_path), panoramas_path, warnings);
}

}  // namespace roomtex
