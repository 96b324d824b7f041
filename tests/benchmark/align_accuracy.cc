// How exact an alignment from six clicks is, and whether wrong ones are believed: simulated rooms
// with known truth (tests/align/simulated_alignment.h: range noise 2 mm, clicks 1.5 px, keypoints
// 0.7 px; poses and points by bundle adjustment), in memory.
//   build/bin/align_accuracy [rooms, 20] [words of the case]

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <iterator>
#include <map>
#include <string>

#include "core/error.h"
#include "core/frames.h"
#include "core/statistics.h"
#include "tests/align/simulated_alignment.h"
#include "tests/align/surface/surface_room.h"

namespace roomtex {
namespace {

constexpr double kWrong = 0.02;  // metres; a worst camera farther off than this must not be trusted

struct Row {
  const char* name;
  std::function<SimulatedCase(int seed)> make;
  bool is_right;  // whether there is a right answer
};

// The sparse model is what bundle adjustment makes of the keypoints, with its errors.
const SimulatedCase& RoomWithPicks(int seed, int num_picks) {
  static std::map<std::pair<int, int>, SimulatedCase> cases;
  SimulatedCase& one = cases[{seed, num_picks}];
  if (one.room != nullptr) return one;
  one = MakeCase(seed, num_picks);
  one.model = Reconstructed(one.model);
  return one;
}

// A room of the same size with other furniture and pictures.
SimulatedCase WithScanOfSimilarRoom(int seed) {
  SimulatedCase one = RoomWithPicks(seed, 6);
  one.scans = RoomWithPicks(seed + 1, 6).scans;
  return one;
}

double DistanceFromScan(const Scan& scan, const Eigen::Vector3d& x_in_scan) {
  double nearest = 1e9;
  for (const Eigen::Vector3d& x : scan.points) {
    const double distance = (x - x_in_scan).norm();
    if (distance < nearest) nearest = distance;  // false for a missing sample
  }
  return nearest;
}

// The same, and the clicks are on what both rooms share: walls, corners, door. The alignment fits
// the shell of the wrong room as well as that of the right one.
SimulatedCase WithPicksThatFitSimilarRoom(int seed) {
  SimulatedCase one = WithScanOfSimilarRoom(seed);
  one.picks.clear();
  for (const Pick& pick : PicksOfPhoto(*one.room, one.room->BestPhotoForPicks(), 60)) {
    if (one.picks.size() < 8 && DistanceFromScan(one.scans[0], pick.x_in_scan) < 0.02) {
      one.picks.push_back(pick);
    }
  }
  return one;
}

// 45 000 samples, 5 cm apart on the walls.
SimulatedCase Coarse(SimulatedCase one, int seed_of_scan) {
  SimulatedRoomOptions options = CaseOptions(seed_of_scan);
  options.scan_columns = 300;
  options.scan_rows = 150;
  one.scans = MakeCase(options, 6).scans;
  return one;
}

// The picks of a photo under the name of another.
SimulatedCase WithAnotherPhoto(int seed) {
  SimulatedCase one = RoomWithPicks(seed, 6);
  const int photo = one.room->BestPhotoForPicks();
  const std::string other = one.room->PhotoName((photo + 5) % one.room->NumPhotos());
  for (Pick& pick : one.picks) pick.image_name = other;
  return one;
}

SimulatedCase WithExchangedPicks(int seed) {
  SimulatedCase one = RoomWithPicks(seed, 6);
  std::swap(one.picks[1].x_in_img, one.picks[4].x_in_img);
  return one;
}

SimulatedCase WithMirroredScan(int seed) {
  SimulatedCase one = RoomWithPicks(seed, 6);
  for (Eigen::Vector3d& x : one.scans[0].points) x.x() = -x.x();
  one.scans[0].scan_from_station.translation.x() *= -1;
  return one;
}

SimulatedCase FarOff(SimulatedCase one) {
  const Camera& camera = one.room->camera();
  const Eigen::Vector2d middle(0.5 * camera.width, 0.5 * camera.height);
  one.picks[2].x_in_img += 70 * (middle - one.picks[2].x_in_img).normalized();
  return one;
}
SimulatedCase WithOnePickFarOff(int seed) { return FarOff(RoomWithPicks(seed, 6)); }
SimulatedCase WithOneOfEightFarOff(int seed) { return FarOff(RoomWithPicks(seed, 8)); }

SimulatedCase WithNoisyScan(int seed) {
  SimulatedRoomOptions options = CaseOptions(seed);
  options.range_noise = 0.004;
  options.range_noise_growth = 0.5;
  SimulatedCase one = MakeCase(options, 6);
  one.model = Reconstructed(one.model);
  return one;
}

SimulatedCase WithCoarseScan(int seed, bool depth_camera, double drift,
                             double click_noise_px = 1.5) {
  SimulatedRoomOptions options = CaseOptions(seed);
  options.width = 7.5;
  options.depth = 6.5;
  options.scan_columns = 800;
  options.scan_rows = 340;
  options.depth_camera = depth_camera;
  options.depth_drift = drift;
  options.click_noise_px = click_noise_px;
  SimulatedCase one = MakeCase(options, 6);
  one.model = Reconstructed(one.model);
  return one;
}

const Row kRows[] = {
    {"six clicks", [](int seed) { return RoomWithPicks(seed, 6); }, true},
    {"six clicks, range noise 4 mm growing by half per metre", WithNoisyScan, true},
    {"eight clicks, one far off", WithOneOfEightFarOff, true},
    {"one of six far off", WithOnePickFarOff, true},
    {"two exchanged", WithExchangedPicks, false},
    {"another photo's name", WithAnotherPhoto, false},
    {"mirrored scan", WithMirroredScan, false},
    {"scan of a similar room", WithScanOfSimilarRoom, false},
    {"similar room, picks on what is the same", WithPicksThatFitSimilarRoom, false},
    {"coarse scan", [](int seed) { return Coarse(RoomWithPicks(seed, 6), seed); }, true},
    {"coarse scan of a similar room",
     [](int seed) { return Coarse(RoomWithPicks(seed, 6), seed + 1); }, false},
    {"coarse scan of a similar room, picks on what is the same",
     [](int seed) { return Coarse(WithPicksThatFitSimilarRoom(seed), seed + 1); }, false},
    {"large room, 800 x 340 samples", [](int seed) { return WithCoarseScan(seed, false, 0); },
     true},
    {"large room, 800 x 340 samples, clicks off by 10 pixels",
     [](int seed) { return WithCoarseScan(seed, false, 0, 10); }, true},
    {"large room by a depth camera, no drift",
     [](int seed) { return WithCoarseScan(seed, true, 0); }, true},
    {"large room by a depth camera, no drift, clicks off by 10 pixels",
     [](int seed) { return WithCoarseScan(seed, true, 0, 10); }, true},
    {"large room by a depth camera, 20 mm of drift",
     [](int seed) { return WithCoarseScan(seed, true, 0.02); }, true},
};

struct Counts {
  int trusted = 0, untrusted = 0, refused = 0, wrong_and_trusted = 0;
  // Of the alignments that were found, one number each.
  std::vector<double> similarity_mm, median_mm, worst_mm, median_deg, expected_ratio;
};

struct Errors {
  std::vector<double> position, rotation;  // one per photo: metres, degrees
};

Errors ErrorsOf(const SimulatedRoom& room, const SparseModel& model) {
  Errors errors;
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    const Rigid& found = model.FindImage(room.PhotoName(photo))->cam_from_model;
    const Rigid truth = room.CamFromScan(photo);
    errors.position.push_back((found.TargetOriginInSource() - truth.TargetOriginInSource()).norm());
    errors.rotation.push_back(DegFromRad(RotationAngle(found.rotation, truth.rotation)));
  }
  return errors;
}

// is_right: whether the case has a right answer; any other that is trusted is wrong.
void Add(const SimulatedCase& one, bool is_right, Counts* counts) {
  Alignment alignment;
  try {
    alignment = AlignCase(one);
  } catch (const InputError&) {
    ++counts->refused;
    return;
  }
  SparseModel model = one.model;
  TransformModel(alignment.fit.surface.scan_from_sparse, &model);
  const Errors by_similarity = ErrorsOf(*one.room, model);
  if (alignment.adjusted()) model = alignment.adjustment.bundle.model;
  const Errors errors = ErrorsOf(*one.room, model);
  const double worst = Quantile(errors.position, 1), median = Quantile(errors.position, 0.5);
  const bool trusted = alignment.reasons.empty();
  (trusted ? counts->trusted : counts->untrusted) += 1;
  counts->wrong_and_trusted += trusted && (!is_right || worst > kWrong);
  counts->similarity_mm.push_back(1000 * Quantile(by_similarity.position, 0.5));
  counts->median_mm.push_back(1000 * median);
  counts->worst_mm.push_back(1000 * worst);
  counts->median_deg.push_back(Quantile(errors.rotation, 0.5));
  counts->expected_ratio.push_back(median / alignment.expected_error.at_cameras);
}

bool IsAsked(const Row& row, const std::string& words) {
  return std::string(row.name).find(words) != std::string::npos;
}

void RunAll(int num_rooms, const std::string& words) {
  std::printf(
      "Photos off, over all alignments that were found: median photo of the median and of the "
      "worst room, worst photo of all rooms.\n\n"
      "| case, %d rooms each | trusted | exit 4, model written | refused | wrong and trusted | mm "
      "by one "
      "similarity | mm | degrees | "
      "error / expected error: 10 %%, 50 %%, 90 %% |\n|---|---|---|---|---|---|---|---|---|\n",
      num_rooms);
  for (const Row& row : kRows) {
    if (!IsAsked(row, words)) continue;
    Counts counts;
    for (int seed = 0; seed < num_rooms; ++seed) Add(row.make(seed), row.is_right, &counts);
    std::printf("| %s | %d | %d | %d | %d |", row.name, counts.trusted, counts.untrusted,
                counts.refused, counts.wrong_and_trusted);
    if (counts.median_mm.empty()) {
      std::printf(" - | - | - | - |\n");
      continue;
    }
    std::printf(" %.2f | %.2f, %.2f, %.2f | %.4f | %.2f, %.2f, %.2f |\n",
                Quantile(counts.similarity_mm, 0.5), Quantile(counts.median_mm, 0.5),
                Quantile(counts.median_mm, 1), Quantile(counts.worst_mm, 1),
                Quantile(counts.median_deg, 0.5), Quantile(counts.expected_ratio, 0.1),
                Quantile(counts.expected_ratio, 0.5), Quantile(counts.expected_ratio, 0.9));
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  const int num_rooms = argc > 1 ? std::atoi(argv[1]) : 20;
  const std::string words = argc > 2 ? argv[2] : "";
  if (argc > 3 || num_rooms < 1) {
    std::fprintf(stderr, "align_accuracy [rooms] [words of the case]\n");
    return 2;
  }
  const auto is_asked = [&words](const roomtex::Row& row) { return roomtex::IsAsked(row, words); };
  if (std::none_of(std::begin(roomtex::kRows), std::end(roomtex::kRows), is_asked)) {
    std::fprintf(stderr, "align_accuracy: no case has \"%s\" in its name\n", words.c_str());
    return 2;
  }
  roomtex::RunAll(num_rooms, words);
}
