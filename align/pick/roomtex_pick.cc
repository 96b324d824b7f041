// roomtex-pick: points seen in a photo and in the scan, clicked on a page in the browser.

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include "align/clicks/picks.h"
#include "align/pick/mirror_picks.h"
#include "align/pick/pick_scene.h"
#include "align/pick/pick_server.h"
#include "align/pick/pick_session.h"
#include "colmap_ext/panorama_model.h"
#include "core/announce_page.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/local_server_key.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "importers/rtpi_header.h"
#include "importers/scan_record.h"
#include "pick_page.h"

namespace roomtex {
namespace {

struct Arguments {
  PickSceneInput scene;
  std::string output_path, aligned_path, image_name;
  LocalServerOptions server;
};

void AddOptions(Arguments* a, Command* command) {
  command->AddInputPaths("input_path", &a->scene.input_paths,
                         "COLMAP's sparse model: a folder, .bin or .txt. Several (photos that "
                         "nothing connects: sparse/0 sparse/1) are placed each by the picks in its "
                         "photos. Without it the photos of --image_path are placed each by its own "
                         "picks.",
                         Command::Kind::kOptional);
  command->AddInputPath("image_path", &a->scene.image_path, "Folder of the photos.");
  command->AddInputPaths(
      "scan_path", &a->scene.scan_paths,
      "Range scan: .rtpi, .ptx, .e57, .pcd, .las, a mesh or a cloud. Not needed for "
      "a model of roomtex-align, which remembers its scans and how they were "
      "read.",
      Command::Kind::kOptional);
  command->AddOutputPath("output_path", &a->output_path,
                         "Picks, a CSV file for roomtex-align. Saved after every change; one that "
                         "is there is continued, and kept as it was with .bak behind its name.");
  command->AddString(
      "image_name", &a->image_name,
      "Photo to begin with, by its name below --image_path; empty = the best one to pick in.");
  command->AddOutputPath("aligned_path", &a->aligned_path,
                         "Folder that the page's Align writes to; empty = aligned, beside the "
                         "picks.",
                         Command::Kind::kOptional);
  command->AddInputPath("panoramas_path", &a->scene.panoramas_path, PanoramasHelp(),
                        Command::Kind::kOptional);
  command->AddInputPath("scan_poses", &a->scene.scan_poses, ScanPosesHelp(),
                        Command::Kind::kOptional);
  command->Add(FieldsOf(&a->scene.scan_reader));
  command->Add(FieldsOf(&a->scene.camera));
  command->Add(FieldsOf(&a->server));
}

void CheckArguments(Arguments* a) {
  std::vector<std::string> problems = a->scene.scan_reader.Problems();
  AppendProblems(a->server.Problems(), &problems);
  AppendProblems(a->scene.camera.Problems(), &problems);
  if (!a->scene.input_paths.empty() && !a->scene.camera.camera_params.empty()) {
    problems.push_back(
        "--camera_params is for photos without a sparse model: that of --input_path "
        "has cameras");
  }
  ThrowIfProblems(problems);
  RequireScans(a->scene.scan_paths, a->scene.AlignedPath());
  const std::filesystem::path picks(a->output_path);
  if (a->aligned_path.empty()) a->aligned_path = (picks.parent_path() / "aligned").string();
  if (std::filesystem::is_directory(picks)) {
    throw InputError(a->output_path, "", "is a folder", "Name a file for the picks: picks.csv");
  }
  const std::filesystem::path folder = picks.has_parent_path() ? picks.parent_path() : ".";
  if (!std::filesystem::is_directory(folder)) {
    throw InputError(folder.string(), "", "there is no such folder",
                     "Make it, or correct --output_path");
  }
  // One that cannot be written is better known before six clicks.
  const OutputFile probe(a->output_path);
}

void WarnOfMissingPhotos(const PickScene& scene, const Command::Context& context) {
  constexpr size_t kNamed = 5;
  Json left_out = Json::array();
  std::string names;
  for (const PickPhoto& photo : scene.photos()) {
    if (!photo.missing) continue;
    if (left_out.size() < kNamed) names += (names.empty() ? "" : ", ") + photo.name();
    left_out.push_back({{"name", photo.name()}, {"reason", photo.problem}});
  }
  context.report["photos_left_out"] = left_out;
  if (left_out.empty()) return;
  if (left_out.size() > kNamed) names += " ...";
  context.Warn(std::to_string(left_out.size()) + " of " + std::to_string(scene.photos().size()) +
               " photos cannot be shown. The first: " + left_out[0]["reason"].get<std::string>() +
               " All: " + names);
}

// One reading of the scans. picks: taken over, in place of those of the file. Gives the picks for
// the next reading, or nothing: the session is over.
std::optional<std::vector<SessionPick>> ServeScans(
    const std::optional<std::vector<SessionPick>>& picks, Arguments* a,
    std::unique_ptr<OpenBrowser>* browser, const Command::Context& context) {
  PickScene scene(a->scene, &context.progress);
  if (!a->image_name.empty()) {
    std::vector<std::string> names;
    for (const PickPhoto& photo : scene.photos()) names.push_back(photo.name());
    CheckPhotoName("--image_name", a->image_name, names, "among the photos");
  }
  const bool is_first = !picks;
  for (const std::string& note : scene.notes()) {
    if (is_first) context.Warn(note);
  }
  if (is_first) WarnOfMissingPhotos(scene, context);
  PickSession session(scene, a->output_path);
  if (picks) session.Put(session.Now()->revision, *picks);
  scene.Prepare();
  const std::string next_token = MakeToken();
  PickServer server(
      scene, &session, kPickPage,
      {a->server, a->image_name, a->aligned_path, next_token, BesideThisProgram("roomtex-align")});
  server.Start(true);
  if (is_first) {
    *browser = AnnouncePage(a->server, server.server(), context);
  } else {
    std::cout << server.server().Url() << std::endl;  // the page goes there by itself, others ask
  }
  server.Wait();
  if (!session.SaveAgain(true)) throw InputError(a->output_path, "", session.Now()->save_error, "");
  context.report["num_picks"] = session.Now()->picks.size();
  if (!server.mirror_asked()) return std::nullopt;
  a->scene.scan_reader.azimuth = OtherAzimuth(scene.azimuth());
  a->server.port = server.server().port();
  a->server.port_may_differ = false;
  a->server.token = next_token;
  context.progress.Note("the scan is read again, azimuth " + a->scene.scan_reader.azimuth);
  return MirrorPicks(scene, session.Now()->picks);
}

void ServePicking(Arguments a, const Command::Context& context) {
  CheckArguments(&a);
  a.scene.num_threads = context.options.num_threads;
  std::unique_ptr<OpenBrowser> browser;
  std::optional<std::vector<SessionPick>> picks;
  do {
    picks = ServeScans(picks, &a, &browser, context);
  } while (picks);
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  roomtex::Arguments arguments;
  roomtex::Command command(
      "roomtex-pick", "Points seen in a photo and in the scan, clicked on a page in the browser.",
      "roomtex-pick --input_path sparse/0 --image_path images --scan_path room.rtpi "
      "--output_path picks.csv");
  roomtex::AddOptions(&arguments, &command);
  roomtex::LetPortDiffer(argc, argv, &arguments.server);
  return command.Run(argc, argv, [&](const roomtex::Command::Context& context) {
    roomtex::ServePicking(arguments, context);
  });
}
