#pragma once
// A simulated room for tests of the adjustment to the scan's surface: its walls as planes, a sparse
// model with the errors that a reconstruction has, and the error that matters in the end: the
// colour's.

#include <cmath>
#include <map>
#include <vector>

#include <Eigen/Eigenvalues>
#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "align/fit/plane_bundle.h"
#include "align/fit/plane_bundle_costs.h"
#include "capture/simulation/simulated_room.h"
#include "core/ray_caster.h"
#include "core/scan_mesh.h"
#include "tests/align/simulated_alignment.h"

namespace roomtex {

// The plane of some samples by PCA, with cells of 5 cm.
inline ScanPlane PlaneOfSamples(const Scan& scan, const std::vector<int>& samples) {
  ScanPlane plane;
  plane.num_samples = static_cast<int>(samples.size());
  for (const int i : samples) plane.point += scan.points[i] / plane.num_samples;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const int i : samples) {
    const Eigen::Vector3d offset = scan.points[i] - plane.point;
    covariance += offset * offset.transpose() / plane.num_samples;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  plane.normal = solver.eigenvectors().col(0).normalized();
  if (plane.normal.dot(scan.Station() - plane.point) < 0) plane.normal *= -1;
  plane.rms = std::sqrt(std::max(0.0, solver.eigenvalues()[0]));
  plane.u = solver.eigenvectors().col(2).normalized();
  plane.v = plane.normal.cross(plane.u);
  plane.cell_size = 0.05;
  const auto cell_of = [&plane](const Eigen::Vector3d& x) {
    const Eigen::Vector3d offset = x - plane.point;
    return Eigen::Vector2i(static_cast<int>(std::floor(plane.u.dot(offset) / plane.cell_size)),
                           static_cast<int>(std::floor(plane.v.dot(offset) / plane.cell_size)));
  };
  plane.min_cell = cell_of(scan.points[samples[0]]);
  Eigen::Vector2i max_cell = plane.min_cell;
  for (const int i : samples) {
    plane.min_cell = plane.min_cell.cwiseMin(cell_of(scan.points[i]));
    max_cell = max_cell.cwiseMax(cell_of(scan.points[i]));
  }
  const Eigen::Vector2i size = max_cell - plane.min_cell + Eigen::Vector2i::Ones();
  plane.covered.setZero(size.x(), size.y());
  for (const int i : samples) {
    const Eigen::Vector2i cell = cell_of(scan.points[i]) - plane.min_cell;
    plane.covered(cell.x(), cell.y()) = 1;
  }
  plane.area_m2 = plane.covered.cast<double>().sum() * plane.cell_size * plane.cell_size;
  return plane;
}

// The room as it is, for the scan as it was measured.
class SurfaceRoom {
 public:
  explicit SurfaceRoom(const SimulatedRoomOptions& options, int num_points = 2000)
      : room(options), scan(room.MakeScan()), true_scan(MakeTrueScan(options)) {
    scan.path = "room.rtpi";
    scan.is_rtpi = true;
    true_model = room.MakeSparseModel(num_points, 0.7);
    TransformModel(room.ScanFromSparse(), &true_model);
    patches = std::make_unique<ScanPatches>(std::vector<Scan>{scan}, ScanPatchOptions());
    planes = WallPlanes();
    picks = PicksOfPhoto(room, room.BestPhotoForPicks(), 6);
    const std::vector<Triangle> triangles = BuildScanMesh(true_scan, ScanMeshOptions());
    caster = std::make_unique<RayCaster>(true_scan.points, triangles);
    true_normals = VertexNormals(true_scan, triangles);
  }

  PlaneBundleInput Input(const SparseModel& model) const {
    return {model,
            planes,
            *patches,
            picks,
            std::vector<bool>(picks.size(), true),
            1.5,
            picks.empty() ? "" : picks[0].image_name};
  }

  SimulatedRoom room;
  Scan scan;               // with noise, bend and drift
  Scan true_scan;          // sample by sample where the scanner's rays met the room
  SparseModel true_model;  // scan frame; true poses and points, keypoints with 0.7 pixels of noise
  std::unique_ptr<ScanPatches> patches;
  std::vector<ScanPlane> planes;      // walls, floor and ceiling
  std::vector<Pick> picks;            // six in one photo
  std::unique_ptr<RayCaster> caster;  // of true_scan
  std::vector<Eigen::Vector3f> true_normals;

 private:
  static Scan MakeTrueScan(SimulatedRoomOptions options) {
    options.range_noise = options.range_noise_growth = 0;
    options.bend = options.azimuth_drift_deg = 0;
    return SimulatedRoom(options).MakeScan();
  }

