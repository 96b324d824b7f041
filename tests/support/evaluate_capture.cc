// roomtex-evaluate: how far results are from the truth of a simulated capture. Not installed.
//   poses: a COLMAP model in the scan frame (roomtex-align) against truth/images.txt
//   colour: a textured model.ply (roomtex-texture) against truth/true_colors.ply, vertex by vertex:
//           the colour at the points, and averaged over the samples' cells; color_comparison.h says
//           what the measures mean
// Prints JSON on stdout.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>

#include "colmap_ext/sparse_model.h"
#include "core/command_line.h"
#include "core/commit_together.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/output_file.h"
#include "core/statistics.h"
#include "importers/scan_reader.h"
#include "tests/support/color_comparison.h"
#include "tests/support/ply_vertices.h"

namespace roomtex {
namespace {

double Max(const std::vector<double>& values) {
  return values.empty() ? std::nan("") : *std::max_element(values.begin(), values.end());
}

// fit: moves the model by the best similarity first, for a model that is not aligned.
Json ComparePoses(const SparseModel& truth, SparseModel model, const std::string& input_path,
                  bool fit) {
  const bool meet = std::any_of(model.images.begin(), model.images.end(), [&](const auto& image) {
    return truth.FindImage(image.second.name) != nullptr;
  });
  if (!meet) {
    throw InputError(input_path, "", "has no photo of the truth, so nothing can be compared",
                     "Give the model and the truth of one capture");
  }
  if (fit) {
    std::vector<Eigen::Vector3d> from, to;
    for (const auto& [id, image] : model.images) {
      const SparseImage* const other = truth.FindImage(image.name);
      if (other == nullptr) continue;
      from.push_back(image.cam_from_model.TargetOriginInSource());
      to.push_back(other->cam_from_model.TargetOriginInSource());
    }
    Eigen::Matrix3Xd source(3, from.size()), target(3, to.size());
    for (size_t i = 0; i < from.size(); ++i) {
      source.col(i) = from[i];
      target.col(i) = to[i];
    }
    TransformModel(FitSimilarity(source, target), &model);
  }
  std::vector<double> position_mm, rotation_deg;
  Json worst = nullptr;
  for (const auto& [id, image] : model.images) {
    const SparseImage* const other = truth.FindImage(image.name);
    if (other == nullptr) continue;
    const double distance = 1000 * (image.cam_from_model.TargetOriginInSource() -
                                    other->cam_from_model.TargetOriginInSource())
                                       .norm();
    if (position_mm.empty() || distance > Max(position_mm)) worst = image.name;
    position_mm.push_back(distance);
    rotation_deg.push_back(
        DegFromRad(RotationAngle(image.cam_from_model.rotation, other->cam_from_model.rotation)));
  }
  Json json = Json::object();
  json["num_images"] = truth.images.size();
  json["num_registered"] = position_mm.size();
  json["position_median_mm"] = Median(position_mm, std::nan(""));
  json["position_max_mm"] = Max(position_mm);
  json["rotation_median_deg"] = Median(rotation_deg, std::nan(""));
  json["rotation_max_deg"] = Max(rotation_deg);
  json["worst_image"] = worst;
  return json;
}

PlyVertices ReadPlyVertices(const std::string& path) {
  RequireFile(path, "Give the file that roomtex-texture or roomtex-simulate wrote");
  std::ifstream stream(path, std::ios::binary);
  return ParsePlyVertices(
      {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()}, path);
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  using namespace roomtex;
  std::string truth_path, input_path, ply_path, error_path;
  std::vector<std::string> scan_paths;
  bool fit = false;
  Command command("roomtex-evaluate", "Compares results with the truth of a simulated capture.",
                  "roomtex-evaluate --truth_path capture/truth --input_path aligned --ply_path "
                  "textured/model.ply");
  command.AddInputPath("truth_path", &truth_path, "truth/ of a simulated capture");
  command.AddInputPath("input_path", &input_path, "COLMAP model to compare the poses of",
                       Command::Kind::kOptional);
  command.AddInputPath("ply_path", &ply_path, "textured model.ply to compare the colours of",
                       Command::Kind::kOptional);
  command.AddInputPaths("scan_path", &scan_paths,
                        "scans of the capture, for what needs their grid: edges, detail, low "
                        "frequencies.",
                        Command::Kind::kOptional);
  command.AddOutputPath("error_path", &error_path,
                        "PNG with the colour error per sample of the first scan, white = 0.2",
                        Command::Kind::kOptional);
  command.AddBool("fit_similarity", &fit,
                  "move the model by the best similarity first: for one that is not aligned");
  return command.Run(argc, argv, [&](const Command::Context& context) {
    CommitFilesAtEnd();
    if (input_path.empty() && ply_path.empty()) {
      throw UsageError("give --input_path or --ply_path: what is to be compared with the truth?");
    }
    if (ply_path.empty() && !(scan_paths.empty() && error_path.empty())) {
      throw UsageError("--scan_path and --error_path are about colours: give --ply_path");
    }
    if (scan_paths.empty() && !error_path.empty()) {
      throw UsageError("--error_path is a picture in the grid of a scan: give --scan_path");
    }
    Json answer = Json::object();
    if (!input_path.empty()) {
      answer["poses"] =
          ComparePoses(ReadSparseModel(truth_path), ReadSparseModel(input_path), input_path, fit);
    }
    if (!ply_path.empty()) {
      const PlyVertices truth = ReadPlyVertices(truth_path + "/true_colors.ply");
      const PlyVertices model = ReadPlyVertices(ply_path);
      std::vector<Scan> scans;
      for (const std::string& path : scan_paths) scans.push_back(ReadScanFile(path, {}).scans[0]);
      answer["color"] = CompareColors(truth, model, scans, false, ply_path, error_path);
      if (!truth.cell_colors.empty()) {
        answer["color_of_cells"] = CompareColors(truth, model, scans, true, ply_path, "");
      }
    }
    for (const auto& [key, value] : answer.items()) context.report[key] = value;
    std::printf("%s\n", answer.dump(2).c_str());
  });
}
