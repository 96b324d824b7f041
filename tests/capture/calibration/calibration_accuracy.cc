// How exact calibrations are: the table of docs/calibration.md.
//   calibration_accuracy SETS corners    from projected corners with 0.03 px noise
//   calibration_accuracy SETS rendered   from rendered pictures

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>

#include "capture/calibration/calibration.h"
#include "capture/calibration/calibration_uncertainty.h"
#include "tests/capture/calibration/calibration_boards.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

struct Totals {
  std::map<std::string, int> models;
  double sum_of_squares = 0, largest = 0;  // errors of parameters over standard deviations
  int num_params = 0;
  double worst_covered_px = 0, corner_px2 = 0, stated_px2 = 0;
};

std::vector<BoardPhoto> Photos(const Camera& truth, const Board& board, bool rendered, int seed) {
  BoardSetOptions set;
  set.seed = static_cast<uint64_t>(seed);
  const std::vector<Rigid> poses = MakeBoardPoses(truth, board, set);
  if (!rendered) return ObserveBoards(truth, board, poses, 0.03, set.seed);
  const TempFolder folder;
  BoardPhotoOptions options;
  options.seed = set.seed;
  const std::vector<std::string> names =
      WriteBoardPhotos(folder.path(), truth, board, poses, options);
  Progress progress(true);
  return FindBoards(folder.path(), names, board, -1, &progress);
}

void Add(const Camera& truth, const Calibration& found, Totals* totals) {
  ++totals->models[found.lens.Name()];
  const Camera expected = truth.params.size() <= found.camera.params.size()
                              ? InRicherModel(truth, found.camera.model)
                              : truth;
  const Eigen::Matrix2Xd corners = PictureCorners(truth.width, truth.height);
  totals->corner_px2 += MappingDifference(expected, found.camera, corners).squaredNorm() / 4;
  totals->stated_px2 += found.corner_sigma_px * found.corner_sigma_px;
  Eigen::Matrix2Xd covered(2, 0);
  for (const CalibratedPhoto& photo : found.photos) {
    Eigen::Matrix2Xd more(2, covered.cols() + photo.x_in_img.cols());
    more << covered, photo.x_in_img;
    covered = more;
  }
  const Eigen::Matrix2Xd off = MappingDifference(expected, found.camera, covered, covered);
  totals->worst_covered_px = std::max(totals->worst_covered_px, off.colwise().norm().maxCoeff());
  if (found.camera.model != truth.model) return;
  for (int i = 0; i < std::min(found.lens.num_free, 9); ++i) {
    const double error = (found.camera.params[i] - truth.params[i]) / found.params_sigma[i];
    totals->sum_of_squares += error * error;
    totals->largest = std::max(totals->largest, std::abs(error));
    ++totals->num_params;
  }
}

void PrintRow(CameraModel lens, int num_sets, bool rendered) {
  const Camera truth = LensThatCallsFor(lens, rendered ? 800 : 1500, rendered ? 534 : 1000);
  const Board board = Checkerboard(9, 6);
  Totals totals;
  for (int seed = 1; seed <= num_sets; ++seed) {
    Add(truth, Calibrate(Photos(truth, board, rendered, seed), board, {}, "boards"), &totals);
  }
  std::string models;
  for (const auto& [name, count] : totals.models) {
    models += (models.empty() ? "" : "; ") + name + ", " + std::to_string(count) + " of " +
              std::to_string(num_sets);
  }
  std::printf("| %s, %s | %s | %.2f (at most %.2f) | %.3f px | %.3f px | %.3f px |\n",
              rendered ? "rendered" : "corners", CameraModelName(lens), models.c_str(),
              std::sqrt(totals.sum_of_squares / std::max(totals.num_params, 1)), totals.largest,
              totals.worst_covered_px, std::sqrt(totals.corner_px2 / num_sets),
              std::sqrt(totals.stated_px2 / num_sets));
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  const int num_sets = argc > 1 ? std::atoi(argv[1]) : 5;
  const bool rendered = argc > 2 && std::string(argv[2]) == "rendered";
  for (const roomtex::CameraModel lens :
       {roomtex::CameraModel::kSimpleRadial, roomtex::CameraModel::kRadial,
        roomtex::CameraModel::kOpenCv, roomtex::CameraModel::kFullOpenCv}) {
    roomtex::PrintRow(lens, num_sets, rendered);
  }
}
