// roomtex-view: a look at the coloured scan in a browser.

#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include <Eigen/Geometry>

#include "core/announce_page.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/json_text.h"
#include "core/local_server.h"
#include "core/local_server_key.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/output_set.h"
#include "texture/view/view_folder.h"
#include "texture/view/view_server.h"
#include "texture/view/view_shifts.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;

struct ViewOptions {
  std::string input_path, aligned, image_path, output_path;
  ViewFolderOptions folder;
  LocalServerOptions server;
};

// A value of a report that roomtex wrote, e.g. {"options", "image_path"}; "" = not there.
std::string FromReport(const fs::path& path, const std::vector<std::string>& keys) {
  Json json = ReadJsonIfAny(path.string());
  for (const std::string& key : keys) {
    if (!json.is_object() || !json.contains(key)) return "";
    json = Json(json[key]);
  }
  if (json.is_array() && !json.empty()) json = Json(json[0]);
  return json.is_string() ? json.get<std::string>() : "";
}

// Where the photos were when the model was aligned or coloured; "" = nobody says, or they are gone.
std::string FindPhotos(const ViewOptions& options, const Command::Context& context) {
  if (!options.image_path.empty()) {
    RequireFolder(options.image_path, "Give the folder of the photos");
    return options.image_path;
  }
  std::string said;
  for (const fs::path& report : {fs::path(options.aligned) / "alignment.json",
                                 fs::path(options.input_path) / "report.json"}) {
    for (const char* section : {"inputs", "options"}) {
      std::string folder = FromReport(report, {section, "image_path"});
      if (folder.empty()) continue;
      // The command ran beside its output folder, mostly. Where this one runs may be another room
      // whose photos have the same names: that comes last.
      for (const fs::path& base : {report.parent_path() / "..", report.parent_path(), fs::path()}) {
        const fs::path moved = (base / folder).lexically_normal();
        std::error_code error;
        if (fs::is_directory(moved, error)) return moved.string();
      }
      said = folder;
    }
  }
  context.Warn(said.empty()
                   ? "nothing says where the photos are; give --image_path to see them"
                   : "the photos are no longer in " + said + "; give --image_path to see them");
  return "";
}

ViewCameras ReadCameras(const ViewOptions& options, const Command::Context& context) {
  if (options.aligned.empty()) return {};
  context.progress.Stage("read cameras");
  ViewCameras cameras(ReadSparseModel(options.aligned), FindPhotos(options, context));
  if (cameras.size() == 0) {
    throw InputError(options.aligned, "", "holds no registered photo",
                     "Give the folder that roomtex-align wrote");
  }
  return cameras;
}

// Cameras far from everything: the model is not in the scan's frame.
std::optional<std::string> FrameProblem(const ViewModel& model, const ViewCameras& cameras) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3f& p : model.points) {
    if (p.allFinite()) box.extend(p.cast<double>());
  }
  const double diagonal = box.diagonal().norm();
  size_t num_far = 0;
  for (const auto& [id, image] : cameras.model().images) {
    const Eigen::Vector3d at = image.cam_from_model.TargetOriginInSource() - model.origin;
    num_far += box.exteriorDistance(at) > diagonal;
  }
  if (2 * num_far <= cameras.size()) return std::nullopt;
  return "most cameras of --aligned stand far outside the scan: is the model aligned? Run "
         "roomtex-align.";
}

// A look does not end with exit 4, but says what the model and its colours are built on.
void WarnOfDoubts(const ViewOptions& options, const Command::Context& context,
                  std::vector<std::string>* warnings) {
  std::error_code error;
  const fs::path input(options.input_path);
  const fs::path folder = fs::is_directory(input, error) ? input : input.parent_path();
  std::vector<fs::path> reports = {folder / "report.json", folder / "joined.json"};
  if (!options.aligned.empty()) reports.push_back(fs::path(options.aligned) / "alignment.json");
  for (const fs::path& path : reports) {
    const Json json = ReadJsonIfAny(path.string());
    if (!json.is_object() || !json.contains("trusted") || json["trusted"] != false) continue;
    const std::string reason = FromReport(path, {"reason"});
    const fs::path what = path.has_parent_path() ? path.parent_path() : path;
    warnings->push_back(what.string() + " is not to be trusted. " + reason);
    context.Warn(warnings->back());
  }
}

