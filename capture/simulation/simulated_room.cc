#include "capture/simulation/simulated_room.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>

#include <fmt/core.h>

#include "capture/simulation/camera_faults.h"
#include "capture/simulation/photo_renderer.h"
#include "capture/simulation/rolling_shutter.h"
#include "capture/simulation/room_cameras.h"
#include "capture/simulation/room_furniture.h"
#include "capture/simulation/room_scene.h"
#include "capture/simulation/simulated_observations.h"
#include "capture/simulation/simulated_projector.h"
#include "capture/simulation/simulated_scan.h"
#include "capture/simulation/stranger.h"
#include "core/camera_formulas.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/random_stream.h"
#include "core/row_motion.h"

namespace roomtex {
namespace {

// Seconds at EV 0. The room is dimmed for projectors.
double NominalExposureTime(const SimulatedRoomOptions& options) {
  return options.projectors > 0 ? 1.0 / 4 : 1.0 / 30;
}

Camera Zoomed(Camera camera) {
  camera.camera_id = 2;
  if (camera.IsPanorama()) return camera;
  const int num_focal = camera_formulas::HasOneFocalLength(camera.model) ? 1 : 2;
  for (int k = 0; k < num_focal; ++k) camera.params[static_cast<size_t>(k)] *= kZoom;
  return camera;
}

SimulatedRoomOptions Completed(SimulatedRoomOptions options) {
  options.bare_walls = options.bare_walls || options.bare;
  return options;
}

}  // namespace

struct SimulatedRoom::Impl {
  explicit Impl(const SimulatedRoomOptions& given)
      : options(Completed(given)),
        camera(MakeRoomCamera(given)),
        projection(camera),
        zoomed_projection(Zoomed(camera)) {
    scene.SetFinestDetail(options.finest_detail);
    FurnishRoom(options, &scene);
    const std::vector<Rigid> room_from_projector = PlaceProjectors(options);
    for (const Rigid& place : room_from_projector) AddProjectorBody(place, &scene);
    scene.Finish(options.shading, options.bare, options.num_threads);
    cam_from_room = PlaceCameras(options, scene);
    row_poses = MoveByHand(options, cam_from_room);
    room_from_station = PlaceStations(options, scene);
    exposures = ChooseExposures(options, scene, camera, cam_from_room);
    for (size_t k = 0; k < room_from_projector.size(); ++k) {
      projectors.push_back(MakeProjector(options, static_cast<int>(k), room_from_projector[k]));
    }
    if (projectors.empty()) return;
    projected = std::make_unique<ProjectedLight>(projectors, scene, RoomArea(options));
    for (const Rigid& pose : cam_from_room) {
      patterned_exposures.push_back(MeterExposure(scene, projected.get(), camera, pose));
    }
  }

  RoomScanner Scanner(int station) const {
    return RoomScanner(options, scene, station, room_from_station.at(station));
  }
  RoomPhotos Photos() const { return {options, scene, projection, zoomed_projection, row_poses}; }
  std::vector<PickCandidate> Candidates(int photo, int station) const {
    return FindPickCandidates(Photos(), Scanner(station), room_from_station.at(station), photo);
  }
  double PhotoDiagonal() const { return std::hypot(camera.width, camera.height); }
  const PhotoRenderer& Renderer(int place) const {
    std::call_once(renderer_made, [this] {
      renderer = std::make_unique<PhotoRenderer>(scene, projection);
      if (options.zoomed > 0) zoomer = std::make_unique<PhotoRenderer>(scene, zoomed_projection);
    });
    return options.IsZoomed(place) ? *zoomer : *renderer;
  }

