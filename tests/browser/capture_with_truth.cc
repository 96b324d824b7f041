// browser_capture FOLDER: a small simulated capture for the tests of the pages, with what a user
// would not have: COLMAP's model of it without running COLMAP, and places.json, the places that
// one sees both in a photo and in the scan. No click noise: the test clicks where it wants.

#include <algorithm>
#include <cstdio>
#include <exception>
#include <fstream>
#include <limits>
#include <set>
#include <string>

#include <nlohmann/json.hpp>

#include "capture/simulation/capture_writer.h"
#include "capture/simulation/simulated_room.h"
#include "colmap_ext/sparse_model.h"
#include "importers/scan_writer.h"
#include "tests/align/model_part.h"

namespace roomtex {
namespace {

// The column and row of the sample that lies nearest to a point of the scan.
Eigen::Vector2i FindSample(const Scan& scan, const Eigen::Vector3d& x_in_scan) {
  Eigen::Vector2i best(0, 0);
  double best_distance = std::numeric_limits<double>::infinity();
  for (int row = 0; row < scan.num_rows; ++row) {
    for (int column = 0; column < scan.num_columns; ++column) {
      const Eigen::Vector3d sample = scan.points[scan.Index(column, row)];
      const double distance = (sample - x_in_scan).norm();
      if (distance < best_distance) {
        best_distance = distance;
        best = {column, row};
      }
    }
  }
  return best;
}

nlohmann::json Places(const SimulatedRoom& room, const Scan& scan, int photo, int count) {
  nlohmann::json places = nlohmann::json::array();
  for (const SimulatedPick& pick : room.MakePicks(photo, count)) {
    const Eigen::Vector2i sample = FindSample(scan, pick.x_in_scan);
    places.push_back({{"image_name", pick.image_name},
                      {"img", {pick.x_in_img.x(), pick.x_in_img.y()}},
                      {"scan", {sample.x() + 0.5, sample.y() + 0.5}},
                      {"point", {pick.x_in_scan.x(), pick.x_in_scan.y(), pick.x_in_scan.z()}}});
  }
  return places;
}

void WriteAll(const std::string& folder) {
  SimulatedRoomOptions options;
  options.shading = true;
  options.num_photos = 12;
  options.photo_width = 960;
  options.photo_height = 640;
  options.scan_columns = 800;
  options.scan_rows = 400;
  options.num_stations = 2;  // all but one test take the first scan alone
  options.click_noise_px = 0;
  const SimulatedRoom room(options);
  Progress progress(/*quiet=*/true);
  WriteCapture(room, folder + "/capture", &progress);
  const SparseModel model = room.MakeSparseModel(2500, 0.5);
  WriteSparseModel(model, folder + "/sparse");
  const Scan scan = room.MakeScan(0);
  // Without anything that photos could confirm: the search stays undecided.
  Scan blank = scan;
  std::fill(blank.intensity.begin(), blank.intensity.end(), 100.0f);
  WriteScan(blank, {}, folder + "/blank.rtpi");
  const int best = room.BestPhotoForPicks();
  nlohmann::json places;
  places["photo"] = room.PhotoName(best);
  places["places"] = Places(room, scan, best, 16);
  const int other = (best + 1) % room.NumPhotos();
  places["other_photo"] = room.PhotoName(other);
  places["other_places"] = Places(room, scan, other, 16);
  // The same photos as two models, as if nothing connected them: the half that begins with the
  // other photo, and the half that ends with the best one.
  std::set<std::string> names;
  for (int i = 0; i < room.NumPhotos() / 2; ++i) {
    names.insert(room.PhotoName((other + i) % room.NumPhotos()));
  }
  const auto in_second = [&](uint32_t id) { return names.count(model.images.at(id).name) > 0; };
  WriteSparseModel(PartOf(model, [&](uint32_t id) { return !in_second(id); }), folder + "/first");
  SparseModel second = PartOf(model, in_second);
  Similarity elsewhere;
  elsewhere.scale = 0.25;
  elsewhere.translation = {3, -2, 1};
  TransformModel(elsewhere, &second);
  WriteSparseModel(second, folder + "/second");
  std::ofstream(folder + "/places.json") << places.dump(1) << "\n";
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "Say: browser_capture FOLDER\n");
    return 2;
  }
  try {
    roomtex::WriteAll(argv[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