// All that there is to see; what there is to warn of is said.
ViewContent ReadContent(const ViewOptions& options, const Command::Context& context) {
  context.progress.Stage("read model");
  ViewContent content;
  WarnOfDoubts(options, context, &content.warnings);
  content.model = ReadViewModel(options.input_path);
  content.cameras = ReadCameras(options, context);
  if (const auto problem = FrameProblem(content.model, content.cameras)) {
    context.Warn(*problem);
    content.warnings.push_back(*problem);
  }
  if (content.cameras.size() > content.cameras.num_photos()) {
    content.warnings.push_back(
        std::to_string(content.cameras.size() - content.cameras.num_photos()) + " of " +
        std::to_string(content.cameras.size()) +
        (content.cameras.left_out().empty()
             ? " photos are not there; give --image_path to see them."
             : " photos cannot be shown. " + content.cameras.left_out()[0].reason));
  }
  ReportPhotosLeftOut(content.cameras.left_out(), context);
  const fs::path folder = fs::path(content.model.path).parent_path();
  content.tones = ReadViewTones(folder.string());
  content.shifts = ReadViewShifts(folder.string());
  const fs::path evidence = folder / "evidence.ply";
  std::error_code error;
  if (fs::is_regular_file(evidence, error)) {
    content.evidence_path = evidence.string();
  } else if (fs::path(content.model.path).extension() == ".gltf") {
    content.no_evidence_reason = "Of joined rooms each has its evidence in its own folder.";
  } else {
    content.no_evidence_reason =
        "There is no evidence.ply beside the model, as roomtex-texture writes it unless it is told "
        "--output_evidence 0. Run roomtex-texture again to have it.";
  }

  const bool is_cloud = content.model.is_cloud;
  const size_t num_triangles = content.model.triangles.size();
  context.report["num_vertices"] = is_cloud ? num_triangles : content.model.points.size();
  context.report["num_triangles"] = is_cloud ? 0 : num_triangles;
  context.report["num_cameras"] = content.cameras.size();
  context.report["num_photos"] = content.cameras.num_photos();
  return content;
}

void Write(const ViewOptions& options, const Command::Context& context) {
  const auto outputs = std::make_shared<OutputSet>(options.output_path);
  outputs->ReplaceAllOf("roomtex-view");
  const ViewFolderSize size =
      WriteViewFolder(ReadContent(options, context), options.folder, outputs->aside(),
                      context.options.num_threads, &context.progress);
  CommitAtEnd(outputs);  // its report.json is for those who get the folder
  context.report["num_files"] = size.num_files;
  context.report["num_bytes"] = size.num_bytes;
  context.progress.Finish();
  std::cout << (fs::path(options.output_path) / "index.html").string() << std::endl;
}

void Serve(const ViewOptions& options, const Command::Context& context) {
  ViewContent content = ReadContent(options, context);
  context.progress.Stage("prepare");
  LocalServerOptions server_options = options.server;
  server_options.token = KeptToken(options.input_path);  // links to views stay good
  LocalServer server(server_options);
  const ViewServer view(std::move(content), &server, context.options.num_threads);
  server.Start(true);
  context.progress.Finish();
  const auto browser = AnnouncePage(options.server, server, context);
  context.progress.Note("Ctrl-C ends");
  server.Wait();
}

int Main(int argc, char** argv) {
  ViewOptions options;
  Command command("roomtex-view",
                  "Shows the coloured scan, its cameras and photos in a browser; measures in it.",
                  "roomtex-view --input_path textured --aligned aligned --open 1");
  command.AddInputPath(
      "input_path", &options.input_path,
      "Folder that roomtex-texture or roomtex-join wrote; or a .glb, .gltf or .ply "
      "file.");
  command.AddInputPath(
      "aligned", &options.aligned,
      "Folder that roomtex-align wrote, or any COLMAP model in the scan frame: its "
      "cameras and points are shown.",
      Command::Kind::kOptional);
  command.AddInputPath("image_path", &options.image_path,
                       "Folder of the photos; default: where alignment.json or report.json says "
                       "they were.",
                       Command::Kind::kOptional);
  command.AddOutputPath("output_path", &options.output_path,
                        "Serve nothing, but write a folder to give away: open its index.html, from "
                        "a disk or from any web server.",
                        Command::Kind::kOptional);
  command.Add(FieldsOf(&options.folder));
  command.Add(FieldsOf(&options.server));
  LetPortDiffer(argc, argv, &options.server);
  return command.Run(argc, argv, [&options](const Command::Context& context) {
    std::vector<std::string> problems = options.folder.Problems();
    AppendProblems(options.server.Problems(), &problems);
    ThrowIfProblems(problems);
    if (options.output_path.empty()) {
      Serve(options, context);
    } else {
      Write(options, context);
    }
  });
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) { return roomtex::Main(argc, argv); }
