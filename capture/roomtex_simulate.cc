// roomtex-simulate: a simulated capture with known truth. Parses, calls, reports.

#include <memory>

#include "capture/pattern/pattern.h"
#include "capture/simulation/capture_writer.h"
#include "capture/simulation/simulated_room.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/option_fields.h"
#include "core/output_set.h"
#include "core/standard_files.h"

namespace {

using namespace roomtex;

// As `roomtex-pattern --random_seed SEED` makes it.
cv::Mat1b ThrownPattern(int width, int height, int seed) {
  PatternOptions pattern;
  pattern.width = width;
  pattern.height = height;
  pattern.random_seed = seed;
  return MakePattern(pattern);
}

void Describe(const SimulatedRoom& room, const CaptureSummary& summary, Report* report) {
  (*report)["num_photos"] = room.NumPhotos();
  (*report)["num_projectors"] = room.options().projectors;
  (*report)["camera_model"] = CameraModelName(room.camera().model);
  (*report)["camera_params"] = room.camera().params;
  const Rigid scan_from_room = room.ScanFromRoom();
  (*report)["scan_from_room"] =
      ToJson(Similarity{1, scan_from_room.rotation, scan_from_room.translation});
  (*report)["num_stations"] = room.NumStations();
  (*report)["num_samples"] = summary.num_samples;
  (*report)["num_missing"] = summary.num_missing;
  (*report)["picked_photo"] = summary.picked_photo;
  (*report)["num_picks"] = summary.num_picks;
  Json exposures = Json::object();
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    exposures[room.PhotoName(photo)] = room.ExposureEv(photo);
  }
  (*report)["exposure_ev"] = exposures;
}

}  // namespace

int main(int argc, char** argv) {
  SimulatedRoomOptions options;
  options.shading = true;  // the command makes pictures to look at; tests want plain albedo
  std::string output_path;
  int seed = -1;
  bool reachable = false;
  std::string bare = "auto";
  Command command(
      "roomtex-simulate",
      "Makes a capture of a simulated room: photos, a range scan, picks, and the truth.",
      "roomtex-simulate --output_path capture --num_photos 16 --photo_width 960 --photo_height "
      "640");
  command.AddOutputPath("output_path", &output_path,
                        "folder for the capture; its README.txt says what is what");
  command.AddInt("seed", &seed, "the same as --random_seed; -1 = take that one");
  command.Add(FieldsOf(&options));
  command.AddChoice("bare", &bare, {"auto", "1", "0"},
                    "bare walls, and little furniture in one colour a piece; auto = with "
                    "projectors");
  command.AddBool("reachable", &reachable,
                  "write truth/reachable.ply too: the mean of the photos with true places, "
                  "visibility, exposure, white balance, vignetting and response");
  return command.Run(argc, argv, [&](const Command::Context& context) {
    if (seed < -1) throw UsageError("--seed must be -1 (that of --random_seed), 0 or more");
    options.random_seed = seed >= 0 ? seed : context.options.random_seed;
    options.bare = bare == "1" || (bare == "auto" && options.projectors > 0);
    options.num_threads = context.options.num_threads;
    options.pattern = ThrownPattern;
    ThrowIfProblems(options.Problems());
    context.progress.Stage("room");
    const SimulatedRoom room(options);
    const auto outputs = std::make_shared<OutputSet>(output_path);
    const CaptureSummary summary = MakeCapture(room, &context.progress, reachable, outputs.get());
    CommitAtEnd(outputs);
    Describe(room, summary, &context.report);
    if (options.num_picks > 0 && summary.num_picks < options.num_picks) {
      context.Warn("only " + std::to_string(summary.num_picks) + " places to click were found");
    }
    AnswerAtEnd(output_path + "\n");
  });
}