  const SimulatedRoomOptions options;
  const Camera camera;
  const CameraProjection projection, zoomed_projection;
  RoomScene scene;
  std::vector<Rigid> cam_from_room, room_from_station;
  std::vector<RowPoses> row_poses;
  std::vector<double> exposures;  // per place; of the plain photos
  std::vector<Projector> projectors;
  std::unique_ptr<ProjectedLight> projected;  // if there are projectors
  std::vector<double> patterned_exposures;    // per place
  mutable std::once_flag renderer_made;
  mutable std::unique_ptr<PhotoRenderer> renderer, zoomer;
};

SimulatedRoom::SimulatedRoom(const SimulatedRoomOptions& options) {
  ThrowIfProblems(options.Problems());
  impl_ = std::make_unique<Impl>(options);
}
SimulatedRoom::~SimulatedRoom() = default;

const SimulatedRoomOptions& SimulatedRoom::options() const { return impl_->options; }
const Camera& SimulatedRoom::camera() const { return impl_->camera; }
const Camera& SimulatedRoom::TrueCamera(int photo) const {
  return impl_->Photos().CameraOf(PlaceOf(photo)).camera();
}
int SimulatedRoom::NumPhotos() const {
  return static_cast<int>(impl_->cam_from_room.size()) * (impl_->projected ? 2 : 1);
}
bool SimulatedRoom::IsPatterned(int photo) const { return impl_->projected && photo % 2 == 0; }
int SimulatedRoom::NumStations() const { return static_cast<int>(impl_->room_from_station.size()); }
int SimulatedRoom::PlaceOf(int photo) const { return impl_->projected ? photo / 2 : photo; }
const std::vector<Projector>& SimulatedRoom::Projectors() const { return impl_->projectors; }

std::string SimulatedRoom::PhotoName(int photo) const {
  return impl_->projected ? fmt::format("IMG_{:04}.jpg", photo + 1)
                          : fmt::format("photo_{:03}.jpg", photo);
}

Rigid SimulatedRoom::CamFromRoom(int photo) const {
  return impl_->cam_from_room.at(PlaceOf(photo));
}
Rigid SimulatedRoom::CamFromRoomAt(int photo, double row_share) const {
  return impl_->row_poses.at(PlaceOf(photo)).At(row_share);
}
Rigid SimulatedRoom::CamFromScan(int photo) const {
  return CamFromRoom(photo) * impl_->room_from_station[0];
}
Rigid SimulatedRoom::ScanFromRoom() const { return impl_->room_from_station[0].Inverse(); }
double SimulatedRoom::ExposureEv(int photo) const {
  const auto& exposures = IsPatterned(photo) ? impl_->patterned_exposures : impl_->exposures;
  return exposures.at(PlaceOf(photo));
}
double SimulatedRoom::ExposureTime(int photo) const {
  return NominalExposureTime(impl_->options) * std::exp2(ExposureEv(photo));
}

double SimulatedRoom::NotedTime(int photo) const {
  const std::string& wrong = impl_->options.wrong_exif;
  if (wrong == "all") return NominalExposureTime(impl_->options);
  const int middle_place = static_cast<int>(impl_->cam_from_room.size()) / 2;
  const bool is_middle = PlaceOf(photo) == middle_place && !IsPatterned(photo);
  return ExposureTime(photo) * (wrong == "one" && is_middle ? 0.25 : 1);
}
Eigen::Vector3f SimulatedRoom::WhiteBalance(int photo) const {
  return WhiteBalanceOf(photo, impl_->options.random_seed, impl_->options.white_balance_ev);
}

cv::Mat SimulatedRoom::RenderPhoto(int photo) const {
  PhotoSettings settings;
  settings.exposure_ev = ExposureEv(photo);
  settings.gloss = impl_->options.gloss;
  settings.blur_px = IsBlurred(photo) ? impl_->options.blur_px : 0;
  if (IsBlurred(photo)) {
    RandomStream random(MixBits(static_cast<uint64_t>(impl_->options.random_seed), 511, photo));
    const double direction = random.Uniform(0, kPi);
    settings.motion_px =
        impl_->options.motion_px * Eigen::Vector2d(std::cos(direction), std::sin(direction));
  }
  settings.response = impl_->options.response;
  settings.vignetting = impl_->options.vignetting;
  settings.white_balance = WhiteBalance(photo);
  settings.noise = impl_->options.photo_noise;
  settings.noise_seed = MixBits(static_cast<uint64_t>(impl_->options.random_seed), 501, photo);
  if (IsPatterned(photo)) settings.projected = impl_->projected.get();
  const int place = PlaceOf(photo);
  cv::Mat image = impl_->Renderer(place).Render(impl_->row_poses.at(place), settings,
                                                impl_->options.num_threads);
  if (HasStranger(photo)) {
    DrawStranger(MixBits(static_cast<uint64_t>(impl_->options.random_seed), 521, photo), &image);
  }
  return image;
}

// Both photos of a place or none: a share of one half would else be all plain ones.
bool SimulatedRoom::IsBlurred(int photo) const {
  return IsOfShare(PlaceOf(photo), impl_->options.blurred);
}

bool SimulatedRoom::HasStranger(int photo) const {
  return IsOfShare(PlaceOf(photo), impl_->options.strangers);
}

Scan SimulatedRoom::MakeScan(int station) const {
  const RoomScanner scanner = impl_->Scanner(station);
  Scan scan;
  scan.num_columns = scanner.grid().num_columns;
  scan.num_rows = scanner.grid().num_rows;
  scan.is_rtpi = true;
  scan.path = "simulated scan " + std::to_string(station);
  if (station > 0) scan.scan_from_station = ScanFromRoom() * impl_->room_from_station[station];
  scan.points.assign(static_cast<size_t>(scan.num_columns) * scan.num_rows, Scan::MissingPoint());
  scan.intensity.assign(scan.points.size(), 0);
  ParallelFor(impl_->options.num_threads, 0, scan.num_rows, [&](int row) {
    for (int column = 0; column < scan.num_columns; ++column) {
      const int index = scan.Index(column, row);
      const ScanSample sample = scanner.Measure(index);
      if (sample.missing) continue;
      scan.points[index] =
          station > 0 ? scan.scan_from_station * sample.x_in_station : sample.x_in_station;
      scan.intensity[index] = sample.intensity;
    }
  });
  return scan;
}

std::vector<Eigen::Vector3f> SimulatedRoom::TrueColors(int station) const {
  const RoomScanner scanner = impl_->Scanner(station);
  const ScanGrid& grid = scanner.grid();
  std::vector<Eigen::Vector3f> colors(static_cast<size_t>(grid.num_columns) * grid.num_rows,
                                      Eigen::Vector3f::Zero());
  ParallelFor(impl_->options.num_threads, 0, grid.num_rows, [&](int row) {
    for (int column = 0; column < grid.num_columns; ++column) {
      const int index = row * grid.num_columns + column;
      const ScanSample sample = scanner.Measure(index);
      if (!sample.missing) colors[index] = impl_->scene.Color(sample.hit).cwiseMax(0).cwiseMin(1);
    }
  });
  return colors;
}

TrueSamples SimulatedRoom::MakeTrueSamples(int station) const {
  const RoomScanner scanner = impl_->Scanner(station);
  const ScanGrid& grid = scanner.grid();
  const size_t count = static_cast<size_t>(grid.num_columns) * grid.num_rows;
  TrueSamples samples;
  samples.points.assign(count, Scan::MissingPoint());
  samples.normals.assign(count, Eigen::Vector3f::Zero());
  samples.cell_colors.assign(count, Eigen::Vector3f::Zero());
  const Rigid& room_from_station = impl_->room_from_station.at(station);
  const Eigen::Vector3d& origin = room_from_station.translation;
  ParallelFor(impl_->options.num_threads, 0, grid.num_rows, [&](int row) {
    for (int column = 0; column < grid.num_columns; ++column) {
      const int index = row * grid.num_columns + column;
      const ScanSample sample = scanner.Measure(index);
      if (sample.missing) continue;
      const SceneHit& hit = sample.hit;
      const Eigen::Vector3d normal = impl_->scene.patches()[hit.patch].Normal();
      const auto offset = [&](int at_column, int at_row) {
        const Eigen::Vector3d direction =
            room_from_station.rotation *
            ScanGrid::Direction(grid.Theta(at_column), grid.Phi(at_row));
        return OffsetOnPlane(origin, direction, hit.point, normal);
      };
      // Where the grid's own ray meets the surface: a depth camera that drifts shows what lies
      // beside it.
      const Eigen::Vector3d here = offset(column, row);
      samples.points[index] = hit.point;
      const double facing = normal.dot(origin - hit.point) < 0 ? -1 : 1;
      samples.normals[index] = (facing * normal).cast<float>();
      samples.cell_colors[index] =
          impl_->scene.Color(hit, offset(column + 1, row) - here, offset(column, row + 1) - here)
              .cwiseMax(0)
              .cwiseMin(1);
    }
  });
  return samples;
}

std::vector<Eigen::Vector2f> SimulatedRoom::TrueSightings(const TrueSamples& samples,
                                                          int photo) const {
  constexpr double kFlattest = 0.05;
  constexpr int kAtOnce = 4096;
  const RowPoses& poses = impl_->row_poses.at(PlaceOf(photo));
  const CameraProjection& projection = impl_->Photos().CameraOf(PlaceOf(photo));
  const int count = static_cast<int>(samples.points.size());
  std::vector<Eigen::Vector2f> sightings(
      count, Eigen::Vector2f::Constant(std::numeric_limits<float>::quiet_NaN()));
  ParallelFor(impl_->options.num_threads, 0, (count + kAtOnce - 1) / kAtOnce, [&](int block) {
    for (int i = block * kAtOnce; i < std::min(count, (block + 1) * kAtOnce); ++i) {
      const Eigen::Vector3d& point = samples.points[i];
      const auto position = poses.Project(projection, point);
      if (!position || !projection.InImage(*position)) continue;
      const Eigen::Vector3d centre =
          poses.At(RowShare(projection.camera(), *position)).TargetOriginInSource();
      const Eigen::Vector3d to_camera = (centre - point).normalized();
      if (!(to_camera.dot(samples.normals[i].cast<double>()) > kFlattest)) continue;
      if (impl_->scene.IsOccluded(centre, point)) continue;
      sightings[i] = position->cast<float>();
    }
  });
  return sightings;
}

Similarity SimulatedRoom::ScanFromSparse() const {
  RandomStream random(MixBits(static_cast<uint64_t>(impl_->options.random_seed), 601));
  Similarity scan_from_sparse;
  scan_from_sparse.scale = random.Uniform(0.3, 0.6);
  const Eigen::Vector3d axis(random.Gaussian(), random.Gaussian(), random.Gaussian());
  scan_from_sparse.rotation = Eigen::AngleAxisd(random.Uniform(0.5, 2.5), axis.normalized());
  scan_from_sparse.translation << random.Uniform(-2, 2), random.Uniform(-2, 2),
      random.Uniform(-2, 2);
  return scan_from_sparse;
}

SparseModel SimulatedRoom::MakeSparseModel(int num_points, double noise_px) const {
  const Rigid scan_from_room = ScanFromRoom();
  const Similarity sparse_from_room =
      ScanFromSparse().Inverse() *
      Similarity{1, scan_from_room.rotation, scan_from_room.translation};
  SparseModel model = MakeRoomSparseModel(impl_->Photos(), sparse_from_room, num_points, noise_px);
  const int photos_per_place = impl_->projected ? 2 : 1;
  for (auto& [id, image] : model.images) {
    image.name = PhotoName(photos_per_place * (static_cast<int>(id) - 1));
  }
  return model;
}

std::vector<SimulatedPick> SimulatedRoom::MakePicks(int photo, int count, int station) const {
  RandomStream random(MixBits(static_cast<uint64_t>(impl_->options.random_seed), 701, photo));
  std::vector<SimulatedPick> picks;
  for (const PickCandidate& candidate :
       SpreadPicks(impl_->Candidates(PlaceOf(photo), station), count, impl_->PhotoDiagonal())) {
    const Eigen::Vector2d noise(random.Gaussian(), random.Gaussian());
    const Eigen::Vector2d click = candidate.x_in_img + impl_->options.click_noise_px * noise;
    // Nobody clicks beside the photo.
    const Eigen::Vector2d inside = click.cwiseMax(0).cwiseMin(
        Eigen::Vector2d(impl_->options.photo_width, impl_->options.photo_height));
    picks.push_back({PhotoName(photo), inside, candidate.x_in_scan});
  }
  return picks;
}

int SimulatedRoom::BestPhotoForPicks(int station) const {
  int best_photo = 0;
  double best = -1;
  for (int photo = 0; photo < NumPhotos(); ++photo) {
    if (impl_->projected && !IsPatterned(photo)) continue;
    if (impl_->options.IsZoomed(PlaceOf(photo))) continue;  // nobody clicks in the odd one
    // How far apart the picks would lie: the smallest spread of the points in space.
    const auto picks =
        SpreadPicks(impl_->Candidates(PlaceOf(photo), station), 8, impl_->PhotoDiagonal());
    if (picks.size() < 6) continue;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const auto& pick : picks) mean += pick.x_in_scan / static_cast<double>(picks.size());
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const auto& pick : picks)
      spread += (pick.x_in_scan - mean) * (pick.x_in_scan - mean).transpose();
    const double volume = spread.determinant();
    if (volume > best) {
      best = volume;
      best_photo = photo;
    }
  }
  return best_photo;
}

}  // namespace roomtex
