// roomtex-associate: which photos show the same with and without the projected pattern.

#include <cmath>
#include <filesystem>

#include <opencv2/core/utility.hpp>

#include "capture/association/associated_views.h"
#include "capture/association/associated_views_links.h"
#include "core/command_line.h"
#include "core/commit_together.h"
#include "core/error.h"
#include "core/option_fields.h"
#include "core/photo_files.h"
#include "core/standard_files.h"
#include "core/text.h"

namespace roomtex {
namespace {

struct Arguments {
  AssociateOptions options;
  std::string output_path, links_path;
};

double Rounded(double value) { return std::round(1e4 * value) / 1e4; }
Json Pixels(const Eigen::Vector2d& x) { return Json::array({Rounded(x.x()), Rounded(x.y())}); }

void CheckLinksPath(const Arguments& arguments) {
  if (arguments.links_path.empty()) return;
  namespace fs = std::filesystem;
  const fs::path images = fs::weakly_canonical(arguments.options.image_path);
  const fs::path links = fs::weakly_canonical(arguments.links_path);
  const auto below = links.lexically_relative(images).generic_string();
  if (!below.empty() && !BeginsWith(below, "..")) {
    throw UsageError("--links_path lies in --image_path: the links would be taken for photos");
  }
}

void FillReport(const Associations& found, const Command::Context& context) {
  Report& report = context.report;
  report["num_photos"] = found.num_photos;
  report["num_pairs"] = found.pairs.size();
  Json pairs = Json::array(), moved = Json::array(), singles = Json::array();
  for (const AssociatedPair& pair : found.pairs) {
    Json json = {{"patterned_image", pair.patterned_image},
                 {"plain_image", pair.plain_image},
                 {"shift_px", Pixels(pair.shift)},
                 {"offset_px", Rounded(pair.offset_px)},
                 {"offset_error_px", Rounded(pair.offset_error_px)},
                 {"brightness_ratio", Rounded(pair.brightness_ratio)},
                 {"exif_brightness", pair.exif_brightness},
                 {"num_common_keypoints", nullptr},
                 {"offset_by", pair.by_keypoints ? "keypoints" : "edges"},
                 {"found_by", pair.found_by},
                 {"spare", pair.is_spare}};
    if (pair.num_common_keypoints) json["num_common_keypoints"] = *pair.num_common_keypoints;
    pairs.push_back(json);
  }
  for (const MovedPair& pair : found.moved) {
    moved.push_back({{"first_image", pair.first_image},
                     {"second_image", pair.second_image},
                     {"shift_px", Pixels(pair.shift)},
                     {"offset_px", Rounded(pair.offset_px)},
                     {"offset_error_px", Rounded(pair.offset_error_px)}});
  }
  for (const SinglePhoto& single : found.singles) {
    singles.push_back({{"image", single.image}, {"reason", single.reason}});
  }
  report["pairs"] = pairs;
  report["moved"] = moved;
  report["singles"] = singles;
}

void Run(const Arguments& arguments, const Command::Context& context) {
  AssociateOptions options = arguments.options;
  options.num_threads = context.options.num_threads;
  ThrowIfProblems(options.Problems());
  CheckLinksPath(arguments);
  cv::setNumThreads(1);  // photos are handled side by side
  const Associations found = FindAssociations(options, &context.progress);
  if (const std::string note = NoteOnOtherPhotos(options.image_path); !note.empty()) {
    context.Warn(note);
  }
  context.progress.Stage("write");
  FillReport(found, context);
  for (const std::string& warning : found.warnings) context.Warn(warning);
  for (const SinglePhoto& single : found.singles) {
    context.Warn(single.image + " is not associated: " + single.reason);
  }
  CommitFilesAtEnd();
  WriteAssociations(arguments.output_path, found.pairs);
  if (!arguments.links_path.empty()) {
    CommitAtEnd(MakeLinks(arguments.links_path, options.image_path, found.pairs));
    context.report["num_links"] = NumLinks(found.pairs);
  }
  if (found.pairs.empty()) {
    std::string reason = "no pair of a patterned and a plain photo was found among " +
                         std::to_string(found.num_photos) + " photos";
    if (!found.moved.empty()) {
      reason += "; the camera moved between the photos of " + std::to_string(found.moved.size()) +
                " places";
    }
    context.report.SetUntrusted(reason);
  }
  context.progress.Finish();
  AnswerAtEnd(arguments.output_path + "\n");
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  using namespace roomtex;  // NOLINT
  Arguments arguments;
  Command command("roomtex-associate",
                  "Finds the places photographed twice, with and without the projected pattern.",
                  "roomtex-associate --database_path database.db --image_path images "
                  "--output_path associations.csv --links_path links");
  command.AddInputPath("database_path", &arguments.options.database_path,
                       "COLMAP's database, opened read-only; its keypoints, if there are any, "
                       "tell how far the camera moved where edges are too few, and it is said "
                       "where they contradict the edges",
                       Command::Kind::kOptional);
  command.AddInputPath("image_path", &arguments.options.image_path,
                       "folder with all photos, patterned and plain; subfolders are searched");
  command.AddOutputPath("output_path", &arguments.output_path,
                        "CSV patterned_image,plain_image,offset_px,brightness_ratio");
  command.AddOutputPath("links_path", &arguments.links_path,
                        "folder for patterned/ and plain/: links under common names",
                        Command::Kind::kOptional);
  command.Add(FieldsOf(&arguments.options));
  return command.Run(argc, argv, [&](const Command::Context& context) { Run(arguments, context); });
}
