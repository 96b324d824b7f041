// roomtex-dense: surfaces from photos where the scan has none.

#include <filesystem>
#include <map>
#include <memory>

#include <fmt/core.h>

#include "colmap_ext/sparse_model.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/output_set.h"
#include "core/resource_limits.h"
#include "core/standard_files.h"
#include "core/surfels.h"
#include "dense/dense.h"
#include "importers/scan_reader.h"
#include "importers/scan_record.h"

namespace roomtex {
namespace {

// Of the alignment's expected error: 98 of 100 photos are nearer to their true places.
constexpr double kErrors = 2;

struct DenseCommandOptions {
  std::string input_path, image_path, output_path, scan_poses;
  std::vector<std::string> scan_paths;
  ScanReaderOptions scan_reader;
  bool accept_untrusted = false, strict = false, use_doubtful = false;
  DenseOptions dense;
};

void AddOptions(DenseCommandOptions* o, Command* command) {
  command->AddInputPath(
      "input_path", &o->input_path,
      "Folder of the COLMAP model in the scan frame, as roomtex-align writes it.");
  command->AddInputPath("image_path", &o->image_path,
                        "Folder of the photos, as COLMAP was given it. Photos of a projected "
                        "pattern are the best: bare walls become dense.");
  command->AddInputPaths("scan_path", &o->scan_paths,
                         "Range scan. Not needed for a model of roomtex-align, which remembers its "
                         "scans and how they were read. " +
                             BytesPerSampleHelp(kDenseBytesPerSample),
                         Command::Kind::kOptional);
  command->AddOutputPath("output_path", &o->output_path,
                         "Folder to write supplement.ply and COLMAP's dense workspace into: new, "
                         "empty, or of an earlier run, which is replaced as a whole.");
  command->Add(FieldsOf(&o->dense));
  command->Add(FieldsOf(&o->dense.patch_match));
  command->Add(FieldsOf(&o->dense.fusion));
  command->AddBool("accept_untrusted", &o->accept_untrusted, kAcceptUntrustedHelp);
  command->AddBool("strict", &o->strict, kStrictHelp);
  command->AddBool("use_doubtful", &o->use_doubtful, kUseDoubtfulHelp);
  command->AddInputPath("scan_poses", &o->scan_poses, ScanPosesHelp(), Command::Kind::kOptional);
  command->Add(FieldsOf(&o->scan_reader));
}

std::vector<DensePhoto> ListDensePhotos(const SparseModel& model, const std::string& image_path,
                                        const std::map<std::string, std::string>& doubtful,
                                        std::vector<PhotoLeftOut>* left_out,
                                        const Command::Context& context) {
  RequireFolder(image_path, "Check --image_path: it is the folder that COLMAP was given");
  std::vector<DensePhoto> photos;
  std::vector<std::string> notes;
  for (const auto& [id, image] : model.images) {
    const auto doubt = doubtful.find(image.name);
    if (doubt != doubtful.end()) {
      left_out->push_back({image.name, doubt->second});
      continue;
    }
    DensePhoto photo{image.name, image_path + "/" + image.name, PhotoPixels::kAsStored,
                     model.cameras.at(image.camera_id), image.cam_from_model};
    const PhotoFit fit =
        FitPhotoToCamera(photo.path, photo.name, photo.camera.width, photo.camera.height);
    if (!fit.usable()) {
      left_out->push_back({photo.name, fit.problem});
      continue;
    }
    if (!fit.note.empty()) notes.push_back(fit.note);
    photo.pixels = fit.pixels;
    if (fit.scaled) photo.camera.Resize(fit.width, fit.height);
    photos.push_back(std::move(photo));
  }
  std::sort(photos.begin(), photos.end(),
            [](const DensePhoto& a, const DensePhoto& b) { return a.name < b.name; });
  for (const std::string& note : FirstNotes(notes)) context.Warn(note);
  return photos;
}

double AreaOf(const Supplement& supplement) {
  double area = 0;
  for (const auto& [a, b, c] : supplement.triangles) {
    const Eigen::Vector3d& corner = supplement.vertices[a].x_in_scan;
    area += 0.5 * (supplement.vertices[b].x_in_scan - corner)
                      .cross(supplement.vertices[c].x_in_scan - corner)
                      .norm();
  }
  return area;
}

void FillReport(const DenseResult& result, const Command::Context& context) {
  Report& report = context.report;
  report["num_images"] = result.photos.size();
  report["num_vertices"] = result.supplement.vertices.size();
  report["num_triangles"] = result.supplement.triangles.size();
  report["area_m2"] = AreaOf(result.supplement);
  Json images = Json::array();
  int without = 0;
  for (const DenseResult::Photo& photo : result.photos) {
    without += photo.num_neighbours < 2;
    images.push_back({{"name", photo.name},
                      {"num_neighbours", photo.num_neighbours},
                      {"open", photo.share_open},
                      {"new", photo.share_new}});
  }
  report["images"] = images;
  if (result.supplement.vertices.empty()) {
    context.Warn(
        "nothing was found that the scan does not have: its holes may be seen by too few photos, "
        "or hold no texture");
  }
  if (without > 0) {
    context.Warn(std::to_string(without) + " of " + std::to_string(result.photos.size()) +
                 " photos share too little of the scan with others from beside: no depth there");
  }
}

void Dense(const DenseCommandOptions& options, const Command::Context& context) {
  std::vector<std::string> problems = options.scan_reader.Problems();
  AppendProblems(options.dense.Problems(), &problems);
  ThrowIfProblems(problems);
  RequireScans(options.scan_paths, options.input_path);
  // Everything appears together, in the place of an earlier output.
  const auto outputs = std::make_shared<OutputSet>(options.output_path);
  outputs->ReplaceAllOf("roomtex-dense");

  context.progress.Stage("read model");
  const AlignmentRecord alignment = ReadAlignmentRecord(options.input_path);
  RequireAlignedModel(alignment);
  const SparseModel model = ReadSparseModel(options.input_path);
  std::vector<PhotoLeftOut> left_out;
  const std::map<std::string, std::string> none;
  const std::vector<DensePhoto> photos =
      ListDensePhotos(model, options.image_path,
                      options.use_doubtful ? none : alignment.doubtful_photos, &left_out, context);
  if (options.strict) ThrowIfAnyLeftOut(left_out, options.image_path);
  if (photos.empty()) {
    throw InputError(options.input_path, "",
                     left_out.empty()
                         ? "holds no registered photo"
                         : "holds no photo that can be used. " + AsClause(left_out[0].reason),
                     "");
  }
  TakeOverTrust(alignment, options.accept_untrusted, context);

  context.progress.Stage("read scan");
  const SampleWork work("finding surfaces beside", kDenseBytesPerSample);
  PlacedScans placed = ReadScansOfModel(
      alignment, {options.scan_paths, options.scan_poses, options.scan_reader}, context);
  ReplaceClouds(&placed.scans, context.options.num_threads);

  // The scan's own surface, seen by photos that stand beside their true places, is nothing new.
  DenseOptions dense = options.dense;
  dense.fusion.distance_to_scan =
      std::max(dense.fusion.distance_to_scan, kErrors * alignment.expected_error);
  context.report["distance_to_scan"] = dense.fusion.distance_to_scan;
  if (dense.fusion.distance_to_scan > options.dense.fusion.distance_to_scan) {
    context.Warn(
        fmt::format("the alignment is good to {:.0f} mm: only what is {:.0f} mm and more "
                    "away from the scan's surface is added",
                    1000 * alignment.expected_error, 1000 * dense.fusion.distance_to_scan));
  }
  const std::string& folder = outputs->aside();
  const DenseResult result = MakeDense(placed.scans, photos, dense, folder,
                                       static_cast<uint64_t>(context.options.random_seed),
                                       context.options.num_threads, &context.progress, &left_out);
  if (options.strict) ThrowIfAnyLeftOut(left_out, options.image_path);
  ReportPhotosLeftOut(left_out, context);
  FillReport(result, context);
  context.report["entries"] = outputs->Entries();
  CommitWithReport("report.json", outputs);
  AnswerAtEnd(options.output_path + "/supplement.ply\n");
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  roomtex::DenseCommandOptions options;
  roomtex::Command command(
      "roomtex-dense",
      "Surfaces from photos where the scan has none: PatchMatch stereo, bounded by the scan.",
      "roomtex-dense --input_path aligned --image_path images --scan_path room.rtpi "
      "--output_path dense");
  roomtex::AddOptions(&options, &command);
  return command.Run(argc, argv, [&options](const roomtex::Command::Context& context) {
    roomtex::Dense(options, context);
  });
}
