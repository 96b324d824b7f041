// roomtex-import: a range scan in, mesh, cloud, intensity image or another scan format out.

#include <algorithm>
#include <filesystem>
#include <memory>
#include <utility>

#include "core/command_line.h"
#include "core/commit_together.h"
#include "core/error.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/output_set.h"
#include "core/resource_limits.h"
#include "core/result_names.h"
#include "core/scan_mesh.h"
#include "core/standard_files.h"
#include "importers/content_hash.h"
#include "importers/e57_images.h"
#include "importers/e57_writer.h"
#include "importers/las_writer.h"
#include "importers/length_unit.h"
#include "importers/panorama_cutter.h"
#include "importers/photo_picks.h"
#include "importers/ply.h"
#include "importers/ptx.h"
#include "importers/rtpi.h"
#include "importers/scan_check.h"
#include "importers/scan_path.h"
#include "importers/scan_reader.h"
#include "importers/scan_writer.h"
#include "importers/xyz.h"

namespace fs = std::filesystem;
namespace roomtex {
namespace {

struct ImportOptions {
  std::vector<std::string> input_paths;
  std::vector<std::string> output_paths;
  std::string scan_poses;   // of a look at scans
  std::string images_path;  // of an E57: folder for its photos
  bool cut_panoramas = false, image_picks = false;
  ScanReaderOptions reader;
  ScanMeshOptions mesh;
  LasWriterOptions las;
  FaceOptions faces;  // of panoramas

  // Nothing is to be made: only what the scans are is asked for.
  bool IsLook() const { return output_paths.empty() && images_path.empty(); }
  // The only one, unless this is a look.
  const std::string& input_path() const { return input_paths[0]; }
};

// And the options that say how the scan is read and written.
void CheckOutputs(const ImportOptions& options) {
  std::vector<std::string> problems;
  std::string known;
  for (const std::string& extension : ScanWriterExtensions()) {
    known += (known.empty() ? "" : ", ") + extension;
  }
  for (const std::string& path : options.output_paths) {
    if (ScanWriterExtension(path).empty()) {
      problems.push_back("--output_path " + path + ": unknown extension, expected one of " + known);
    }
  }
  AppendProblems(options.reader.Problems(), &problems);
  AppendProblems(options.mesh.Problems(), &problems);
  AppendProblems(options.las.Problems(), &problems);
  ThrowIfProblems(problems);
  // An output that cannot be written is better known before a large scan was read.
  for (const std::string& path : options.output_paths) OutputFile probe(path);
}

// RTPI to RTPI keeps every sample as it stands, also those that no cell of the grid has.
void CopyRtpi(const ImportOptions& options, const std::string& output_path) {
  RtpiFile file = ReadRtpi(options.input_path());
  file.header.version = 3;
  if (!options.reader.units.empty()) {
    file.header.units = options.reader.units;
  }
  if (options.reader.max_range > 0) {
    const double meters = MetersPerUnit(file.header.units).value_or(1);
    file.header.max_range = options.reader.max_range / meters;
  }
  WriteRtpi(file, output_path);
}

// "room.pcd", 2 -> "room_2.pcd".
std::string NumberedPath(const std::string& path, size_t number) {
  const fs::path p(path);
  return (p.parent_path() /
          (p.stem().string() + "_" + std::to_string(number) + p.extension().string()))
      .string();
}

class Importer {
 public:
  Importer(const ImportOptions& options, const Command::Context& context)
      : options_(options), context_(context) {}

  void Run() {
    CheckOutputs(options_);
    context_.progress.Stage("read scan");
    const SampleWork work("converting", kImportBytesPerSample);
    file_ = ReadScanFile(options_.input_path(), options_.reader);
    for (const std::string& note : file_.notes) context_.Warn(note);
    CheckGrid();
    NoteLostSystem();
    context_.progress.Stage("triangulate");
    for (const Scan& scan : file_.scans) meshes_.push_back(BuildScanMesh(scan, options_.mesh));
    FillReport();
    context_.progress.Stage("write", static_cast<int>(options_.output_paths.size()));
    std::string answer = Summary();
    CommitFilesAtEnd();
    for (const std::string& path : options_.output_paths) {
      for (const std::string& written : Write(path)) answer += written + "\n";
      context_.progress.Tick();
    }
    context_.progress.Finish();
    AnswerAtEnd(answer);
  }

