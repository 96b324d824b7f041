#include "align/pick/pick_scene.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <set>
#include <tuple>

#include "align/pick/mesh_panorama.h"
#include "colmap_ext/panorama_model.h"
#include "core/error.h"
#include "core/output_file.h"
#include "core/photo_files.h"
#include "core/projections.h"
#include "core/resource_limits.h"
#include "core/surfels.h"
#include "importers/scan_record.h"

namespace roomtex {
namespace {

constexpr int kRankCells = 8;  // a photo has this many cells across and down

// Share of the cells of a photo in which it has sparse points.
double Coverage(const SparseImage& image, const Camera& camera) {
  std::set<int> cells;
  for (size_t i = 0; i < image.points2d.size(); ++i) {
    if (image.point3d_ids[i] == kInvalidPoint3dId) continue;
    const Eigen::Vector2d& x = image.points2d[i];
    const auto cell = [](double at, int size) {
      return std::clamp(static_cast<int>(kRankCells * at / size), 0, kRankCells - 1);
    };
    cells.insert(kRankCells * cell(x.y(), camera.height) + cell(x.x(), camera.width));
  }
  return cells.size() / static_cast<double>(kRankCells * kRankCells);
}

double ScoreOf(const SparseImage& image, const Camera& camera, const SparseModel& model) {
  double connections = 0;  // points that many photos see connect this one to them
  for (const uint64_t point_id : image.point3d_ids) {
    const auto point = model.points.find(point_id);
    if (point == model.points.end()) continue;
    connections += std::log2(static_cast<double>(std::max<size_t>(point->second.track.size(), 1)));
  }
  return Coverage(image, camera) * std::sqrt(connections);
}

}  // namespace

PickScene::PickScene(const PickSceneInput& input, Progress* progress) : input_(input) {
  RequireFolder(input.image_path, "Check --image_path");
  ReadModels(progress);
  for (const SparseModel& model : models_) projections_.push_back(ProjectionsOf(model.cameras));
  AddPhotos();
  progress->Stage("read scan");
  ReadScans();
  for (const Scan& scan : scans_) {
    if (!scan.organised) AddPanorama(scan);
    places_.push_back(std::make_unique<ScanPlaces>(scan.organised ? scan : panoramas_.back()));
  }
  progress->Finish();
}

void PickScene::ReadModels(Progress* progress) {
  if (has_model()) progress->Stage("read model");
  for (const std::string& path : input_.input_paths) {
    std::vector<std::string> warnings;
    models_.push_back(ReadModelOfPanoramas(path, input_.panoramas_path, &warnings));
    for (const std::string& warning : warnings) progress->Note(warning);
    if (!models_.back().images.empty()) continue;
    throw InputError(path, "", "the sparse model has no photos",
                     "Reconstruct the photos first (roomtex-mapper)");
  }
  if (has_model()) return;
  progress->Stage("read photos");
  PhotoModel photos =
      MakePhotoModel(input_.image_path, ListPhotoFiles(input_.image_path, "Check --image_path"),
                     input_.camera, UnfitPhotos::kTaken);
  models_.push_back(std::move(photos.model));
  focal_sources_ = std::move(photos.focal_sources);
}

FocalSource PickScene::focal_source(const std::string& name) const {
  const auto at = focal_sources_.find(name);
  return at == focal_sources_.end() ? FocalSource::kGiven : at->second;
}

void PickScene::ReadScans() {
  const AlignmentRecord record = ReadAlignmentRecord(input_.AlignedPath());
  PlacedScans placed =
      ReadScansOfModel(record, {input_.scan_paths, input_.scan_poses, input_.scan_reader});
  input_.remembers_scans = !record.scans.empty() && input_.scan_paths.empty();
  scans_ = std::move(placed.scans);
  ReplaceClouds(&scans_, input_.num_threads);
  notes_.insert(notes_.end(), placed.notes.begin(), placed.notes.end());
  input_.scan_paths.clear();
  for (const PlacedScans::File& file : placed.files) {
    input_.scan_paths.push_back(file.path);
    if (azimuth_.empty()) azimuth_ = file.azimuth;
  }
  if (record.scans.empty()) return;
  // What roomtex-align is to be told.
  if (!azimuth_.empty()) input_.scan_reader.azimuth = azimuth_;
  input_.scan_reader.units = record.scans[0].units;
  input_.scan_reader.max_range = record.scans[0].max_range;
  if (!record.scans[0].up_axis.empty() && record.scans[0].azimuth.empty()) {
    input_.scan_reader.up_axis = record.scans[0].up_axis;
  }
}

void PickScene::AddPanorama(const Scan& mesh) {
  const int columns = PanoramaColumns(mesh);
  if (scans_.size() == 1) {  // the rays of all scans are those of the mesh
    rays_ = std::make_unique<ScanRays>(scans_);
    panoramas_.push_back(PanoramaOfMesh(mesh, rays_->caster(), columns, input_.num_threads));
    return;
  }
  const RayCaster caster(mesh.points, mesh.triangles);
  panoramas_.push_back(PanoramaOfMesh(mesh, caster, columns, input_.num_threads));
}

PickScene::~PickScene() {
  stopping_ = true;
  if (worker_.joinable()) worker_.join();
}

void PickScene::AddPhoto(int model, const SparseImage& image, std::vector<std::string>* notes) {
  PickPhoto photo;
  photo.model = model;
  photo.image = &image;
  photo.projection = &projections_[model].at(image.camera_id);
  photo.path = input_.image_path + "/" + image.name;
  const Camera& camera = photo.projection->camera();
  photo.fit = FitPhotoToCamera(photo.path, image.name, camera.width, camera.height);
  photo.problem = photo.fit.problem;
  if (photo.problem.empty() && !photo.fit.note.empty()) notes->push_back(photo.fit.note);
  photo.missing = !photo.problem.empty();
  photo.num_points = static_cast<int>(
      std::count_if(image.point3d_ids.begin(), image.point3d_ids.end(),
                    [](uint64_t point_id) { return point_id != kInvalidPoint3dId; }));
  photo.score = ScoreOf(image, camera, models_[model]);
  photos_.push_back(photo);
}

void PickScene::AddPhotos() {
  std::vector<std::string> notes;
  for (size_t model = 0; model < models_.size(); ++model) {
    for (const auto& [id, image] : models_[model].images) {
      AddPhoto(static_cast<int>(model), image, &notes);
    }
  }
  for (const std::string& note : FirstNotes(notes)) notes_.push_back(note);
  // A photo that two models hold is picked in for the one in which it sees more.
  std::stable_sort(photos_.begin(), photos_.end(), [](const PickPhoto& a, const PickPhoto& b) {
    return std::forward_as_tuple(a.name(), b.num_points) <
           std::forward_as_tuple(b.name(), a.num_points);
  });
  photos_.erase(
      std::unique(photos_.begin(), photos_.end(),
                  [](const PickPhoto& a, const PickPhoto& b) { return a.name() == b.name(); }),
      photos_.end());
  for (size_t i = 0; i < photos_.size(); ++i) photos_[i].id = static_cast<int>(i);
  const bool none = std::all_of(photos_.begin(), photos_.end(),
                                [](const PickPhoto& photo) { return photo.missing; });
  if (none) {
    std::string problem = photos_[0].problem;
    problem.pop_back();  // the full stop
    throw InputError(input_.image_path, "",
                     (has_model() ? "none of the sparse model's " : "none of the ") +
                         std::to_string(photos_.size()) + " photos can be shown. " + problem,
                     "");
  }
}

std::vector<const PickPhoto*> PickScene::Ranked(const std::vector<double>& scan_shares) const {
  std::vector<std::pair<double, const PickPhoto*>> scored;
  for (const PickPhoto& photo : photos_) {
    const double known = scan_shares.empty() ? 1 : scan_shares[photo.id];
    const double share = std::isnan(known) ? 1 : known;
    scored.emplace_back(photo.missing ? 1.0 : -photo.score * std::sqrt(share), &photo);
  }
  std::stable_sort(scored.begin(), scored.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<const PickPhoto*> ranked;
  for (const auto& [score, photo] : scored) ranked.push_back(photo);
  return ranked;
}

const PickPhoto* PickScene::FindPhoto(const std::string& name) const {
  const auto at = std::lower_bound(
      photos_.begin(), photos_.end(), name,
      [](const PickPhoto& photo, const std::string& n) { return photo.name() < n; });
  return at == photos_.end() || at->name() != name ? nullptr : &*at;
}

void PickScene::Prepare() {
  worker_ = StartThread([this] {
    try {
      Work();
    } catch (const std::exception&) {
      // Out of memory: the page works on, without what needs the rays.
      failed_ = true;
      changed_.notify_all();
    }
  });
}

void PickScene::Work() {
  const auto publish = [this](const auto& store) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      store();
    }
    changed_.notify_all();
  };
  if (!rays_) rays_ = std::make_unique<ScanRays>(scans_);
  publish([&] { rays_ready_ = rays_.get(); });
  if (stopping_) return;
  auto edges = std::make_unique<Edges>(Edges{surveyed_.free_space(), {}});
  for (const auto& places : places_) {
    if (stopping_) return;
    for (ScanEdge& edge : FindScanEdges(places->scan(), ScanEdgeOptions())) {
      edges->edges.push_back(std::move(edge));
    }
  }
  edges_ = std::move(edges);
  publish([&] { edges_ready_ = edges_.get(); });
}

const ScanRays* PickScene::WaitForRays(const std::function<bool()>& give_up) const {
  std::unique_lock<std::mutex> lock(mutex_);
  while (rays_ready_ == nullptr && !failed_ && !give_up()) {
    changed_.wait_for(lock, std::chrono::milliseconds(50));
  }
  return rays_ready_;
}

const PickScene::Edges* PickScene::WaitForEdges(const std::function<bool()>& give_up) const {
  std::unique_lock<std::mutex> lock(mutex_);
  while (edges_ready_ == nullptr && !failed_ && !give_up()) {
    changed_.wait_for(lock, std::chrono::milliseconds(50));
  }
  return edges_ready_;
}

}  // namespace roomtex
