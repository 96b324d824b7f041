// How exact an alignment from six clicks is, and whether wrong ones are believed: simulated rooms
// with known truth (tests/align/simulated_alignment.h: range noise 2 mm, clicks 1.5 px, keypoints
// 0.7 px), in memory.
//   build/bin/align_accuracy [rooms, 20]

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <functional>

#include "align/expected_error.h"
#include "core/error.h"
#include "core/frames.h"
#include "tests/align/simulated_alignment.h"

namespace roomtex {
namespace {

constexpr double kWrong = 0.02;  // metres; a worst camera farther off than this must not be trusted

struct Row {
  const char* name;
  std::function<SimulatedCase(int seed)> make;
};

SimulatedCase WithoutRoomsOwnScan(int seed) {
  SimulatedCase one = MakeCase(seed, 6);
  one.scans = MakeCase(seed + 1, 6).scans;
  return one;
}

// The picks of a photo under the name of another.
SimulatedCase WithAnotherPhoto(int seed) {
  SimulatedCase one = MakeCase(seed, 6);
  const int photo = one.room->BestPhotoForPicks();
  const std::string other = one.room->PhotoName((photo + 5) % one.room->NumPhotos());
  for (Pick& pick : one.picks) pick.image_name = other;
  return one;
}

SimulatedCase WithExchangedPicks(int seed) {
  SimulatedCase one = MakeCase(seed, 6);
  std::swap(one.picks[1].x_in_img, one.picks[4].x_in_img);
  return one;
}

SimulatedCase WithMirroredScan(int seed) {
  SimulatedCase one = MakeCase(seed, 6);
  for (Eigen::Vector3d& x : one.scans[0].points) x.x() = -x.x();
  one.scans[0].scan_from_station.translation.x() *= -1;
  return one;
}

SimulatedCase WithOnePickFarOff(int seed) {
  SimulatedCase one = MakeCase(seed, 6);
  one.picks[2].x_in_img += Eigen::Vector2d(60, -40);
  return one;
}

const Row kRows[] = {
    {"six clicks", [](int seed) { return MakeCase(seed, 6); }},
    {"one of six far off", WithOnePickFarOff},
    {"two exchanged", WithExchangedPicks},
    {"another photo's name", WithAnotherPhoto},
    {"mirrored scan", WithMirroredScan},
    {"scan of a similar room", WithoutRoomsOwnScan},
};

struct Counts {
  int trusted = 0, untrusted = 0, refused = 0, wrong_and_trusted = 0;
  std::vector<double> position_mm, rotation_deg, expected_mm;
};

double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<size_t>(share * static_cast<double>(values.size() - 1))];
}

void Add(const SimulatedCase& one, Counts* counts) {
  Alignment alignment;
  try {
    alignment = AlignCase(one);
  } catch (const InputError&) {
    ++counts->refused;
    return;
  }
  SparseModel model = one.model;
  TransformModel(alignment.scan_from_sparse, &model);
  if (alignment.adjusted) model = alignment.bundle.model;
  const PoseErrors worst = WorstPoseErrors(*one.room, model, Similarity());
  if (!alignment.reasons.empty()) {
    ++counts->untrusted;
    return;
  }
  ++counts->trusted;
  counts->wrong_and_trusted += worst.position > kWrong;
  counts->position_mm.push_back(1000 * worst.position);
  counts->rotation_deg.push_back(DegFromRad(worst.rotation));
  std::vector<Eigen::Vector3d> centres;
  for (const auto& [image_id, image] : model.images) {
    centres.push_back(image.cam_from_model.TargetOriginInSource());
  }
  counts->expected_mm.push_back(
      1000 * PropagateError(alignment.surface_fit, centres, one.scans).at_cameras);
}

void RunAll(int num_rooms) {
  std::printf(
      "| %d rooms | trusted | exit 4 | refused | wrong and trusted | worst camera, mm: median, "
      "largest | degrees | expected at the cameras, mm |\n|---|---|---|---|---|---|---|---|\n",
      num_rooms);
  for (const Row& row : kRows) {
    Counts counts;
    for (int seed = 0; seed < num_rooms; ++seed) Add(row.make(seed), &counts);
    std::printf("| %s | %d | %d | %d | %d | %.2f, %.2f | %.4f, %.4f | %.2f |\n", row.name,
                counts.trusted, counts.untrusted, counts.refused, counts.wrong_and_trusted,
                Quantile(counts.position_mm, 0.5), Quantile(counts.position_mm, 1),
                Quantile(counts.rotation_deg, 0.5), Quantile(counts.rotation_deg, 1),
                Quantile(counts.expected_mm, 0.5));
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  const int num_rooms = argc > 1 ? std::atoi(argv[1]) : 20;
  if (argc > 2 || num_rooms < 1) {
    std::fprintf(stderr, "align_accuracy [rooms]\n");
    return 2;
  }
  roomtex::RunAll(num_rooms);
}
