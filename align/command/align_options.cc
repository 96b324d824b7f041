#include "align/command/align_options.h"

#include <filesystem>
#include <system_error>

#include "align/command/align_outputs.h"
#include "align/geo/geo_output.h"
#include "colmap_ext/panorama_model.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/input_guard.h"
#include "core/near_hint.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/output_set.h"
#include "core/partial_path.h"
#include "core/photo_fit.h"
#include "core/resource_limits.h"
#include "core/result_names.h"

namespace roomtex {

namespace {

void AddMainFiles(AlignCommandOptions* a, Command* command) {
  command->AddInputPaths("input_path", &a->input_paths,
                         "COLMAP's sparse model: a folder, .bin or .txt. Several (photos that "
                         "nothing connects: sparse/0 sparse/1) are put into the scan each by "
                         "itself, by its own picks or without, and those that are trusted are "
                         "written as one. Without it the photos of "
                         "--image_path that have six picks are placed each by its own; without "
                         "picks, too, every photo by what it shows of the scan's intensity.",
                         Command::Kind::kOptional);
  command->AddInputPaths(
      "scan_path", &a->scan_paths,
      "Range scan: .rtpi, .ptx, .e57, .pcd, .las, a mesh or a cloud. Not needed for "
      "an --input_path that was aligned before: it remembers its scans. " +
          BytesPerSampleHelp(kAlignBytesPerSample, true),
      Command::Kind::kOptional);
  command->AddInputPath(
      "picks_path", &a->picks_path,
      "Picks, a CSV file: image_name,x,y,scan_x,scan_y,scan_z (and, if wanted, "
      "weight: 1 = ordinary, "
      "more = more exact, 0 = off); six or more, in one photo or spread "
      "over several; pixels of the photo as taken, metres in the scan frame. "
      "Without picks, or with one to five as a hint (of photos without a sparse model: in each), "
      "the place is searched for, which needs --image_path; a model that roomtex-mapper "
      "--known_path has put into the "
      "scan's frame needs neither.",
      Command::Kind::kOptional);
  command->AddString("near", &a->near, kNearHelp);
  command->AddOutputPath(
      "output_path", &a->output_path,
      "Folder for the aligned model, alignment.json (the report), scan_from_sparse.txt (scale, "
      "quaternion w x y z, translation: --transform_path of colmap model_transformer) and "
      "scan_from_sparse_matrix.txt (the same as 4x4 matrix, for COLMAP up to 3.8). A trusted "
      "result "
      "that is there is not replaced by an untrusted one, which goes to OUTPUT.untrusted.");
}

void AddEvidenceAndReading(AlignCommandOptions* a, Command* command) {
  command->AddInputPath("image_path", &a->image_path,
                        "Folder of the photos (the plain ones where a pattern was projected); with "
                        "it the report says how well photos and scan intensity agree, and the "
                        "photos with each other where they see the same; an alignment that they "
                        "contradict is not trusted.",
                        Command::Kind::kOptional);
  command->AddBool("strict", &a->strict, kStrictHelp);
  command->AddInt("overlays", &a->overlays,
                  "Number of photos for which overlays/NAME.jpg is written into --output_path: "
                  "photo, scan intensity from its pose, and the scan's edges on the photo; needs "
                  "--image_path.");
  command->AddInputPath("database_path", &a->database_path,
                        "COLMAP's database: with it every photo is asked how many of its verified "
                        "matches obey the poses. Not needed.",
                        Command::Kind::kOptional);
  command->AddInputPath("panoramas_path", &a->panoramas_path, PanoramasHelp(),
                        Command::Kind::kOptional);
  command->AddInputPath("scan_poses", &a->scan_poses, ScanPosesHelp(), Command::Kind::kOptional);
  command->AddBool("register_stations", &a->register_stations,
                   "Move scans that do not fit the others where both show the same surface; 0 = "
                   "say so, and trust nothing that rests on them.");
  command->AddString("geo_origin", &a->geo_origin, GeoOriginHelp());
  command->Add(FieldsOf(&a->scan_reader));
  command->Add(FieldsOf(&a->bound));
  command->Add(FieldsOf(&a->camera));
}

void AddMethod(AlignCommandOptions* a, Command* command) {
  AlignmentOptions& o = a->alignment;
  command->AddBool("plane_constrained", &o.plane_constrained,
                   "Refine the similarity on the surface of the scan, and adjust poses and points "
                   "to it; 0 = one similarity by the picks alone.");
  command->AddChoice(
      "refine_intrinsics", &a->refine_intrinsics, kRefineIntrinsicsWords,
      "Adjust focal length, principal point and distortion, one set for all photos of "
      "a lens: auto = where photos or scan contradict what was told, which is said; "
      "1 = always; 0 = never, but a lens that the photos contradict is not trusted.");
  command->Add(FieldsOf(&o.bundle));
  command->Add(FieldsOf(&a->planes));
  command->AddOutputPath("Plane.output_path", &a->planes_path,
                         "Point cloud of the scan, a colour for each of its planes and grey where "
                         "there is none: a .ply for CloudCompare or MeshLab.",
                         Command::Kind::kOptional);
  command->Add(FieldsOf(&o.picks));
  command->Add(FieldsOf(&o.scale));
  command->Add(FieldsOf(&o.trust));
  command->Add(FieldsOf(&o.surface));
  command->Add(FieldsOf(&o.fit));
  command->Add(FieldsOf(&o.mesh));
}

// What cannot be written is better known before the work than after it. Makes no folder: a command
// that fails later leaves none.
void ProbeOutputs(const AlignCommandOptions& a) {
  namespace fs = std::filesystem;
  if (!a.planes_path.empty()) const OutputFile planes(a.planes_path);
  std::error_code error;
  fs::path folder = fs::absolute(a.output_path, error).lexically_normal();
  if (fs::exists(fs::symlink_status(folder, error))) {
    const OutputSet outputs(a.output_path);
    return;
  }
  while (!fs::exists(folder, error) && folder.has_relative_path()) folder = folder.parent_path();
  try {
    const PartialFolder probe(folder.string());
  } catch (const std::system_error& failure) {
    throw InputError(a.output_path, "",
                     "cannot be made a folder (" + failure.code().message() + ")",
                     "Check the path and that you may write there");
  }
}

}  // namespace

void AddOptions(AlignCommandOptions* a, Command* command) {
  AddMainFiles(a, command);
  AddEvidenceAndReading(a, command);
  AddMethod(a, command);
}

void RequirePicksOrPhotos(const AlignCommandOptions& a) {
  if (!a.picks_path.empty() || !a.image_path.empty()) return;
  throw UsageError(
      "--picks_path is missing: aligning without picks needs --image_path, "
      "since the photos must confirm what is found. Or make a picks file, a CSV with the header "
      "image_name,x,y,scan_x,scan_y,scan_z and six or more lines");
}

void CheckOptions(AlignCommandOptions* options) {
  if (!options->input_paths.empty()) options->input_path = options->input_paths[0];
  const AlignCommandOptions& a = *options;
  if (a.input_path.empty()) RequirePicksOrPhotos(a);
  std::vector<std::string> problems = a.scan_reader.Problems();
  AppendProblems(a.bound.Problems(), &problems);
  AppendProblems(a.alignment.Problems(), &problems);
  AppendProblems(a.planes.Problems(), &problems);
  AppendProblems(a.camera.Problems(), &problems);
  if (a.input_path.empty() && a.image_path.empty()) {
    problems.push_back(
        "--input_path is missing: COLMAP's sparse model, or --image_path alone for photos that "
        "have "
        "six picks each");
  }
  if (!a.input_path.empty()) {
    for (const auto& [option, is_given] :
         {std::pair("--camera_model", a.camera.camera_model != PhotoCameraOptions().camera_model),
          {"--camera_params", !a.camera.camera_params.empty()}}) {
      if (!is_given) continue;
      problems.push_back(std::string(option) +
                         " is for photos without a sparse model: that of --input_path "
                         "has cameras");
    }
  } else {
    for (const auto& [option, path] :
         {std::pair("--database_path", a.database_path), {"--panoramas_path", a.panoramas_path}}) {
      if (path.empty()) continue;
      problems.push_back(std::string(option) +
                         " belongs to a sparse model: give --input_path, too");
    }
  }
  if (a.overlays < 0) problems.push_back("--overlays must not be negative");
  if (a.overlays > 0 && a.image_path.empty()) {
    problems.push_back("--overlays needs the photos: give --image_path");
  }
  ThrowIfProblems(problems);
  RequireScans(a.scan_paths, a.input_path);
  ParseGeoOrigin(a.geo_origin);
  std::error_code ignored;
  for (const std::string& path : a.input_paths) {
    if (!std::filesystem::equivalent(path, a.output_path, ignored)) continue;
    throw UsageError(
        "--output_path is the same folder as --input_path: the input model is never "
        "overwritten");
  }
  RequireReplaceable(a.output_path + "/" + kAlignReportName);
  for (const std::string& name : FilesOfAlignedModel()) {
    RequireReplaceable(a.output_path + "/" + name);
  }
  if (!a.image_path.empty()) RequireFolder(a.image_path, "Check --image_path");
  if (!a.database_path.empty()) RequireFile(a.database_path, "Check --database_path");
  ProbeOutputs(a);
}

}  // namespace roomtex
