// roomtex-export: aligned photos and scan for programs that go on from there.

#include <memory>

#include "colmap_ext/sparse_model.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/option_fields.h"
#include "core/output_set.h"
#include "core/resource_limits.h"
#include "core/standard_files.h"
#include "core/surfels.h"
#include "importers/scan_reader.h"
#include "importers/scan_record.h"
#include "texture/colorize.h"
#include "texture/earlier_results.h"
#include "texture/export/export_photos.h"
#include "texture/export/export_scene.h"
#include "texture/output/write_e57.h"
#include "texture/sampling/mesh_front.h"
#include "texture/sampling/photo_list.h"

namespace roomtex {
namespace {

struct ExportCommandOptions {
  std::string input_path, output_path, scan_poses, colors_path;
  std::vector<std::string> scan_paths;
  std::string format = "colmap";
  PhotoSources sources;
  ScanReaderOptions scan_reader;
  bool accept_untrusted = false, strict = false;
  ExportOptions exporting;
  BlendOptions blend;  // only which photos are foreign: kBlendOptions
};

const std::vector<std::string> kBlendOptions = {"Blend.min_agreement"};

void AddOptions(ExportCommandOptions* o, Command* command) {
  command->AddInputPath(
      "input_path", &o->input_path,
      "Folder of the COLMAP model in the scan frame, as roomtex-align writes it.");
  command->AddInputPath("image_path", &o->sources.image_path,
                        "Folder of the photos, as COLMAP was given it.");
  command->AddInputPaths("scan_path", &o->scan_paths,
                         "Range scan. Not needed for a model of roomtex-align, which remembers its "
                         "scans and how they were read. " +
                             BytesPerSampleHelp(kExportBytesPerSample),
                         Command::Kind::kOptional);
  command->AddChoice(
      "format", &o->format, {"colmap", "nerfstudio", "e57"},
      "colmap: workspace of undistorted photos, sparse model with points of the scan and their "
      "tracks, depth and normal maps of the scan, for splatting trainers and stereo_fusion. "
      "nerfstudio: transforms.json with depth images and a point cloud. e57: the coloured scans "
      "and the photos in one file, scan.e57.");
  command->AddOutputPath("output_path", &o->output_path,
                         "Folder to write into: new, empty, or an earlier export, which is "
                         "replaced as a whole.");
  command->AddInputPath("colors_path", &o->colors_path,
                        "The model.ply that roomtex-texture wrote for these scans: its colours are "
                        "taken. Without it the scans are coloured here.",
                        Command::Kind::kOptional);
  command->AddInputPath("associations_path", &o->sources.associations_path,
                        "CSV patterned_image,plain_image: the plain twin of every registered "
                        "patterned photo takes its place.",
                        Command::Kind::kOptional);
  command->Add(FieldsOf(&o->exporting));
  command->AddBool("accept_untrusted", &o->accept_untrusted,
                   std::string(kAcceptUntrustedHelp) + " The same of colours of --colors_path.");
  command->AddBool("strict", &o->strict, kStrictHelp);
  command->AddBool("use_doubtful", &o->sources.use_doubtful, kUseDoubtfulHelp);
  command->AddInputPath("scan_poses", &o->scan_poses, ScanPosesHelp(), Command::Kind::kOptional);
  command->Add(FieldsOf(&o->scan_reader));
  command->Add(FieldsOf(&o->exporting.occlusion));
  command->Add(FieldsOf(&o->blend).Only(kBlendOptions));
}

// Puts surfaces in the place of the clouds, and finds the colours of all.
ScanColors ColorsOf(std::vector<Scan>* clouds, const ExportCommandOptions& options, PhotoList* list,
                    const Command::Context& context) {
  std::vector<Scan>& scans = *clouds;
  if (!options.colors_path.empty()) {
    context.progress.Stage("read colours");
    ScanColors colors = ReadScanColors(scans, options.colors_path);
    for (size_t s = 0; s < scans.size(); ++s) {
      if (scans[s].kind() != Scan::Kind::kCloud) continue;
      Scan surface = FindCloudSurface(scans[s], context.options.num_threads).patches;
      colors[s] = ColorsOfSurface(scans[s], colors[s], surface);
      scans[s] = std::move(surface);
    }
    return colors;
  }
  ReplaceClouds(&scans, context.options.num_threads);
  ColorizeOptions colorize;
  colorize.atlas.mode = "0";
  colorize.occlusion = options.exporting.occlusion;
  colorize.blend = options.blend;
  ColorizeResult colored = ColorizeUsable(scans, colorize, options.strict,
                                          context.options.num_threads, &context.progress, list);
  ScanColors colors;
  for (ColoredScan& scan : colored.scans) colors.push_back(std::move(scan.samples));
  return colors;
}

void WriteE57(const std::vector<Scan>& scans, ScanColors colors, const PhotoList& list,
              const std::string& folder, const Command::Context& context) {
  context.progress.Stage("write");
  std::vector<ColoredScan> colored(scans.size());
  for (size_t s = 0; s < scans.size(); ++s) colored[s].samples = std::move(colors[s]);
  WriteColoredE57(scans, colored, &list.photos, folder + "/scan.e57");
  context.report["num_images"] = list.photos.size();
}

void WritePhotosAndModel(const std::vector<Scan>& scans, const ScanColors& colors,
                         const ExportCommandOptions& options, const std::string& folder,
                         PhotoList* list, const Command::Context& context) {
  context.progress.Stage("points");
  const int num_threads = context.options.num_threads;
  const ExportScene scene =
      MakeExportScene(scans, colors, options.exporting.max_points, num_threads);
  context.progress.Stage("photos", static_cast<int>(list->photos.size()));
  const bool colmap = options.format == "colmap";
  const std::vector<ExportedPhoto> photos =
      ExportPhotos(scene, list->photos, colmap ? ExportFormat::kColmap : ExportFormat::kNerfstudio,
                   options.exporting, folder, num_threads, &context.progress, &list->left_out);
  if (options.strict) ThrowIfAnyLeftOut(list->left_out, options.sources.image_path);
  if (photos.empty()) {
    throw InputError(
        options.input_path, "",
        "holds no photo that can be exported. " + AsClause(list->left_out.at(0).reason), "");
  }
  context.progress.Stage("write");
  size_t num_points = scene.points.size();
  if (colmap) {
    num_points = WriteColmapModel(scene, photos, folder);
  } else {
    WriteNerfstudioModel(scene, photos, scans[0].up, options.exporting.masks, folder);
  }
  size_t num_observations = 0;
  Json images = Json::array();
  for (const ExportedPhoto& photo : photos) {
    num_observations += photo.sights.size();
    Json image = {{"name", photo.name},
                  {"width", photo.camera.width},
                  {"height", photo.camera.height},
                  {"num_points", photo.sights.size()},
                  {"unscanned", photo.share_unscanned}};
    if (options.exporting.masks) image["moving"] = photo.share_moving;
    images.push_back(image);
  }
  context.report["num_images"] = photos.size();
  context.report["num_points"] = num_points;
  context.report["num_observations"] = num_observations;
  context.report["images"] = images;
  if (num_points == 0) {
    context.report.SetUntrusted(
        "no point of the scan is clearly seen by two photos. Is the model "
        "aligned? Run roomtex-align.");
  }
}

// An E57 holds photos in full, and nothing else of them.
std::vector<std::string> ProblemsOfE57(const ExportOptions& options) {
  std::vector<std::string> problems;
  const ExportOptions usual;
  for (const auto& [name, is_given] :
       {std::pair("max_points", options.max_points != usual.max_points),
        {"max_image_size", options.pinhole.max_image_size != usual.pinhole.max_image_size},
        {"max_field_of_view", options.pinhole.max_field_deg != usual.pinhole.max_field_deg},
        {"masks", options.masks != usual.masks}}) {
    if (is_given) problems.push_back(std::string("--") + name + " is not for --format e57");
  }
  return problems;
}

void Export(const ExportCommandOptions& options, const Command::Context& context) {
  std::vector<std::string> problems = options.scan_reader.Problems();
  if (options.format == "e57") AppendProblems(ProblemsOfE57(options.exporting), &problems);
  AppendProblems(options.exporting.Problems(), &problems);
  AppendProblems(options.blend.Problems(), &problems);
  ThrowIfProblems(problems);
  RequireScans(options.scan_paths, options.input_path);
  // Everything appears together, in the place of an earlier output.
  const auto outputs = std::make_shared<OutputSet>(options.output_path);
  outputs->ReplaceAllOf("roomtex-export");

  context.progress.Stage("read model");
  const AlignmentRecord alignment = ReadAlignmentRecord(options.input_path);
  RequireAlignedModel(alignment);
  const SparseModel model = ReadSparseModel(options.input_path);
  PhotoList list = ListPhotosOf(model, alignment, options.sources, options.strict, context);
  TakeOverTrust(alignment, options.accept_untrusted, context);
  if (!options.colors_path.empty()) {
    TakeOverTrustOfResult(options.colors_path, "roomtex-texture", options.accept_untrusted,
                          context);
  }

  context.progress.Stage("read scan");
  const SampleWork work("exporting", kExportBytesPerSample);
  PlacedScans placed = ReadScansOfModel(
      alignment, {options.scan_paths, options.scan_poses, options.scan_reader}, context);
  for (const Scan& scan : placed.scans) {
    if (options.format == "e57" && !scan.organised) {
      throw InputError(scan.path, "", "has no grid, which an E57 needs here",
                       "Export it as colmap or nerfstudio");
    }
  }

  TurnMeshesToPhotos(list.photos, context, &placed.scans);
  const std::string& folder = outputs->aside();
  const ScanColors colors = ColorsOf(&placed.scans, options, &list, context);
  if (options.format == "e57") {
    WriteE57(placed.scans, colors, list, folder, context);
  } else {
    WritePhotosAndModel(placed.scans, colors, options, folder, &list, context);
  }
  ReportPhotosLeftOut(list.left_out, context);
  context.report["entries"] = outputs->Entries();
  CommitWithReport("report.json", outputs);
  AnswerAtEnd(options.output_path + "\n");
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  roomtex::ExportCommandOptions options;
  roomtex::Command command(
      "roomtex-export",
      "Aligned photos and scan for Gaussian splatting, nerfstudio, COLMAP's dense steps, or as "
      "E57.",
      "roomtex-export --input_path aligned --image_path images --scan_path room.rtpi "
      "--format colmap --output_path exported");
  roomtex::AddOptions(&options, &command);
  return command.Run(argc, argv, [&options](const roomtex::Command::Context& context) {
    roomtex::Export(options, context);
  });
}
