// What roomtex-dense finds of that which one station missed, on a simulated room with and without
// projected pattern, beside OpenCV's StereoSGBM on rectified pairs. Not installed.
//   build/bin/dense_benchmark --output_path FOLDER [--num_photos 30 --photo_width 1936 ...]

#include <cstdio>
#include <ctime>
#include <set>
#include <sstream>

#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sys/resource.h>

#include "capture/pattern/pattern.h"
#include "capture/simulation/capture_writer.h"
#include "colmap_ext/sparse_model.h"
#include "core/command_line.h"
#include "core/option_fields.h"
#include "dense/scan_space.h"
#include "dense/stereo_views.h"
#include "dense/supplement.h"
#include "importers/scan_reader.h"
#include "tests/dense/dense_truth.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

// Pairs of a photo and its best neighbour; what is no new place by the rules of roomtex-dense is
// left out.
std::vector<Eigen::Vector3d> MatchPairs(const std::string& dense_folder, const ScanSpace& space,
                                        bool only_new) {
  const SparseModel model = ReadSparseModel(dense_folder + "/sparse");
  std::vector<StereoView> views;
  for (const auto& [id, image] : model.images) {
    views.push_back({image.name, model.cameras.at(image.camera_id), image.cam_from_model, {}});
  }
  FindNeighbours(space, 1, &views);
  const double margin = SupplementOptions().distance_to_scan;
  std::vector<Eigen::Vector3d> points;
  for (const StereoView& view : views) {
    if (view.neighbours.empty()) continue;
    const StereoView& other = views[view.neighbours[0]];
    const auto matrix = [](const Camera& camera) {
      const std::vector<double>& p = camera.params;
      return cv::Matx33d(p[0], 0, p[2] - 0.5, 0, p[1], p[3] - 0.5, 0, 0, 1);
    };
    const Rigid other_from_view = other.cam_from_scan * view.cam_from_scan.Inverse();
    cv::Mat rotation, translation, r1, r2, p1, p2, q;
    cv::eigen2cv(Eigen::Matrix3d(other_from_view.rotation.toRotationMatrix()), rotation);
    cv::eigen2cv(other_from_view.translation, translation);
    const cv::Size size(view.camera.width, view.camera.height);
    cv::stereoRectify(matrix(view.camera), cv::noArray(), matrix(other.camera), cv::noArray(), size,
                      rotation, translation, r1, r2, p1, p2, q, cv::CALIB_ZERO_DISPARITY, 0);
    // Pairs that lie above each other, or are swapped, are turned away by their baseline.
    if (!(p2.at<double>(0, 3) < 0) || std::abs(p2.at<double>(1, 3)) > 0) continue;
    const auto rectified = [&](const StereoView& photo, const cv::Mat& r, const cv::Mat& p) {
      const cv::Mat grey = cv::imread(dense_folder + "/images/" + photo.name, cv::IMREAD_GRAYSCALE);
      cv::Mat map_x, map_y, result;
      cv::initUndistortRectifyMap(matrix(photo.camera), cv::noArray(), r, p, size, CV_32FC1, map_x,
                                  map_y);
      cv::remap(grey, result, map_x, map_y, cv::INTER_LINEAR);
      return result;
    };
    const cv::Mat left = rectified(view, r1, p1), right = rectified(other, r2, p2);
    const int num_disparities = (size.width / 3 + 15) / 16 * 16;
    constexpr int kBlock = 5;
    const auto matcher = cv::StereoSGBM::create(0, num_disparities, kBlock, 8 * kBlock * kBlock,
                                                32 * kBlock * kBlock, 1, 0, 10, 100, 2,
                                                cv::StereoSGBM::MODE_SGBM_3WAY);
    cv::Mat disparity, places;
    matcher->compute(left, right, disparity);
    disparity.convertTo(disparity, CV_32F, 1 / 16.0);
    cv::reprojectImageTo3D(disparity, places, q);
    Eigen::Matrix3d turned;
    cv::cv2eigen(r1, turned);
    const Rigid scan_from_cam = view.cam_from_scan.Inverse();
    for (int y = 0; y < size.height; y += 2) {
      for (int x = 0; x < size.width; x += 2) {
        if (!(disparity.at<float>(y, x) > 0)) continue;
        const auto& p = places.at<cv::Vec3f>(y, x);
        const Eigen::Vector3d in_cam = turned.transpose() * Eigen::Vector3d(p[0], p[1], p[2]);
        const Eigen::Vector3d place = scan_from_cam * in_cam;
        if (!place.allFinite()) continue;
        const bool is_new = space.IsInRoom(place, 0.1) && !space.IsSeenEmpty(place, margin) &&
                            !space.surface().DistanceTo(place, margin);
        if (only_new && !is_new) continue;
        points.push_back(place);
      }
    }
  }
  return points;
}

