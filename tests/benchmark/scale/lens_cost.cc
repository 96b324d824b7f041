// What it costs to check the lens of a model against its photos, and what is found, against the
// number of photos:
//   build/bin/lens_cost SEED 20 40 80
// A simulated room, 100 points for each photo and tracks as long as the room gives them: as long as
// COLMAP's would be if it lost none. A lens told right, and one told 1 % long.

#include <cstdio>
#include <cstdlib>

#include "capture/simulation/simulated_room.h"
#include "colmap_ext/calibration_check.h"
#include "colmap_ext/lens_check.h"
#include "tests/support/cpu_seconds.h"

namespace {

void Measure(int seed, int num_photos) {
  roomtex::SimulatedRoomOptions options;
  options.random_seed = seed;
  options.num_photos = num_photos;
  constexpr double kNoise = 0.7;  // pixels
  const roomtex::SparseModel truth =
      roomtex::SimulatedRoom(options).MakeSparseModel(100 * num_photos, kNoise);
  for (const double factor : {1.0, 1.01}) {
    roomtex::SparseModel model = truth;
    for (auto& [id, camera] : model.cameras) {
      camera.params[0] *= factor;
      camera.params[1] *= factor;
    }
    double begin = roomtex::CpuSeconds();
    model = roomtex::AdjustedByPhotos(model, kNoise);
    const double mapped = roomtex::CpuSeconds() - begin;
    begin = roomtex::CpuSeconds();
    const roomtex::LensCheck check =
        roomtex::CheckLenses(model, {}, roomtex::RefineIntrinsics::kAuto);
    const double seconds = roomtex::CpuSeconds() - begin;
    size_t observations = 0, thinned = 0;
    for (const auto& [id, point] : model.points) observations += point.track.size();
    for (const auto& [id, point] : roomtex::ThinnedModel(model, 150).points) {
      thinned += point.track.size();
    }
    std::printf("%4d photos  lens x %.2f  %6zu observations, %6zu thinned  adjusted once %6.2f s",
                num_photos, factor, observations, thinned, mapped);
    if (check.lenses.empty()) {
      std::printf("  no lens\n");
      continue;
    }
    const roomtex::LensFinding& lens = check.lenses[0];
    const double true_focal = truth.cameras.begin()->second.MeanFocalLength();
    std::printf(
        "  checked %6.2f s  focal length off by %+.2f px, sigma %.2f, %5.1f deviations, %s\n",
        seconds, lens.found.MeanFocalLength() - true_focal, lens.focal_sigma, lens.deviations,
        lens.used ? "changed" : "kept");
    std::fflush(stdout);
  }
}

}  // namespace

int main(int argc, char** argv) {
  for (int i = 2; i < argc; ++i) Measure(std::atoi(argv[1]), std::atoi(argv[i]));
}
