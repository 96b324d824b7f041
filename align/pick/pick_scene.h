#pragma once
// What roomtex-pick works on and what does not change while it runs: sparse model, photos, scans.
// What takes seconds is made in the background.

#include <atomic>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "align/pick/scan_places.h"
#include "align/pick/scan_rays.h"
#include "align/surveyed_scans.h"
#include "align/trust/overlay.h"
#include "colmap_ext/sparse_model.h"
#include "core/camera_model.h"
#include "core/progress.h"
#include "core/scan.h"
#include "importers/scan_reader.h"

namespace roomtex {

struct PickSceneInput {
  std::string input_path, image_path, scan_poses;
  std::string panoramas_path;  // of MergeFaces(); may be empty
  std::vector<std::string> scan_paths;
  ScanReaderOptions scan_reader;
  int num_threads = -1;
};

struct PickPhoto {
  int id = 0;  // position in PickScene::photos(), which are in the order of their names
  const SparseImage* image = nullptr;
  const CameraProjection* projection = nullptr;
  std::string path;
  // It cannot be shown, and why, in a sentence: no file there, one outside the folder of the
  // photos, or one of another size than its camera's.
  bool missing = false;
  std::string problem;
  int num_points = 0;  // sparse points it sees
  // How good it is to pick in: many sparse points, all over the photo, that other photos see too.
  double score = 0;

  const std::string& name() const { return image->name; }
};

class PickScene {
 public:
  // Throws InputError.
  PickScene(const PickSceneInput& input, Progress* progress);
  ~PickScene();  // ends what runs in the background

  const PickSceneInput& input() const { return input_; }
  const SparseModel& model() const { return model_; }
  const std::vector<Scan>& scans() const { return scans_; }
  int num_scans() const { return static_cast<int>(scans_.size()); }
  // The grid that is picked on: the scan's own, or of a mesh what PanoramaOfMesh() makes of it.
  const ScanPlaces& places(int scan) const { return *places_[scan]; }
  const std::vector<PickPhoto>& photos() const { return photos_; }
  const PickPhoto* FindPhoto(const std::string& name) const;
  // The best to pick in first, those without a file last. scan_shares: by id, what share of the
  // scan each sees; empty = not known.
  std::vector<const PickPhoto*> Ranked(const std::vector<double>& scan_shares) const;

  // Begins to make what takes seconds.
  void Prepare();
  // Null until it stands.
  const ScanRays* rays() const { return rays_ready_.load(); }
  struct Edges {
    const FreeSpace& free_space;
    std::vector<ScanEdge> edges;
  };
  // Null until they stand, or when give_up() became true while waiting for them.
  const ScanRays* WaitForRays(const std::function<bool()>& give_up) const;
  const Edges* WaitForEdges(const std::function<bool()>& give_up) const;

 private:
  void AddPhotos();
  void AddPanorama(const Scan& mesh);
  void Work();

  const PickSceneInput input_;
  SparseModel model_;
  std::vector<Scan> scans_;
  const SurveyedScans surveyed_{scans_};
  std::deque<Scan> panoramas_;  // of meshes
  std::vector<std::unique_ptr<ScanPlaces>> places_;
  std::map<uint32_t, CameraProjection> projections_;
  std::vector<PickPhoto> photos_;

  std::thread worker_;
  std::atomic<bool> stopping_{false};
  std::unique_ptr<ScanRays> rays_;
  std::unique_ptr<Edges> edges_;
  std::atomic<const ScanRays*> rays_ready_{nullptr};
  std::atomic<const Edges*> edges_ready_{nullptr};
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
};

}  // namespace roomtex
