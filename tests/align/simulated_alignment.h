#pragma once
// A simulated room with its scan, sparse model and picks, ready to be aligned. Made once per
// process.

#include <algorithm>
#include <cmath>
#include <cstring>
#include <list>
#include <map>
#include <memory>
#include <utility>

#include "align/alignment.h"
#include "capture/simulation/simulated_room.h"
#include "colmap_ext/photo_bundle.h"
#include "colmap_ext/reprojection_cost.h"
#include "core/frames.h"
#include "core/random_stream.h"

namespace roomtex {

struct SimulatedCase {
  std::shared_ptr<const SimulatedRoom> room;
  SparseModel model;
  std::vector<Scan> scans;
  std::vector<Pick> picks;
  std::string azimuth = "clockwise";
};

inline std::vector<Pick> PicksOfPhoto(const SimulatedRoom& room, int photo, int count,
                                      long first_line = 2) {
  std::vector<Pick> picks;
  for (const SimulatedPick& pick : room.MakePicks(photo, count)) {
    picks.push_back({pick.image_name, pick.x_in_img, pick.x_in_scan,
                     first_line + static_cast<long>(picks.size())});
  }
  return picks;
}

inline SimulatedRoomOptions CaseOptions(int seed) {
  SimulatedRoomOptions options;
  options.random_seed = seed;
  options.num_photos = 16;
  options.scan_columns = 800;
  options.scan_rows = 400;
  return options;
}

// `num_picks` picks in the best photo: click noise 1.5 pixels, keypoint noise 0.7 pixels.
inline SimulatedCase MakeCase(const SimulatedRoomOptions& options, int num_picks) {
  SimulatedCase one;
  one.room = std::make_shared<SimulatedRoom>(options);
  one.model = one.room->MakeSparseModel(2000, 0.7);
  one.scans = {one.room->MakeScan(0)};
  one.scans[0].path = "room.rtpi";
  one.scans[0].is_rtpi = true;
  one.picks = PicksOfPhoto(*one.room, one.room->BestPhotoForPicks(), num_picks);
  return one;
}

// Room `seed`, range noise 2 mm. The same room, whatever the number of picks.
inline const SimulatedCase& MakeCase(int seed = 0, int num_picks = 8) {
  static std::map<int, SimulatedCase> rooms;
  static std::map<std::pair<int, int>, SimulatedCase> cases;
  SimulatedCase& one = cases[{seed, num_picks}];
  if (one.room == nullptr) {
    SimulatedCase& any = rooms[seed];
    if (any.room == nullptr) any = MakeCase(CaseOptions(seed), num_picks);
    one = any;
    one.picks = PicksOfPhoto(*one.room, one.room->BestPhotoForPicks(), num_picks);
  }
  return one;
}

// The case as a mapper has it whose photos were read row by row while a hand turned the camera by
// 0.3 degrees and moved it by 3 mm (standard deviations per axis), or this share of that, and made
// it nod by so many degrees in every photo; motions: by image_id.
inline SimulatedCase WithRollingShutter(SimulatedCase one, uint64_t seed, RowMotions* motions,
                                        double share = 1, double nod_deg = 0) {
  const Camera& camera = one.room->camera();
  const CameraProjection projection(camera);
  const Similarity scan_from_sparse = one.room->ScanFromSparse();
  TransformModel(scan_from_sparse, &one.model);
  for (auto& [id, image] : one.model.images) {
    RandomStream random(MixBits(seed, id));
    RowMotion& motion = (*motions)[id];
    for (int k = 0; k < 3; ++k) {
      motion.turn[k] = share * RadFromDeg(0.3) * random.Gaussian();
      motion.move[k] = share * 0.003 * random.Gaussian();
    }
    motion.turn.x() += RadFromDeg(nod_deg);
    const auto shift = [&](const Eigen::Vector3d& x, Eigen::Vector2d* keypoint) {
      const auto still = projection.ImgFromCam(x);
      const auto seen = ImgFromMovingCam(projection, motion, x);
      if (still && seen) *keypoint += *seen - *still;
    };
    for (size_t k = 0; k < image.points2d.size(); ++k) {
      const auto point = one.model.points.find(image.point3d_ids[k]);
      if (point == one.model.points.end()) continue;
      shift(image.cam_from_model * point->second.x_in_model, &image.points2d[k]);
    }
    for (Pick& pick : one.picks) {
      if (pick.image_name != image.name) continue;
      shift(image.cam_from_model * pick.x_in_scan, &pick.x_in_img);
    }
  }
  TransformModel(scan_from_sparse.Inverse(), &one.model);
  one.model = AdjustedByPhotos(one.model, KeypointNoise(one.model));
  return one;
}

// Nothing in which an alignment could tell them apart. By bytes: missing points are not equal to
// themselves.
inline bool AreSame(const Scan& a, const Scan& b) {
  return a.path == b.path && a.is_rtpi == b.is_rtpi && a.organised == b.organised &&
         a.num_columns == b.num_columns && a.num_rows == b.num_rows && a.up == b.up &&
         a.scan_from_station.Matrix() == b.scan_from_station.Matrix() &&
         a.intensity == b.intensity && a.triangles == b.triangles &&
         a.points.size() == b.points.size() &&
         std::memcmp(a.points.data(), b.points.data(), a.points.size() * sizeof(Eigen::Vector3d)) ==
             0;
}

// The survey takes half the time of an alignment that is refused: the latest ones are kept.
inline const SurveyedScans& Survey(const std::vector<Scan>& scans) {
  struct Kept {
    explicit Kept(const std::vector<Scan>& of) : scans(of), surveyed(scans) {}
    const std::vector<Scan> scans;
    const SurveyedScans surveyed;
  };
  constexpr size_t kMost = 6;
  static std::list<Kept> latest;
  for (const Kept& kept : latest) {
    if (std::equal(scans.begin(), scans.end(), kept.scans.begin(), kept.scans.end(), AreSame)) {
      return kept.surveyed;
    }
  }
  if (latest.size() == kMost) latest.pop_back();
  return latest.emplace_front(scans).surveyed;
}

inline Alignment AlignCase(const SimulatedCase& one, const AlignmentOptions& options = {}) {
  Progress progress(true);
  return AlignToScan({one.model, Survey(one.scans), one.picks, "picks.csv", one.azimuth}, options,
                     &progress);
}
// From a similarity, with what picks there are.
inline Alignment AlignCaseFrom(const Similarity& scan_from_sparse, double position_sigma,
                               const SimulatedCase& one, const AlignmentOptions& options = {}) {
  Progress progress(true);
  return AlignToScan({one.model, Survey(one.scans), one.picks, "", one.azimuth},
                     StartFromSimilarity(one.model, one.picks, scan_from_sparse, position_sigma),
                     options, &progress);
}

inline std::string Reasons(const Alignment& alignment) {
  std::string all;
  for (const std::string& reason : alignment.reasons) all += reason + "\n";
  return all;
}

// MakeCase(seed, num_picks) as it is, aligned: what tests compare with.
inline const Alignment& AlignedCase(int seed = 0, int num_picks = 8) {
  static std::map<std::pair<int, int>, std::unique_ptr<Alignment>> alignments;
  std::unique_ptr<Alignment>& alignment = alignments[{seed, num_picks}];
  if (alignment == nullptr) {
    alignment = std::make_unique<Alignment>(AlignCase(MakeCase(seed, num_picks)));
  }
  return *alignment;
}

// Largest errors over the photos: position in metres, rotation in radians.
struct PoseErrors {
  double position = 0, rotation = 0;
};
inline PoseErrors WorstPoseErrors(const SimulatedRoom& room, const SparseModel& model,
                                  const Similarity& scan_from_sparse) {
  PoseErrors worst;
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    const SparseImage* image = model.FindImage(room.PhotoName(photo));
    const Rigid found = CamFromScan(image->cam_from_model, scan_from_sparse);
    const Rigid truth = room.CamFromScan(photo);
    worst.position = std::max(worst.position,
                              (found.TargetOriginInSource() - truth.TargetOriginInSource()).norm());
    worst.rotation = std::max(worst.rotation, RotationAngle(found.rotation, truth.rotation));
  }
  return worst;
}

}  // namespace roomtex