 private:
  // Before anything is written: what has no grid can become points or a mesh.
  void CheckGrid() const {
    for (const Scan& scan : file_.scans) {
      if (!scan.organised) RequireGridless(scan);
    }
  }
  void RequireGridless(const Scan& scan) const {
    for (const std::string& path : options_.output_paths) {
      const std::string extension = ScanWriterExtension(path);
      if (CanHold(extension, scan.kind())) continue;
      throw InputError(
          options_.input_path(), "",
          std::string(scan.kind() == Scan::Kind::kCloud ? "is a cloud" : "is a mesh") +
              " without a grid, which cannot be written as " + path,
          "Write a .ply or .las, or give the scan with its grid (RTPI, PTX, E57 or organised PCD)");
    }
  }

  void NoteLostSystem() const {
    if (file_.coordinate_system.empty() || options_.las.version == "1.4") return;
    for (const std::string& path : options_.output_paths) {
      if (ScanWriterExtension(path) != ".las") continue;
      context_.progress.Note(path + " is without the coordinate system of the input; " +
                             "--Las.version 1.4 keeps it");
    }
  }

  // Paths of the files written for one --output_path.
  std::vector<std::string> Write(const std::string& path) const {
    const std::string extension = ScanWriterExtension(path);
    const ScanWriterOptions writer{options_.reader.azimuth == "counterclockwise", options_.las,
                                   file_.coordinate_system};
    if (extension == ".rtpi" && file_.format == "RTPI") {
      CopyRtpi(options_, path);
    } else if (file_.scans.size() == 1) {
      WriteScan(file_.scans[0], meshes_[0], path, writer);
    } else if (extension == ".ptx") {
      WritePtx(file_.scans, path);
    } else if (extension == ".e57") {
      WriteE57(file_.scans, path);
    } else if (const auto kind = XyzKindOf(extension); kind || extension == ".las") {
      std::vector<const Scan*> scans;
      for (const Scan& scan : file_.scans) scans.push_back(&scan);
      kind ? WriteXyz(scans, path, *kind)
           : WriteLas(scans, path, options_.las, file_.coordinate_system);
    } else if (extension == ".ply") {
      std::vector<PlyPart> parts;
      for (size_t i = 0; i < meshes_.size(); ++i) parts.push_back({&file_.scans[i], &meshes_[i]});
      WritePly(parts, path);
    } else {
      std::vector<std::string> written;
      for (size_t i = 0; i < meshes_.size(); ++i) {
        written.push_back(NumberedPath(path, i + 1));
        WriteScan(file_.scans[i], meshes_[i], written.back(), writer);
      }
      return written;
    }
    return {path};
  }

  static Json ScanReport(const Scan& scan, size_t num_triangles) {
    const int num_missing = scan.NumMissing();
    Json json;
    json["num_columns"] = scan.num_columns;
    json["num_rows"] = scan.num_rows;
    json["num_samples"] = static_cast<int>(scan.points.size()) - num_missing;
    json["num_missing"] = num_missing + scan.num_left_out;
    json["num_triangles"] = num_triangles;
    return json;
  }

  void FillReport() {
    Json total = ScanReport(file_.scans[0], meshes_[0].size());
    Json each = Json::array({total});
    Bounds bounds = FindBounds(file_.scans[0]);
    for (size_t i = 1; i < file_.scans.size(); ++i) {
      const Json one = ScanReport(file_.scans[i], meshes_[i].size());
      each.push_back(one);
      for (const char* key : {"num_columns", "num_samples", "num_missing", "num_triangles"}) {
        total[key] = total[key].get<int64_t>() + one[key].get<int64_t>();
      }
      total["num_rows"] = std::max(total["num_rows"].get<int>(), one["num_rows"].get<int>());
      const Bounds more = FindBounds(file_.scans[i]);
      bounds.min = bounds.min.cwiseMin(more.min);
      bounds.max = bounds.max.cwiseMax(more.max);
    }
    for (const auto& [key, value] : total.items()) context_.report[key] = value;
    context_.report["format"] = file_.format;
    context_.report["byte_order"] = file_.byte_order;
    context_.report["has_colors"] =
        std::any_of(file_.scans.begin(), file_.scans.end(),
                    [](const Scan& scan) { return !scan.colors.empty(); });
    context_.report["up"] = {{"axis", file_.up_axis}, {"assumed", file_.scans[0].up_is_assumed}};
    context_.report["bounds"] = {{"min", ToJson(bounds.min)}, {"max", ToJson(bounds.max)}};
    if (each.size() > 1) context_.report["scans"] = each;
    if (each.size() > 1) {
      context_.progress.Note(
          std::to_string(each.size()) +
          " scans: .pcd, .png and .rtpi outputs are numbered, the others hold all of them");
    }
  }

