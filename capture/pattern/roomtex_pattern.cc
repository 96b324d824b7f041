// roomtex-pattern: the pattern that projectors throw onto bare walls.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include <opencv2/imgcodecs.hpp>

#include "capture/pattern/pattern.h"
#include "capture/pattern/pattern_photo.h"
#include "capture/pattern/pattern_quality.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/parallel.h"
#include "core/photo.h"
#include "core/resource_limits.h"
#include "core/standard_files.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr int kLeastPhoto = 200;  // pixels of the shorter side of a photo to make a pattern of

struct Arguments {
  std::string output_path, input_path, evaluate_path;
  PatternOptions pattern;
};

double Rounded(double value) { return std::round(1e4 * value) / 1e4; }

cv::Mat ReadDetailedPhoto(const Arguments& arguments, const Command::Context& context) {
  RequireFile(arguments.input_path, "Check --input_path, or leave it out for the built-in image");
  const cv::Mat photo = ReadPhoto(arguments.input_path);
  const std::string size = std::to_string(photo.cols) + " x " + std::to_string(photo.rows);
  if (std::min(photo.cols, photo.rows) < kLeastPhoto) {
    throw InputError(
        arguments.input_path, "",
        "has " + size + " pixels, expected at least " + std::to_string(kLeastPhoto) + " both ways",
        "Give a larger photo, or none for the built-in image");
  }
  if (photo.cols < arguments.pattern.width || photo.rows < arguments.pattern.height) {
    context.Warn(arguments.input_path + " has only " + size +
                 " pixels and is enlarged: its finest detail is lost");
  }
  cv::Scalar mean, deviation;
  cv::meanStdDev(photo, mean, deviation);
  if (std::max({deviation[0], deviation[1], deviation[2]}) < 4) {
    throw InputError(arguments.input_path, "", "is plain: it shows nothing but one colour",
                     "Give a photo full of detail, or none for the built-in image");
  }
  return photo;
}

cv::Mat1b Make(const cv::Mat& photo, const PatternOptions& options) {
  return photo.empty() ? MakePattern(options) : MakePattern(photo, options);
}

void WritePattern(const std::string& path, const cv::Mat1b& pattern) {
  std::vector<uchar> bytes;
  cv::imencode(".png", pattern, bytes);
  OutputFile file(path);
  file.stream().write(reinterpret_cast<const char*>(bytes.data()),
                      static_cast<std::streamsize>(bytes.size()));
  file.Commit();
}

void ReportQuality(const PatternQuality& quality, const cv::Mat1b& pattern,
                   const Command::Context& context) {
  Report& report = context.report;
  const int wanted = WantedFeatures(pattern.size());
  report["features"] = quality.features;
  report["num_distinct"] = quality.num_distinct;
  report["num_distinct_wanted"] = wanted;
  report["distinctness"] = {{"ratio_median", Rounded(quality.ratio_median)},
                            {"share", Rounded(quality.distinct_share)}};
  report["brightness"] = Rounded(quality.brightness);
  report["light"] = Rounded(quality.light);
  report["similar_neighbours"] = quality.similar_neighbours;
  if (quality.num_distinct < wanted) {
    report.SetUntrusted("the pattern holds " + std::to_string(quality.num_distinct) +
                        " distinct features, " + std::to_string(wanted) +
                        " are wanted: give a photo with more detail, or none for the built-in "
                        "image");
  }
  if (quality.brightness < kLeastBrightness) {
    context.Warn("the pattern is dark (mean grey value " +
                 std::to_string(std::lround(100 * quality.brightness)) +
                 " %): it will not light the room; raise --brightness");
  }
  if (quality.similar_neighbours > 0) {
    context.Warn(std::to_string(quality.similar_neighbours) +
                 " pairs of neighbouring blocks look alike: the photo has large plain parts");
  }
}

void ReportPhoto(const PatternPhotoCheck& check, const std::string& path,
                 const Command::Context& context) {
  Json planes = Json::array();
  for (const PatternPlane& plane : check.planes) {
    planes.push_back({{"matched", plane.matched}, {"photo_pixels", Rounded(plane.photo_pixels)}});
  }
  context.report["photo"] = {{"path", path},
                             {"usable", check.usable},
                             {"verdict", check.verdict},
                             {"features", check.features},
                             {"matched", check.matched},
                             {"on_planes", check.on_planes},
                             {"planes", planes},
                             {"blur_px", Rounded(check.blur_px)},
                             {"blur_pattern_px", Rounded(check.blur_pattern_px)},
                             {"contrast", Rounded(check.contrast)},
                             {"over_exposed", Rounded(check.over_exposed)},
                             {"mean_grey", Rounded(check.mean_grey)}};
  if (!check.usable) {
    context.report.SetUntrusted(path + ": " + check.verdict[0]);
  }
  for (size_t i = check.usable ? 0 : 1; i < check.verdict.size(); ++i) {
    if (i == 0) {
      context.progress.Note(check.verdict[i]);
    } else {
      context.Warn(path + ": " + check.verdict[i]);
    }
  }
}

// The options of the pattern, as far as they say which one it is.
std::string Described(const PatternOptions& options) {
  return "--random_seed " + std::to_string(options.random_seed) + ", --width " +
         std::to_string(options.width) + ", --height " + std::to_string(options.height) +
         ", --blocks " + std::to_string(options.blocks) + ", --brightness " +
         Significant(options.brightness, 3);
}