void PrintRow(const char* room, const char* method, const DenseScore& score, double seconds) {
  std::printf("| %s | %s | %zu | %.1f %% | %.1f %% | %.1f %% | %.1f %% | %.1f %% | %.0f |\n", room,
              method, score.num_points, 100 * score.accurate_5mm, 100 * score.accurate_20mm,
              100 * score.complete_5mm, 100 * score.complete_20mm, 100 * score.in_free_space,
              seconds);
  std::fflush(stdout);
}

double SecondsOfChildren() {
  rusage usage;
  getrusage(RUSAGE_CHILDREN, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

void Measure(const std::string& name, const SimulatedRoomOptions& options,
             const std::string& output_path, const std::string& more) {
  const SimulatedRoom room(options);
  const std::string folder = output_path + "/" + name;
  Progress progress(true);
  WriteCapture(room, folder, &progress);
  // As a user gives them: the photos of the pattern, without their plain twins.
  SparseModel model = ReadSparseModel(folder + "/truth");
  if (!room.Projectors().empty()) {
    std::set<std::string> patterned;
    for (int i = 0; i < room.NumPhotos(); ++i) {
      if (room.IsPatterned(i)) patterned.insert(room.PhotoName(i));
    }
    for (auto it = model.images.begin(); it != model.images.end();) {
      it = patterned.count(it->second.name) > 0 ? std::next(it) : model.images.erase(it);
    }
  }
  model.points.clear();
  for (auto& [id, image] : model.images) image.points2d.clear(), image.point3d_ids.clear();
  WriteSparseModel(model, folder + "/model");
  const double before = SecondsOfChildren();
  const CommandResult result = RunCommandLine(
      "roomtex-dense --quiet --input_path " + folder + "/model --image_path " + folder +
      "/photos --scan_path " + folder + "/scan.rtpi --output_path " + folder + "/dense " + more);
  const double seconds = SecondsOfChildren() - before;
  if (result.exit_code != 0) std::fprintf(stderr, "%s\n", result.err.c_str());
  const DenseTruth truth(room, 4);
  const auto report = nlohmann::json::parse(ReadBytes(folder + "/dense/report.json"));
  std::vector<Eigen::Vector3d> found;
  if (report["num_vertices"] > 0) found = ReadScan(folder + "/dense/supplement.ply", {}).points;
  PrintRow(name.c_str(), "roomtex-dense", truth.Score(found), seconds);
  const std::clock_t start = std::clock();
  const ScanSpace space(ReadScans({folder + "/scan.rtpi"}, "", {}), 1);
  const DenseScore score = truth.Score(MatchPairs(folder + "/dense", space, true));
  PrintRow(name.c_str(), "StereoSGBM", score,
           static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
  // Whether the pairs are matched at all: accuracy of everything, what the scan has included.
  PrintRow(name.c_str(), "StereoSGBM, all",
           truth.Score(MatchPairs(folder + "/dense", space, false)), 0);
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  std::string output_path, more, rooms = "furnished,furnished_pattern,bare_pattern,bare";
  roomtex::SimulatedRoomOptions options;
  options.num_photos = 16;
  options.photo_width = 800;
  options.photo_height = 532;
  options.scan_columns = 1400;
  options.scan_rows = 530;
  roomtex::Command command("dense_benchmark", "roomtex-dense against the truth and StereoSGBM.",
                           "dense_benchmark --output_path out");
  command.AddOutputPath("output_path", &output_path, "folder for captures and results");
  command.AddString("more", &more, "further options of roomtex-dense");
  command.AddString("rooms", &rooms, "which ones, by comma");
  command.Add(roomtex::FieldsOf(&options));
  return command.Run(argc, argv, [&](const roomtex::Command::Context& context) {
    options.random_seed = context.options.random_seed;
    std::printf(
        "| room | method | points | accurate 5 mm | 20 mm | complete 5 mm | 20 mm | "
        "in free space | CPU-s |\n|---|---|---|---|---|---|---|---|---|\n");
    const roomtex::SimulatedRoomOptions furnished = options;
    std::istringstream list(rooms);
    for (std::string room; std::getline(list, room, ',');) {
      options = furnished;
      options.bare = room.find("bare") == 0;
      if (room.find("pattern") != std::string::npos) {
        options.projectors = 2;
        options.pattern = [](int width, int height, int seed) {
          roomtex::PatternOptions pattern;
          pattern.width = width;
          pattern.height = height;
          pattern.random_seed = seed;
          return roomtex::MakePattern(pattern);
        };
      }
      roomtex::Measure(room, options, output_path, more);
    }
  });
}
