// roomtex-simulate: a simulated capture with known truth. Parses, calls, reports.

#include <cstdio>

#include "capture/pattern/pattern.h"
#include "capture/simulation/camera_faults.h"
#include "capture/simulation/capture_writer.h"
#include "capture/simulation/simulated_room.h"
#include "core/command_line.h"
#include "core/error.h"

namespace {

using namespace roomtex;

void AddOptions(SimulatedRoomOptions* options, Command* command) {
  command->AddDouble("room_width", &options->width, "size of the room along x, metres");
  command->AddDouble("room_depth", &options->depth, "size of the room along y, metres");
  command->AddDouble("room_height", &options->height, "height of the room, metres");
  command->AddBool("furnished", &options->furnished, "table, shelf, sofa, pictures and so on");
  command->AddBool("bare_walls", &options->bare_walls,
                   "plain walls, floor and ceiling: nothing for features to hold on to");
  command->AddInt("projectors", &options->projectors,
                  "projectors that throw patterns; every place is then photographed twice, "
                  "patterned and plain, and the room is bare unless --bare says otherwise");
  command->AddInt("projector_width", &options->projector_width, "pixels");
  command->AddInt("projector_height", &options->projector_height, "pixels");
  command->AddDouble("projector_field_of_view_deg", &options->projector_field_of_view_deg,
                     "horizontal, degrees; smaller = finer pattern on less of the walls");
  command->AddDouble("projector_light", &options->projector_light,
                     "light of a white pattern at 1 m, room light = 1");
  command->AddDouble("projector_focus", &options->projector_focus,
                     "metres from the projector to where its pattern is sharp");
  command->AddBool("same_pattern", &options->same_pattern,
                   "a mistake to study: all projectors throw the same pattern");
  command->AddDouble("finest_detail", &options->finest_detail,
                     "metres: no surface has finer detail; larger = smoother pictures and prints");
  command->AddBool("shading", &options->shading,
                   "light from a lamp and the window instead of even light");
  command->AddInt("num_photos", &options->num_photos,
                  "number of photos; with projectors: of places");
  command->AddInt("photo_width", &options->photo_width, "pixels");
  command->AddInt("photo_height", &options->photo_height, "pixels");
  command->AddDouble("field_of_view_deg", &options->field_of_view_deg, "horizontal, degrees");
  command->AddString("camera_model", &options->camera_model, "any of COLMAP's camera models");
  command->AddBool("distortion", &options->distortion,
                   "lens distortion (0 = all its parameters zero)");
  command->AddDouble("exposure_range_ev", &options->exposure_range_ev,
                     "exposures vary by up to plus or minus this, in thirds of an EV");
  command->AddBool("exif", &options->exif, "write exposure time, aperture and ISO into the photos");
  command->AddDouble("photo_noise", &options->photo_noise,
                     "noise of the photos, standard deviation in grey levels of 255");
  command->AddDouble("blur_px", &options->blur_px, "blur of the photos, Gaussian sigma in pixels");
  command->AddChoice("response", &options->response, ResponseTable::Names(),
                     "how the camera turns light into bytes: sRGB, or a gamma of 1.8 with toe and "
                     "shoulder");
  command->AddDouble("vignetting", &options->vignetting,
                     "share of the light that the lens loses in the corners");
  command->AddDouble("white_balance_ev", &options->white_balance_ev,
                     "red and blue vary from photo to photo by up to plus or minus this, EV");
  command->AddChoice("wrong_exif", &options->wrong_exif, {"none", "one", "all"},
                     "one: the middle photo notes a quarter of its exposure time; all: every photo "
                     "notes the same");
  command->AddDouble("strangers", &options->strangers,
                     "share of the photos in which somebody stands who is not in the scan");
  command->AddInt("num_stations", &options->num_stations, "number of scans");
  command->AddInt("scan_columns", &options->scan_columns, "samples over the full turn");
  command->AddInt("scan_rows", &options->scan_rows, "samples from -60 to +75 degrees of elevation");
  command->AddDouble("range_noise", &options->range_noise,
                     "noise of the ranges, standard deviation in metres");
  command->AddDouble("range_noise_growth", &options->range_noise_growth,
                     "the noise is range_noise * (1 + this * range), per metre");
  command->AddDouble("bend", &options->bend,
                     "smooth distortion of the scan: ranges wrong by up to this fraction");
  command->AddDouble("azimuth_drift_deg", &options->azimuth_drift_deg,
                     "error of the azimuth that grows to this over the full turn, degrees");
  command->AddBool("missing_samples", &options->missing_samples,
                   "no echo from the window, the mirror and a few random samples");
  command->AddInt("num_picks", &options->num_picks, "clicks in the photo that suits best");
  command->AddDouble("click_noise_px", &options->click_noise_px,
                     "noise of the clicks, standard deviation per coordinate in pixels");
}

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
  (*report)["num_stations"] = room.options().num_stations;
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
  AddOptions(&options, &command);
  command.AddChoice("bare", &bare, {"auto", "1", "0"},
                    "bare walls, and little furniture in one colour a piece; auto = with "
                    "projectors");
  command.AddBool("reachable", &reachable,
                  "write truth/reachable.ply too: the mean of the photos with true places, "
                  "visibility and exposure");
  return command.Run(argc, argv, [&](const Command::Context& context) {
    options.random_seed = seed >= 0 ? seed : context.options.random_seed;
    options.bare = bare == "1" || (bare == "auto" && options.projectors > 0);
    options.num_threads = context.options.num_threads;
    options.pattern = ThrownPattern;
    ThrowIfProblems(options.Problems());
    context.progress.Stage("room");
    const SimulatedRoom room(options);
    const CaptureSummary summary = WriteCapture(room, output_path, &context.progress, reachable);
    Describe(room, summary, &context.report);
    if (options.num_picks > 0 && summary.num_picks < options.num_picks) {
      context.Warn("only " + std::to_string(summary.num_picks) + " places to click were found");
    }
    std::printf("%s\n", output_path.c_str());
  });
}
