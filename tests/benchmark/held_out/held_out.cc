// held_out: how well a scan coloured from some photos predicts the others. Photos are held out, the
// rest colours the scan once per method (options of roomtex-texture), and the model is looked at
// from the poses of those held out. Prints a Markdown table. See README.md.

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <set>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sys/resource.h>

#include "colmap_ext/sparse_model.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/output_file.h"
#include "core/photo.h"
#include "core/random_stream.h"
#include "core/report.h"
#include "core/twist.h"
#include "tests/benchmark/held_out/held_out_score.h"
#include "tests/benchmark/held_out/picture_sheet.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

struct HeldOutOptions {
  std::string input_path, image_path, scan_path, hold_out, methods_path, pictures_path, sheet_path;
  bool one_by_one = false, refine_pose = true;
  double turn_deg = 0, move = 0;
  int num_places = 6;
};

std::vector<std::string> SplitAt(const std::string& text, char separator) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == separator) {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

// Photos whose name holds one of the words; every photo for "all".
std::vector<std::string> ChooseNames(const SparseModel& model, const std::string& hold_out) {
  std::set<std::string> names;
  for (const auto& [id, image] : model.images) {
    for (const std::string& word : SplitAt(hold_out, ',')) {
      if (word == "all" || (!word.empty() && image.name.find(word) != std::string::npos)) {
        names.insert(image.name);
      }
    }
  }
  if (names.empty()) throw UsageError("--hold_out names no photo of the model");
  return {names.begin(), names.end()};
}

// Every photo turned and moved at random: poses as bad as one likes.
void DisturbPoses(const HeldOutOptions& options, int seed, SparseModel* model) {
  if (options.turn_deg == 0 && options.move == 0) return;
  for (auto& [id, image] : model->images) {
    RandomStream random(MixBits(static_cast<uint64_t>(seed), 0x4845u, id));
    Rigid step;
    Eigen::Vector3d turn, shift;
    for (int k = 0; k < 3; ++k) turn[k] = RadFromDeg(options.turn_deg) * random.Gaussian();
    for (int k = 0; k < 3; ++k) shift[k] = options.move * random.Gaussian();
    step.rotation = RotationFromVector(turn);
    step.translation = shift;
    image.cam_from_model = step * image.cam_from_model;
  }
}

// The model without some photos; it still remembers its scans.
void WriteModelWithout(const SparseModel& model, const std::set<std::string>& left_out,
                       const std::string& input_path, const std::string& folder) {
  SparseModel rest = model;
  rest.points.clear();
  for (auto image = rest.images.begin(); image != rest.images.end();) {
    image->second.points2d.clear();
    image->second.point3d_ids.clear();
    image = left_out.count(image->second.name) > 0 ? rest.images.erase(image) : std::next(image);
  }
  WriteSparseModel(rest, folder);
  const std::string record = input_path + "/alignment.json";
  if (std::filesystem::exists(record)) {
    std::filesystem::copy_file(record, folder + "/alignment.json");
  }
}

// Of all programs that were started and have ended.
double SecondsOfChildren() {
  rusage usage{};
  getrusage(RUSAGE_CHILDREN, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

// A line of the file of methods.
struct Method {
  std::string name;
  std::string program;  // empty = roomtex-texture
  std::string options;
};

// "NAME: OPTIONS of roomtex-texture", or "NAME! PROGRAM OPTIONS".
Method ReadMethod(const std::string& line) {
  const size_t end = line.find_first_of(":!");
  Method method;
  method.name = line.substr(0, end);
  if (end == std::string::npos) return method;
  (line[end] == '!' ? method.program : method.options) = line.substr(end + 1);
  return method;
}

class HeldOutTable {
 public:
  HeldOutTable(const HeldOutOptions& options, const SparseModel& model,
               const Command::Context& context)
      : options_(options), model_(model), context_(context) {}

  void AddMethod(const Method& method, const std::vector<std::string>& names) {
    Json photos = Json::array();
    double cpu = 0;
    std::vector<std::vector<std::string>> groups;
    for (const std::string& photo : names) {
      if (groups.empty() || options_.one_by_one) groups.emplace_back();
      groups.back().push_back(photo);
    }
    for (const auto& group : groups) cpu += AddGroup(method, group, &photos);
    PrintRow(method.name, photos, cpu);
    Json entry = {{"name", method.name},
                  {"options", method.program + method.options},
                  {"cpu_seconds", cpu},
                  {"photos", photos}};
    context_.report["methods"].push_back(entry);
  }

  void WriteSheet() const {
    if (options_.sheet_path.empty()) return;
    const cv::Mat3b sheet = sheet_.Draw(options_.num_places);
    if (sheet.empty() || !cv::imwrite(options_.sheet_path, sheet)) {
      throw InputError(options_.sheet_path, "", "cannot be written, or nothing was predicted",
                       "Name a PNG in a folder that exists");
    }
  }

 private:
  // Returns the CPU seconds of the program that colours.
  double AddGroup(const Method& method, const std::vector<std::string>& group, Json* photos) {
    const TempFolder folder;
    WriteModelWithout(model_, {group.begin(), group.end()}, options_.input_path, folder / "model");
    const bool is_ours = method.program.empty();
    const std::string output = folder / "textured";
    std::string line = is_ours ? "roomtex-texture --quiet --output_evidence 0" : method.program;
    line += " --input_path '" + (folder / "model") + "' --image_path '" + options_.image_path +
            "' --output_path '" + output + "' " + method.options;
    if (!options_.scan_path.empty()) line += " --scan_path '" + options_.scan_path + "'";
    const double before = SecondsOfChildren();
    const CommandResult run = is_ours ? RunCommandLine(line) : RunProgram(line);
    const double cpu = SecondsOfChildren() - before;
    if (run.exit_code != 0 && !(is_ours && run.exit_code == kExitUntrusted)) {
      throw std::runtime_error(method.name + " failed: " + run.err);
    }
    const ColoredMesh mesh =
        is_ours ? ReadTexturedMesh(output + "/model.glb") : ReadColoredMesh(output + "/model.ply");
    const PhotoPredictor predictor(mesh, context_.options.num_threads);
    for (const std::string& photo : group) photos->push_back(Judge(method.name, photo, predictor));
    return cpu;
  }

  Json Judge(const std::string& method, const std::string& name, const PhotoPredictor& predictor) {
    const SparseImage& image = *model_.FindImage(name);
    const Camera& camera = model_.cameras.at(image.camera_id);
    const cv::Mat photo = ReadPhoto(options_.image_path + "/" + name);
    Rigid pose = image.cam_from_model;
    if (options_.refine_pose) pose = predictor.RefinePose(camera, pose, photo);
    const Prediction prediction = predictor.Predict(camera, pose);
    const HeldOutScore score = ScorePrediction(prediction, photo);
    if (!options_.sheet_path.empty()) sheet_.Add(method, name, photo, prediction);
    if (!options_.pictures_path.empty()) WritePictures(method, name, photo, prediction.picture);
    const Rigid moved = pose * image.cam_from_model.Inverse();
    return {{"name", name},
            {"psnr", score.psnr},
            {"gradient_energy", score.gradient_energy},
            {"detail_correlation", score.detail_correlation},
            {"share_seen", score.share_seen},
            {"moved_mm", 1000 * moved.TargetOriginInSource().norm()},
            {"turned_deg", DegFromRad(RotationAngle(moved.rotation, Rigid().rotation))}};
  }

  void WritePictures(const std::string& method, const std::string& name, const cv::Mat& photo,
                     const cv::Mat& picture) const {
    const std::string stem = std::filesystem::path(name).stem().string();
    MakeFolder(options_.pictures_path);
    cv::Mat difference, strip;
    cv::absdiff(photo, picture, difference);
    cv::hconcat(std::vector<cv::Mat>{photo, picture, 2 * difference}, strip);
    cv::imwrite(options_.pictures_path + "/" + stem + "-" + method + ".png", strip);
  }

  void PrintRow(const std::string& name, const Json& photos, double cpu) {
    if (is_first_) {
      std::string head = "| |", line = "|---|";
      for (const Json& photo : photos) {
        head +=
            " " + std::filesystem::path(photo["name"].get<std::string>()).stem().string() + " |";
        line += "---|";
      }
      std::printf("%s mean dB | gradient energy | detail corr. | CPU s |\n%s---|---|---|---|\n",
                  head.c_str(), line.c_str());
      is_first_ = false;
    }
    std::printf("| %s |", name.c_str());
    double psnr = 0, energy = 0, correlation = 0;
    for (const Json& photo : photos) {
      std::printf(" %.2f |", photo["psnr"].get<double>());
      psnr += photo["psnr"].get<double>();
      energy += photo["gradient_energy"].get<double>();
      correlation += photo["detail_correlation"].get<double>();
    }
    const auto count = static_cast<double>(photos.size());
    std::printf(" %.2f | %.2f | %.3f | %.1f |\n", psnr / count, energy / count, correlation / count,
                cpu);
    std::fflush(stdout);
  }

  const HeldOutOptions& options_;
  const SparseModel& model_;
  const Command::Context& context_;
  PictureSheet sheet_;
  bool is_first_ = true;
};

const char kThesis[] =
    "thesis: --Registration.mode none --Occlusion.depth_tolerance 0.008 --Occlusion.shadows 0 "
    "--Blend.angle_weight 0 "
    "--Blend.resolution_weight 0 --Blend.sharpness_weight 0 --Blend.outlier 0 --Blend.detail 1 "
    "--Surface.reduce_range_noise 0 "
    "--Exposure.mode exif";

std::vector<std::string> ReadMethods(const std::string& path) {
  if (path.empty()) return {"default", kThesis};
  std::vector<std::string> methods;
  std::ifstream stream(path);
  for (std::string line; std::getline(stream, line);) {
    if (!line.empty() && line[0] != '#') methods.push_back(line);
  }
  return methods;
}

void HoldOut(const HeldOutOptions& options, const Command::Context& context) {
  const std::vector<std::string> methods = ReadMethods(options.methods_path);
  SparseModel model = ReadSparseModel(options.input_path);
  const std::vector<std::string> names = ChooseNames(model, options.hold_out);
  if (names.size() >= model.images.size() && !options.one_by_one) {
    throw UsageError("no photo is left to colour from; give --one_by_one 1");
  }
  DisturbPoses(options, context.options.random_seed, &model);
  context.report["methods"] = Json::array();
  context.progress.Stage("methods", static_cast<int>(methods.size()));
  HeldOutTable table(options, model, context);
  for (const std::string& method : methods) {
    table.AddMethod(ReadMethod(method), names);
    context.progress.Tick();
  }
  table.WriteSheet();
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  using namespace roomtex;
  HeldOutOptions o;
  Command command("held_out", "How well a scan coloured from some photos predicts the others.",
                  "held_out --input_path aligned --image_path images --hold_out 209,494,903,618");
  command.AddInputPath("input_path", &o.input_path, "COLMAP model in the scan frame");
  command.AddInputPath("image_path", &o.image_path, "folder of the photos");
  command.AddInputPath("scan_path", &o.scan_path, "the scan; an aligned model remembers its own",
                       Command::Kind::kOptional);
  command.AddString("hold_out", &o.hold_out,
                    "photos to hold out: parts of their names, by commas, or all");
  command.AddBool("one_by_one", &o.one_by_one, "hold out one at a time, not all of them at once");
  command.AddBool("refine_pose", &o.refine_pose,
                  "fit the pose of what is held out to the prediction before it is judged");
  command.AddInputPath(
      "methods_path", &o.methods_path,
      "text file, a method a line: its name, a colon, options of roomtex-texture; or "
      "its name, an exclamation mark, a program that colours (README.md); "
      "none = default and thesis",
      Command::Kind::kOptional);
  command.AddDouble("turn_deg", &o.turn_deg,
                    "turns every pose at random, standard deviation of each axis, degrees");
  command.AddDouble("move", &o.move,
                    "moves every pose at random, standard deviation of each axis, metres");
  command.AddOutputPath("pictures_path", &o.pictures_path,
                        "folder for pictures to look at: photo, prediction, twice their difference",
                        Command::Kind::kOptional);
  command.AddOutputPath("sheet_path", &o.sheet_path,
                        "a PNG to look at: the places of the photos that hold the most detail, and "
                        "what each method predicts there",
                        Command::Kind::kOptional);
  command.AddInt("num_places", &o.num_places, "places of the sheet");
  return command.Run(argc, argv, [&o](const Command::Context& context) { HoldOut(o, context); });
}
