// What the choice of pairs costs against the number of photos, and what the comparison of all
// signatures takes of it, the one part that grows with the square:
//   build/bin/pairs_cost FOLDER 25 1600 3200 6400
// Made-up rooms with 25 photos of some 100 features each (1: every photo stands alone), with GPS;
// FOLDER/25_1600.db and so on are kept, for roomtex-pairs.

#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "colmap_ext/pair_selection.h"
#include "colmap_ext/photo_signature.h"
#include "core/random_stream.h"
#include "tests/colmap_ext/room_database.h"
#include "tests/support/cpu_seconds.h"

namespace roomtex {
namespace {

// Of photos whose signatures have nothing in common.
double SecondsOfSignatures(int num_photos) {
  RandomStream random(1);
  Eigen::MatrixXf signatures(256, num_photos);
  for (float& value : signatures.reshaped()) value = static_cast<float>(random.Gaussian());
  signatures.colwise().normalize();
  const double begin = CpuSeconds();
  MostSimilar(signatures, PairOptions().num_candidates, 1);
  return CpuSeconds() - begin;
}

void Measure(const std::string& folder, int num_views, int num_photos) {
  const std::string path =
      folder + "/" + std::to_string(num_views) + "_" + std::to_string(num_photos) + ".db";
  if (!std::filesystem::exists(path)) {
    RoomDatabaseOptions options;
    options.num_views = num_views;
    options.num_points = 160;
    for (int room = 0; room < num_photos / num_views; ++room) {
      options.rooms.push_back(std::to_string(room) + "_");
    }
    WriteRoomDatabase(path, options);
  }
  // Rooms in a row, a receiver that is metres off.
  RandomStream random(2);
  std::vector<PhotoHint> hints(static_cast<size_t>(num_photos));
  for (size_t i = 0; i < hints.size(); ++i) {
    const double room = static_cast<double>(i) / num_views;
    hints[i].place = {10 * room + 5 * random.Gaussian(), 5 * random.Gaussian()};
  }
  Progress progress(true);
  const double begin = CpuSeconds();
  const PairSelection selection =
      SelectPairs(Database(path), hints, PairOptions(), 1, 0, &progress);
  const double seconds = CpuSeconds() - begin;
  size_t num_listed = 0;
  for (const PairEdge& edge : selection.edges) num_listed += edge.listed;
  std::printf(
      "%6d photos %5d to a room: %8.2f CPU s, %5.1f pairs looked at and %5.1f listed a "
      "photo, %zu groups; signatures alone %7.2f s\n",
      num_photos, num_views, seconds, 1.0 * selection.num_checked / num_photos,
      static_cast<double>(num_listed) / num_photos, selection.groups.size(),
      SecondsOfSignatures(num_photos));
  std::fflush(stdout);
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  for (int i = 3; i < argc; ++i) roomtex::Measure(argv[1], std::atoi(argv[2]), std::atoi(argv[i]));
}