  std::string Summary() const {
    std::string text = options_.input_path() + ": " + file_.format + ", ";
    if (file_.scans.size() > 1) text += std::to_string(file_.scans.size()) + " scans, ";
    const Json& keys = context_.report.keys();
    if (file_.scans.front().organised) {
      text += keys["num_columns"].dump() + " columns x " + keys["num_rows"].dump() + " rows, ";
    }
    return text + keys["num_samples"].dump() + " samples, " + keys["num_missing"].dump() +
           " missing, " + keys["num_triangles"].dump() + " triangles\n";
  }

  const ImportOptions& options_;
  const Command::Context& context_;
  ScanFile file_;
  std::vector<std::vector<Triangle>> meshes_;
};

// Keys of the report that say nothing where no scan is converted: there, and null.
constexpr const char* kScanKeys[] = {"num_columns",   "num_rows",   "num_samples", "num_missing",
                                     "num_triangles", "byte_order", "bounds"};

void CutPanoramasOf(const ImportOptions& options, const Command::Context& context) {
  if (options.output_paths.size() != 1) {
    throw UsageError("Of panoramas one --output_path is made: the folder for their faces.");
  }
  if (!options.images_path.empty()) {
    throw UsageError("--images_path is for the photos of an E57, and " + options.input_path() +
                     " are panoramas: their faces go to --output_path.");
  }
  const std::string& folder = options.output_paths[0];
  const fs::path input = options.input_path();
  std::error_code none_yet;
  if (fs::equivalent(folder, fs::is_directory(input) ? input : input.parent_path(), none_yet)) {
    throw UsageError("--output_path " + folder +
                     " is the folder of the panoramas: give another one for their faces.");
  }
  const std::vector<CutPanorama> panoramas = CutPanoramas(
      options.input_path(), folder, options.faces, context.options.num_threads, &context.progress);
  context.progress.Finish();
  context.report["num_panoramas"] = panoramas.size();
  context.report["faces_per_panorama"] = panoramas[0].faces.size();
  context.report["face_size_px"] = panoramas[0].face_camera.width;
  AnswerAtEnd((fs::path(folder) / kPanoramaSetName).string() + "\n");
}

// Photos that only have the same name as one of the E57 stay: they may be somebody's originals.
void RequireNoOtherPhotos(const E57Photos& photos, const OutputSet& outputs) {
  for (const E57Photos::Photo& photo : photos.photos) {
    const std::string there = outputs.folder() + "/" + photo.file;
    std::error_code error;
    if (!fs::exists(there, error)) continue;
    if (fs::is_regular_file(there, error) &&
        HashOfFile(there) == HashOfFile(outputs.aside() + "/" + photo.file)) {
      continue;
    }
    throw InputError(there, "", "is another picture than the one of this name in the E57",
                     "Give another --images_path");
  }
}

// The cameras of the photos with a pose, each with the names of its photos.
Json CamerasOf(const std::vector<PosedPhoto>& photos) {
  std::vector<std::pair<Json, std::vector<std::string>>> cameras;
  for (const PosedPhoto& photo : photos) {
    const Json camera = {{"model", CameraModelName(photo.camera.model)},
                         {"width", photo.camera.width},
                         {"height", photo.camera.height},
                         {"params", photo.camera.params}};
    auto same = std::find_if(cameras.begin(), cameras.end(),
                             [&](const auto& one) { return one.first == camera; });
    if (same == cameras.end()) {
      same = cameras.insert(same, {camera, std::vector<std::string>()});
    }
    same->second.push_back(photo.name);
  }
  Json list = Json::array();
  for (const auto& [camera, names] : cameras) {
    list.push_back(camera);
    list.back()["images"] = names;
  }
  return list;
}

// The photos of an E57 as files, those with a pose as a COLMAP model beside them.
void WriteImages(const ImportOptions& options, const Command::Context& context) {
  ThrowIfProblems(options.reader.Problems());
  E57ImageOptions images;
  images.meters_per_unit = MetersPerUnit(options.reader.units).value_or(1);
  images.check = options.reader.e57_check && options.output_paths.empty();  // or done already
  images.cut_panoramas = options.cut_panoramas;
  images.faces = options.faces;
  const auto outputs = std::make_shared<OutputSet>(options.images_path);
  const E57Photos photos = ExtractE57Images(SplitScanPath(options.input_path()).file,
                                            outputs->aside(), images, &context.progress);
  RequireNoOtherPhotos(photos, *outputs);
  context.progress.Finish();
  for (const std::string& note : photos.notes) context.Warn(note);
  if (options.image_picks) {
    const ScanFile scans = ReadScanFile(options.input_path(), options.reader);
    const std::vector<PhotoPick> picks = PicksOfPosedPhotos(photos.posed, scans.scans);
    if (picks.empty()) {
      context.Warn("no picks: no photo with a pose shows six places of the scans");
    } else {
      WritePhotoPicks(picks, outputs->Path("picks.csv"));
    }
    context.report["num_picks"] = picks.size();
  }
  CommitAtEnd(outputs);
  Json json = Json::array();
  for (const E57Photos::Photo& photo : photos.photos) {
    json.push_back(
        {{"file", photo.file}, {"name", photo.name}, {"kind", photo.kind}, {"posed", photo.posed}});
  }
  context.report["images"] = json;
  context.report["cameras"] = CamerasOf(photos.posed);
  AnswerAtEnd(options.images_path + ": " + std::to_string(photos.photos.size()) + " photos, " +
              std::to_string(photos.posed.size()) + " with a pose\n");
}

// One line per panorama of the input.
std::string LinesOnPanoramas(const std::string& input_path,
                             const std::vector<CutPanorama>& panoramas) {
  std::error_code error;
  const bool is_folder = fs::is_directory(input_path, error);
  std::string lines;
  for (const CutPanorama& one : panoramas) {
    lines += (is_folder ? (fs::path(input_path) / one.name).string() : input_path) +
             ": panorama, " + std::to_string(one.width) + " x " + std::to_string(one.height) +
             " pixels\n";
  }
  return lines;
}

// Says what the inputs are, and writes nothing.
void LookAtInputs(const ImportOptions& options, const Command::Context& context) {
  CheckOutputs(options);
  std::vector<std::string> scans;
  std::string answer;
  size_t num_panoramas = 0;
  for (const std::string& path : options.input_paths) {
    if (std::count(options.input_paths.begin(), options.input_paths.end(), path) > 1) {
      throw UsageError("--input_path " + path + " is given twice");
    }
    if (!IsPanoramaInput(path)) {
      scans.push_back(path);
      continue;
    }
    const std::vector<CutPanorama> panoramas = DescribePanoramas(path, options.faces);
    num_panoramas += panoramas.size();
    answer += LinesOnPanoramas(path, panoramas);
  }
  if (num_panoramas > 0) context.report["num_panoramas"] = num_panoramas;
  if (scans.empty() && !options.scan_poses.empty()) {
    throw UsageError("--scan_poses is for scans, and there are panoramas only");
  }
  if (scans.empty()) {
    AnswerAtEnd(answer);
    return;
  }
  context.progress.Stage("read scan", static_cast<int>(scans.size()));
  constexpr double kKept = 0;  // of several scans: one at a time is held
  const SampleWork work("looking at", kLookBytesPerSample, kKept, kLookBytesPerSample);
  const std::vector<CheckedFile> files =
      CheckScans(scans, options.scan_poses, options.reader, &context.progress);
  context.progress.Finish();
  for (const CheckedFile& file : files) {
    for (const std::string& note : file.notes) {
      context.Warn(scans.size() > 1 ? file.path + ": " + note : note);
    }
  }
  const Json keys = ReportKeys(files);
  for (const auto& [key, value] : keys.items()) context.report[key] = value;
  AnswerAtEnd(answer + LinesOn(files));
}

void CheckUsage(const ImportOptions& options) {
  ThrowIfProblems(options.faces.Problems());
  if (options.images_path.empty() && (options.image_picks || options.cut_panoramas)) {
    throw UsageError(std::string(options.image_picks ? "--E57.picks" : "--E57.cut_panoramas") +
                     " is for the photos of an E57: give --images_path, the folder for them.");
  }
  if (options.IsLook()) return;
  if (options.input_paths.size() > 1) {
    throw UsageError("--input_path is given " + std::to_string(options.input_paths.size()) +
                     " times: several are only looked at, without --output_path and --images_path");
  }
  if (!options.scan_poses.empty()) {
    throw UsageError(
        "--scan_poses is only looked at together with its scans, without --output_path and "
        "--images_path");
  }
}

void RunImport(const ImportOptions& options, const Command::Context& context) {
  CheckUsage(options);
  for (const char* key : kScanKeys) context.report[key] = nullptr;
  if (options.IsLook()) {
    LookAtInputs(options, context);
    return;
  }
  if (IsPanoramaInput(options.input_path())) {
    CutPanoramasOf(options, context);
    return;
  }
  if (!options.output_paths.empty()) Importer(options, context).Run();
  if (!options.images_path.empty()) WriteImages(options, context);
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  using roomtex::Command;
  roomtex::ImportOptions options;
  options.reader.colors = true;
  options.reader.azimuth = "clockwise";  // conversions do not depend on what a header says
  Command command(
      "roomtex-import",
      "Reads a range scan (RTPI, PTX, E57, PCD, PLY, LAS, text; meshes) and writes it as mesh, "
      "cloud, intensity image or scan; without an output it says what the scan is. The content of "
      "the input decides its format, the extension of an output its own.",
      "roomtex-import --input_path room.rtpi --output_path room.ply --output_path room.png");
  command.AddInputPaths(
      "input_path", &options.input_paths,
      "The scan. A PTX or E57 may hold several: .pcd, .png and .rtpi outputs are then written one "
      "per scan as NAME_1, NAME_2 ..., the others hold all of them. "
      "site.e57#NAME or site.e57#2 is one scan of an E57. Or a "
      "panorama (.jpg, .png, .tif; equirectangular), or a folder of them, to be "
      "cut into faces for COLMAP up to 4.0, which knows no panoramas. Several are only looked at, "
      "without --output_path and --images_path. " +
          roomtex::BytesPerSampleHelp(roomtex::kImportBytesPerSample));
  command.AddOutputPaths(
      "output_path", &options.output_paths,
      "What to write: .ply triangle mesh, .pcd organised cloud, .png intensity image, .rtpi (RTPI "
      "3.0), .ptx, .e57, or points: .las, .xyz, .pts, .csv. Colours of the scan itself go where "
      "the format holds them (all but .png and .rtpi). Of panoramas: the folder "
      "for their faces, panoramas.json (which face is which part of which panorama) and "
      "camera_options.txt (for colmap feature_extractor). Without it, and without --images_path, "
      "the input is only looked at: a line says what a scan is, and whether it has a pose, or what "
      "a panorama is.",
      Command::Kind::kOptional);
  command.AddOutputPath(
      "images_path", &options.images_path,
      "E57: folder for its photos, written as they are, one with a mask as a PNG that "
      "is transparent where it shows nothing. Those with a pose also "
      "become a COLMAP model in its folder sparse, in the frame of the scans: "
      "what roomtex-texture takes as --input_path.",
      Command::Kind::kOptional);
  command.AddInputPath("scan_poses", &options.scan_poses,
                       "Without --output_path: the poses of the scans, which are looked at as "
                       "roomtex-align reads them. Several scans need a pose each.",
                       Command::Kind::kOptional);
  command.AddBool(
      "E57.cut_panoramas", &options.cut_panoramas,
      "With --images_path: panoramas as faces (--Faces.*) of perspective cameras in the "
      "model, for programs that know no EQUIRECTANGULAR.");
  command.AddBool(
      "E57.picks", &options.image_picks,
      "With --images_path: also picks.csv, places of the scans in the photos with a pose. "
      "A sparse model that has these photos among its own is aligned by them "
      "(roomtex-align --picks_path) without clicks.");
  command.Add(FieldsOf(&options.reader));
  command.Add(FieldsOf(&options.mesh));
  command.Add(FieldsOf(&options.las));
  command.Add(FieldsOf(&options.faces));
  return command.Run(argc, argv, [&options](const Command::Context& context) {
    roomtex::RunImport(options, context);
  });
}
