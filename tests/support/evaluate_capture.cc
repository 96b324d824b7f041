// roomtex-evaluate: how far results are from the truth of a simulated capture. Not installed.
//   poses: a COLMAP model in the scan frame (roomtex-align) against truth/images.txt
//   colour: a textured model.ply (roomtex-texture) against truth/true_colors.ply, vertex by vertex
// Prints JSON on stdout.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>

#include "colmap_ext/sparse_model.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/output_file.h"
#include "core/photo.h"
#include "tests/support/ply_vertices.h"

namespace roomtex {
namespace {

double Median(std::vector<double> values) {
  if (values.empty()) return std::nan("");
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}
double Max(const std::vector<double>& values) {
  return values.empty() ? std::nan("") : *std::max_element(values.begin(), values.end());
}

// fit: moves the model by the best similarity first, for a model that is not aligned.
Json ComparePoses(const SparseModel& truth, SparseModel model, bool fit) {
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
  json["position_median_mm"] = Median(position_mm);
  json["position_max_mm"] = Max(position_mm);
  json["rotation_median_deg"] = Median(rotation_deg);
  json["rotation_max_deg"] = Max(rotation_deg);
  json["worst_image"] = worst;
  return json;
}

// One gain for all channels and vertices in linear light: the colours' brightness is free, their
// balance is not. Median of the ratios, so that wrong vertices do not pull it.
double FindGain(const PlyVertices& truth, const PlyVertices& model,
                const std::vector<size_t>& colored) {
  const auto& linear = LinearFromSrgbByte();
  std::vector<double> ratios;
  for (const size_t i : colored) {
    double want = 0, have = 0;
    for (int k = 0; k < 3; ++k) {
      want += linear[truth.colors[i][k]];
      have += linear[model.colors[i][k]];
    }
    if (have > 0.05) ratios.push_back(want / have);
  }
  return ratios.empty() ? 1 : Median(ratios);
}

Json CompareColors(const PlyVertices& truth, const PlyVertices& model,
                   const std::string& model_path) {
  if (truth.points.size() != model.points.size()) {
    throw InputError(model_path, "",
                     "has " + std::to_string(model.points.size()) + " vertices, the truth has " +
                         std::to_string(truth.points.size()),
                     "Both must come from the same scan, in grid order");
  }
  if (model.colors.empty())
    throw InputError(model_path, "", "has no colours", "Expected red, green, blue per vertex");
  double farthest = 0;
  std::vector<size_t> colored;
  for (size_t i = 0; i < truth.points.size(); ++i) {
    farthest = std::max(farthest, static_cast<double>((truth.points[i] - model.points[i]).norm()));
    if (model.views.empty() || model.views[i] > 0) colored.push_back(i);
  }
  const double gain = FindGain(truth, model, colored);
  const auto& linear = LinearFromSrgbByte();
  double squares = 0, linear_squares = 0;
  size_t wrong = 0;
  std::vector<double> differences;
  for (const size_t i : colored) {
    double largest = 0;
    for (int k = 0; k < 3; ++k) {
      const double light = std::min(1.0, gain * linear[model.colors[i][k]]);
      const double difference = SrgbFromLinear(light) - truth.colors[i][k] / 255.0;
      squares += difference * difference;
      linear_squares += (light - linear[truth.colors[i][k]]) * (light - linear[truth.colors[i][k]]);
      largest = std::max(largest, std::abs(difference));
    }
    differences.push_back(largest);
    if (largest > 0.1) ++wrong;
  }
  const auto count = static_cast<double>(colored.size());
  Json json = Json::object();
  json["num_vertices"] = truth.points.size();
  json["num_colored"] = colored.size();
  json["coverage"] = truth.points.empty() ? 0 : count / static_cast<double>(truth.points.size());
  json["gain"] = gain;
  json["psnr_db"] = -10 * std::log10(squares / (3 * count));  // sRGB values, peak 1
  json["psnr_linear_db"] = -10 * std::log10(linear_squares / (3 * count));
  json["median_difference"] = Median(differences);  // largest channel, sRGB 0..1
  json["share_wrong"] = static_cast<double>(wrong) / count;
  json["vertex_distance_max_m"] = farthest;
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
  std::string truth_path, input_path, ply_path;
  bool fit = false;
  Command command("roomtex-evaluate", "Compares results with the truth of a simulated capture.",
                  "roomtex-evaluate --truth_path capture/truth --input_path aligned --ply_path "
                  "textured/model.ply");
  command.AddInputPath("truth_path", &truth_path, "truth/ of a simulated capture");
  command.AddInputPath("input_path", &input_path, "COLMAP model to compare the poses of",
                       Command::Kind::kOptional);
  command.AddInputPath("ply_path", &ply_path, "textured model.ply to compare the colours of",
                       Command::Kind::kOptional);
  command.AddBool("fit_similarity", &fit,
                  "move the model by the best similarity first: for one that is not aligned");
  return command.Run(argc, argv, [&](const Command::Context& context) {
    Json answer = Json::object();
    if (!input_path.empty()) {
      answer["poses"] = ComparePoses(ReadSparseModel(truth_path), ReadSparseModel(input_path), fit);
    }
    if (!ply_path.empty()) {
      answer["color"] = CompareColors(ReadPlyVertices(truth_path + "/true_colors.ply"),
                                      ReadPlyVertices(ply_path), ply_path);
    }
    for (const auto& [key, value] : answer.items()) context.report[key] = value;
    std::printf("%s\n", answer.dump(2).c_str());
  });
}