  std::vector<ScanPlane> WallPlanes() const {
    const Rigid room_from_scan = room.ScanFromRoom().Inverse();
    const SimulatedRoomOptions& o = room.options();
    const Eigen::Vector3d size(o.width, o.depth, o.height);
    std::vector<std::vector<int>> samples(6);
    for (size_t i = 0; i < true_scan.points.size(); ++i) {
      if (true_scan.IsMissing(i) || scan.IsMissing(i)) continue;
      const Eigen::Vector3d x = room_from_scan * true_scan.points[i];
      for (int k = 0; k < 3; ++k) {
        if (std::abs(x[k]) < 1e-6) samples[2 * k].push_back(static_cast<int>(i));
        if (std::abs(x[k] - size[k]) < 1e-6) samples[2 * k + 1].push_back(static_cast<int>(i));
      }
    }
    std::vector<ScanPlane> found;
    for (const auto& of_wall : samples) {
      if (of_wall.size() > 1000) found.push_back(PlaneOfSamples(scan, of_wall));
    }
    return found;
  }
};

// What bundle adjustment makes of the photos alone: poses and points with the errors that keypoint
// noise leaves. Its frame is free; the best similarity to the cameras of `model` is applied.
inline SparseModel Reconstructed(SparseModel model) {
  const SparseModel truth = model;
  std::map<uint32_t, PoseParameters> poses;
  for (auto& [id, image] : model.images) poses.emplace(id, image.cam_from_model);
  ceres::Problem problem;
  for (auto& [id, point] : model.points) {
    for (const TrackElement& element : point.track) {
      const SparseImage& image = model.images.at(element.image_id);
      problem.AddResidualBlock(
          new ReprojectionCost(poses.at(image.image_id), model.cameras.at(image.camera_id),
                               image.points2d[element.point2d_index], 1, false),
          nullptr, poses.at(image.image_id).values, point.x_in_model.data());
    }
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.logging_type = ceres::SILENT;
  options.function_tolerance = 1e-9;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  Eigen::Matrix3Xd from(3, model.images.size()), to(3, model.images.size());
  int i = 0;
  for (auto& [id, image] : model.images) {
    image.cam_from_model = poses.at(id).CamFromScan();
    from.col(i) = image.cam_from_model.TargetOriginInSource();
    to.col(i++) = truth.images.at(id).cam_from_model.TargetOriginInSource();
  }
  TransformModel(FitSimilarity(from, to), &model);
  return model;
}

inline SimulatedRoomOptions SmallRoom(int seed, double bend = 0, double drift_deg = 0) {
  SimulatedRoomOptions options;
  options.random_seed = seed;
  options.num_photos = 20;
  options.scan_columns = 800;
  options.scan_rows = 400;
  options.bend = bend;
  options.azimuth_drift_deg = drift_deg;
  return options;
}

// A room with what a reconstruction makes of its photos.
struct Reconstruction {
  explicit Reconstruction(const SimulatedRoomOptions& options)
      : room(options), model(Reconstructed(room.true_model)) {}
  SurfaceRoom room;
  SparseModel model;  // best similarity to the true cameras
};
// Made once per seed and process.
inline const Reconstruction& StraightRoom(int seed = 0) {
  static std::map<int, std::unique_ptr<Reconstruction>> rooms;
  auto& room = rooms[seed];
  if (room == nullptr) room = std::make_unique<Reconstruction>(SmallRoom(seed));
  return *room;
}

struct Spread {
  double median = 0, p90 = 0, worst = 0;
};
inline Spread SpreadOf(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  if (values.empty()) return {NAN, NAN, NAN};
  return {values[values.size() / 2], values[values.size() * 9 / 10], values.back()};
}

struct PoseSpread {
  Spread position, rotation;  // metres, radians
};
inline PoseSpread PoseErrorsOf(const SimulatedRoom& room, const SparseModel& model) {
  std::vector<double> position, rotation;
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    const Rigid found = model.FindImage(room.PhotoName(photo))->cam_from_model;
    const Rigid truth = room.CamFromScan(photo);
    position.push_back((found.TargetOriginInSource() - truth.TargetOriginInSource()).norm());
    rotation.push_back(RotationAngle(found.rotation, truth.rotation));
  }
  return {SpreadOf(position), SpreadOf(rotation)};
}

// How far on the scan's surface, metres, a photo's colour comes to lie from the sample that it
// belongs to: the ray of the sample's true pixel, from the estimated pose, meets the surface beside
// the sample. Over the samples that each photo sees, not flatter than 65 degrees, in front of a
// smooth surface.
inline Spread ColourErrors(const SurfaceRoom& one, const SparseModel& model, int stride = 37) {
  const std::vector<Eigen::Vector3f>& normals = one.true_normals;
  const CameraProjection projection(one.room.camera());
  std::vector<double> errors;
  for (int photo = 0; photo < one.room.NumPhotos(); ++photo) {
    const Rigid truth = one.room.CamFromScan(photo);
    const Rigid found = model.FindImage(one.room.PhotoName(photo))->cam_from_model;
    const Eigen::Vector3d centre = truth.TargetOriginInSource();
    for (size_t i = photo; i < one.scan.points.size(); i += stride) {
      if (one.scan.IsMissing(i) || one.true_scan.IsMissing(i) || normals[i].norm() < 0.5) continue;
      const Eigen::Vector3d x_in_cam = truth * one.true_scan.points[i];
      const auto x_in_img = projection.ImgFromCam(x_in_cam);
      if (!x_in_img || !projection.InImage(*x_in_img)) continue;
      const Eigen::Vector3d normal = normals[i].cast<double>();
      const Eigen::Vector3d sight = (one.true_scan.points[i] - centre).normalized();
      if (-sight.dot(normal) < 0.42) continue;
      if (one.caster->IsOccluded(centre, one.true_scan.points[i], 0.01)) continue;
      const Eigen::Vector3d ray =
          found.rotation.conjugate() * Eigen::Vector3d(x_in_cam / x_in_cam.z());
      const Eigen::Vector3d eye = found.TargetOriginInSource();
      const Eigen::Vector3d met =
          eye + normal.dot(one.scan.points[i] - eye) / normal.dot(ray) * ray;
      errors.push_back((met - one.scan.points[i]).norm());
    }
  }
  return SpreadOf(errors);
}

}  // namespace roomtex
