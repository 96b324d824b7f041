#pragma once
// What roomtex-pick works on and what does not change while it runs: sparse models or photos alone,
// scans.
// What takes seconds is made in the background.

#include <atomic>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "align/clicks/photo_model.h"
#include "align/pick/scan_places.h"
#include "align/pick/scan_rays.h"
#include "align/pick/session_pick.h"
#include "align/surveyed_scans.h"
#include "align/trust/overlay.h"
#include "colmap_ext/sparse_model.h"
#include "core/camera_model.h"
#include "core/photo_fit.h"
#include "core/progress.h"
#include "core/scan.h"
#include "importers/scan_reader.h"

namespace roomtex {

struct PickSceneInput {
  std::vector<std::string> input_paths;  // empty: the photos of image_path alone
  std::string image_path, scan_poses;
  std::string panoramas_path;           // of MergeFaces(); may be empty
  PhotoCameraOptions camera;            // of those
  std::vector<std::string> scan_paths;  // empty: those that the one model remembers
  bool remembers_scans = false;         // found: it does, and no other paths were given
  ScanReaderOptions scan_reader;
  int num_threads = -1;

  // The model that may remember its scans; "" = none or several.
  std::string AlignedPath() const { return input_paths.size() == 1 ? input_paths[0] : ""; }
};

struct PickPhoto {
  int id = 0;     // position in PickScene::photos(), which are in the order of their names
  int model = 0;  // position in PickScene::models()
  const SparseImage* image = nullptr;
  const CameraProjection* projection = nullptr;
  std::string path;
  PhotoFit fit;
  // It cannot be shown, and why, in a sentence: no file there, one outside the folder of the
  // photos, or one of another shape than its camera's.
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

  // The scans as they were found and read, where an aligned model remembers them.
  const PickSceneInput& input() const { return input_; }
  // How RTPI scans were read; "" = there are none.
  const std::string& azimuth() const { return azimuth_; }
  const std::vector<std::string>& notes() const {
    return notes_;
  }  // on scans and photos; sentences
  // Each in a frame of its own. Of photos alone one: cameras as far as they are known, no points,
  // poses that say nothing.
  const std::vector<SparseModel>& models() const { return models_; }
  bool has_model() const { return !input_.input_paths.empty(); }
  // How people call it: its path. Of photos alone "".
  std::string ModelName(int model) const { return has_model() ? input_.input_paths[model] : ""; }
  // Whether its picks have to find the lens of a photo as well.
  FocalSource focal_source(const std::string& name) const;
  const std::vector<Scan>& scans() const { return scans_; }
  // The scan that a pick's point is drawn in; the first where it is not drawn yet.
  const Scan& ScanOf(const SessionPick& pick) const {
    return scans_[pick.spot ? pick.spot->scan : 0];
  }
  int num_scans() const { return static_cast<int>(scans_.size()); }
  // The grid that is picked on: the scan's own, or of a mesh what PanoramaOfMesh() makes of it.
  const ScanPlaces& places(int scan) const { return *places_[scan]; }
  const std::vector<PickPhoto>& photos() const { return photos_; }
  const PickPhoto* FindPhoto(const std::string& name) const;
  // The best to pick in first, those without a file last. scan_shares: by id, what share of the
  // scan each sees; NaN = not known.
  std::vector<const PickPhoto*> Ranked(const std::vector<double>& scan_shares) const;

  // Begins to make what takes seconds.
  void Prepare();
  // Null until it stands.
  const ScanRays* rays() const { return rays_ready_.load(); }
  struct Edges {
    const FreeSpace& free_space;
    std::vector<ScanEdge> edges;
  };
  // Null if they cannot be made (memory ran out), or when give_up() became true while waiting.
  const ScanRays* WaitForRays(const std::function<bool()>& give_up) const;
  const Edges* WaitForEdges(const std::function<bool()>& give_up) const;

 private:
  void ReadModels(Progress* progress);
  void AddPhotos();
  void AddPhoto(int model, const SparseImage& image, std::vector<std::string>* notes);
  void ReadScans();
  void AddPanorama(const Scan& mesh);
  void Work();

  PickSceneInput input_;
  std::string azimuth_;
  std::vector<std::string> notes_;
  std::vector<SparseModel> models_;
  std::map<std::string, FocalSource> focal_sources_;  // without a sparse model
  std::vector<Scan> scans_;
  const SurveyedScans surveyed_{scans_};
  std::deque<Scan> panoramas_;  // of meshes
  std::vector<std::unique_ptr<ScanPlaces>> places_;
  std::vector<std::map<uint32_t, CameraProjection>> projections_;  // of each model
  std::vector<PickPhoto> photos_;

  std::thread worker_;
  std::atomic<bool> stopping_{false}, failed_{false};
  std::unique_ptr<ScanRays> rays_;
  std::unique_ptr<Edges> edges_;
  std::atomic<const ScanRays*> rays_ready_{nullptr};
  std::atomic<const Edges*> edges_ready_{nullptr};
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
};

}  // namespace roomtex