// A photo of the wall is asked for the pattern that is projected: one that is there already is that
// one, and stays. Throws UsageError where the options make another.
void RequireThisPattern(const std::string& path, const cv::Mat1b& pattern,
                        const PatternOptions& options) {
  constexpr double kMostRounding = 2;  // grey levels, mean: other programs and machines round
  const cv::Mat1b there = cv::imread(path, cv::IMREAD_GRAYSCALE);
  if (there.size() == pattern.size() && cv::norm(there, pattern, cv::NORM_L1) <=
                                            kMostRounding * static_cast<double>(pattern.total())) {
    return;
  }
  throw UsageError("--output_path " + path +
                   " is there, and is not the pattern of these options (" + Described(options) +
                   "): nothing was written. Give the options that it was made with, --input_path "
                   "too, or leave --output_path out");
}

void WriteOrKeep(const Arguments& arguments, const PatternOptions& options,
                 const cv::Mat1b& pattern) {
  if (arguments.output_path.empty()) return;
  std::error_code error;
  if (!arguments.evaluate_path.empty() && std::filesystem::exists(arguments.output_path, error)) {
    RequireThisPattern(arguments.output_path, pattern, options);
  } else {
    WritePattern(arguments.output_path, pattern);
  }
}

// What is wrong with the paths.
std::vector<std::string> PathProblems(const Arguments& arguments) {
  if (arguments.output_path.empty()) {
    if (!arguments.evaluate_path.empty()) return {};
    return {"--output_path is required"};
  }
  if (LowerCase(std::filesystem::path(arguments.output_path).extension().string()) == ".png") {
    return {};
  }
  return {"--output_path must end in .png: that is what is written"};
}

void Run(const Arguments& arguments, const Command::Context& context) {
  const int num_threads = context.options.num_threads;
  PatternOptions options = arguments.pattern;
  options.random_seed = context.options.random_seed;
  std::vector<std::string> problems = options.Problems();
  for (const std::string& problem : PathProblems(arguments)) problems.push_back(problem);
  ThrowIfProblems(problems);
  if (ThreadsNotStarted() == 0) cv::setNumThreads(EffectiveThreads(num_threads));

  context.progress.Stage("pattern");
  const cv::Mat photo =
      arguments.input_path.empty() ? cv::Mat() : ReadDetailedPhoto(arguments, context);
  if (!arguments.evaluate_path.empty()) {
    RequireFile(arguments.evaluate_path, "Check --evaluate_path: a photo of the projected pattern");
  }
  // Read before anything is written: a photo that is none shall not leave a pattern behind.
  const cv::Mat wall =
      arguments.evaluate_path.empty() ? cv::Mat() : ReadPhoto(arguments.evaluate_path);
  const cv::Mat1b pattern = Make(photo, options);
  WriteOrKeep(arguments, options, pattern);

  context.progress.Stage("measure");
  const PatternFeatures features = FindFeatures(pattern);
  ReportQuality(MeasurePattern(pattern, features, options.blocks, num_threads), pattern, context);
  PatternOptions next = options;
  next.random_seed += options.random_seed < std::numeric_limits<int>::max() ? 1 : -1;
  const double cross = MatchedShare(features, FindFeatures(Make(photo, next)), num_threads);
  context.report["cross_seed"] = {{"random_seed", next.random_seed},
                                  {"matched_share", Rounded(cross)}};
  if (cross > kMostMatchedShare) {
    context.Warn(std::to_string(std::lround(1000 * cross) / 10.0) +
                 " % of the features are found in the pattern of the next seed, too: give each "
                 "projector a photo of its own");
  }
  if (!wall.empty()) {
    context.progress.Stage("evaluate photo");
    ReportPhoto(CheckPatternPhoto(wall, pattern, features, num_threads), arguments.evaluate_path,
                context);
  }
  context.progress.Finish();
  if (!arguments.output_path.empty()) AnswerAtEnd(arguments.output_path + "\n");
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  using namespace roomtex;  // NOLINT
  Arguments arguments;
  Command command("roomtex-pattern",
                  "Makes the pattern that a projector throws onto bare walls, so that photos of "
                  "them hold features.",
                  "roomtex-pattern --output_path pattern.png --width 1920 --height 1080");
  command.AddOutputPath("output_path", &arguments.output_path,
                        "the pattern, PNG; show it full screen, pixel by pixel; with "
                        "--evaluate_path one that is there stays, and may be left out",
                        Command::Kind::kOptional);
  const OptionFields pattern = FieldsOf(&arguments.pattern);
  command.Add(pattern.Only({"width", "height"}));
  command.AddInputPath("input_path", &arguments.input_path,
                       "photo full of detail to make the pattern of; without it: a built-in image",
                       Command::Kind::kOptional);
  command.Add(pattern.Without({"width", "height"}));
  command.AddInputPath("evaluate_path", &arguments.evaluate_path,
                       "photo of the projected pattern (same options): says whether the features "
                       "are found again, sharp and well exposed",
                       Command::Kind::kOptional);
  return command.Run(argc, argv, [&](const Command::Context& context) { Run(arguments, context); });
}
