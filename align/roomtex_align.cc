// roomtex-align: the sparse model into the scan, by picks.

#include <cmath>
#include <filesystem>
#include <optional>

#include "align/alignment.h"
#include "align/geo/geo_output.h"
#include "align/plane_bundle_report.h"
#include "align/surface/scan_planes_report.h"
#include "align/trust/agreement.h"
#include "align/trust/agreement_report.h"
#include "align/trust/overlay.h"
#include "colmap_ext/panorama_model.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "importers/scan_reader.h"

namespace roomtex {
namespace {

struct Arguments {
  std::string input_path, picks_path, output_path, image_path, database_path, scan_poses;
  std::string panoramas_path;
  std::string geo_origin;
  std::vector<std::string> scan_paths;
  ScanReaderOptions scan_reader;
  AlignmentOptions alignment;
  ScanPlaneOptions planes;
  std::string planes_path;
  int overlays = 0;
};

void AddOptions(Arguments* a, Command* command) {
  command->AddInputPath("input_path", &a->input_path,
                        "COLMAP's sparse model: a folder, .bin or .txt.");
  command->AddInputPaths("scan_path", &a->scan_paths,
                         "Range scan: .rtpi, .ptx, organised .pcd, or a .ply mesh.");
  command->AddInputPath("picks_path", &a->picks_path,
                        "Picks, a CSV file: image_name,x,y,scan_x,scan_y,scan_z (and, if wanted, "
                        "weight: 1 = ordinary, "
                        "more = more exact, 0 = off); at least six in one photo; pixels of the "
                        "photo as taken, metres "
                        "in the scan frame.",
                        Command::Kind::kOptional);
  command->AddOutputPath(
      "output_path", &a->output_path,
      "Folder for the aligned model, alignment.json (the report), scan_from_sparse.txt (scale, "
      "quaternion w x y z, translation: --transform_path of colmap model_transformer) and "
      "scan_from_sparse_matrix.txt (the same as 4x4 matrix, for COLMAP up to 3.8).");
  command->AddInputPath("image_path", &a->image_path,
                        "Folder of the photos (the plain ones where a pattern was projected); with "
                        "it the report says how well photos and scan intensity agree, and an "
                        "alignment that they contradict is not trusted.",
                        Command::Kind::kOptional);
  command->AddInt("overlays", &a->overlays,
                  "Number of photos for which overlays/NAME.jpg is written into --output_path: "
                  "photo, scan intensity from its pose, and the scan's edges on the photo; needs "
                  "--image_path.");
  command->AddInputPath("database_path", &a->database_path,
                        "COLMAP's database; not needed for an alignment by picks.",
                        Command::Kind::kOptional);
  command->AddInputPath("panoramas_path", &a->panoramas_path, PanoramasHelp(),
                        Command::Kind::kOptional);
  command->AddInputPath("scan_poses", &a->scan_poses, ScanPosesHelp(), Command::Kind::kOptional);
  command->AddString("geo_origin", &a->geo_origin, GeoOriginHelp());
  command->Add(FieldsOf(&a->scan_reader));
  AlignmentOptions& o = a->alignment;
  command->AddBool("plane_constrained", &o.plane_constrained,
                   "Refine the similarity on the surface of the scan, and adjust poses and points "
                   "to it; 0 = one similarity by the picks alone.");
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

void CheckArguments(const Arguments& a) {
  if (a.picks_path.empty()) {
    throw UsageError(
        "--picks_path is missing: aligning without picks is not available in this version. Make a "
        "picks file, a CSV with the header image_name,x,y,scan_x,scan_y,scan_z and six or more "
        "lines");
  }
  std::vector<std::string> problems = a.scan_reader.Problems();
  AppendProblems(a.alignment.Problems(), &problems);
  AppendProblems(a.planes.Problems(), &problems);
  if (a.overlays < 0) problems.push_back("--overlays must not be negative");
  if (a.overlays > 0 && a.image_path.empty()) {
    problems.push_back("--overlays needs the photos: give --image_path");
  }
  ThrowIfProblems(problems);
  ParseGeoOrigin(a.geo_origin);
  std::error_code ignored;
  if (std::filesystem::equivalent(a.input_path, a.output_path, ignored)) {
    throw UsageError(
        "--output_path is the same folder as --input_path: the input model is never "
        "overwritten");
  }
  if (!a.image_path.empty()) RequireFolder(a.image_path, "Check --image_path");
  if (!a.database_path.empty()) RequireFile(a.database_path, "Check --database_path");
}

Json NumberOrNull(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json PicksToJson(const Alignment& alignment) {
  Json json;
  int num_used = 0;
  Json per_pick = Json::array();
  const AlignmentStart& start = alignment.start;
  for (size_t i = 0; i < start.picks.size(); ++i) {
    const PickOutcome& outcome = start.picks[i];
    num_used += outcome.used;
    Json one;
    one["image_name"] = outcome.pick.image_name;
    one["x"] = outcome.pick.x_in_img.x();
    one["y"] = outcome.pick.x_in_img.y();
    one["line"] = outcome.pick.line;
    one["residual_px"] = NumberOrNull(outcome.residual_px);
    one["refined_residual_px"] = NumberOrNull(alignment.refined_pick_px[i]);
    one["leave_one_out_px"] = NumberOrNull(outcome.leave_one_out_px);
    one["used"] = outcome.used;
    one["weight"] = outcome.pick.weight;
    per_pick.push_back(one);
  }
  json["count"] = start.picks.size();
  json["num_used"] = num_used;
  json["image_name"] = start.image_name.empty() ? Json(nullptr) : Json(start.image_name);
  json["rms_px"] = NumberOrNull(start.pick_rms_px);
  json["max_px"] = NumberOrNull(start.pick_max_px);
  json["refined_rms_px"] = NumberOrNull(alignment.refined_pick_rms_px);
  json["position_sigma_m"] = NumberOrNull(start.position_sigma);
  json["per_pick"] = per_pick;
  return json;
}

// One standard deviation, by what clicks, keypoints and the scan's noise leave open.
Json ExpectedErrorToJson(const ExpectedError& error) {
  Json json;
  json["at_cameras_mm"] = NumberOrNull(1000 * error.at_cameras);
  json["at_far_corner_mm"] = NumberOrNull(1000 * error.at_far_corner);
  json["far_corner"] = {error.far_corner.x(), error.far_corner.y(), error.far_corner.z()};
  json["rotation_deg"] = NumberOrNull(DegFromRad(error.rotation));
  json["scale"] = NumberOrNull(error.scale);
  return json;
}

// One standard deviation of each photo of an adjusted model; null for one that took no part.
Json PhotosToJson(const Alignment& alignment, const SparseModel& aligned) {
  Json json = Json::array();
  for (const auto& [image_id, image] : aligned.images) {
    const auto at = alignment.photo_sigmas.find(image_id);
    const bool known = at != alignment.photo_sigmas.end();
    Json one;
    one["name"] = image.name;
    one["position_sigma_mm"] = known ? NumberOrNull(1000 * at->second.position) : Json(nullptr);
    one["rotation_sigma_deg"] =
        known ? NumberOrNull(DegFromRad(at->second.rotation)) : Json(nullptr);
    json.push_back(one);
  }
  return json;
}

Json OpenDirectionsToJson(const OpenDirections& open) {
  const auto to_json = [](const std::vector<Eigen::Vector3d>& directions) {
    Json json = Json::array();
    for (const Eigen::Vector3d& d : directions) json.push_back({d.x(), d.y(), d.z()});
    return json;
  };
  Json json;
  json["degenerate"] = !open.None();
  json["num_facings"] = open.num_facings;
  json["open_translations"] = to_json(open.slides);
  json["open_rotations"] = to_json(open.turns);
  json["open_scale"] = open.scale;
  json["position_sigma_mm"] = NumberOrNull(1000 * open.slide_sigma);
  return json;
}

Json PlacementToJson(const Placement& placement) {
  Json json;
  json["num_points"] = placement.num_points;
  json["num_on_surface"] = placement.num_on_surface;
  json["num_floating"] = placement.num_floating;
  json["num_hidden"] = placement.num_hidden;
  json["surface_share"] = placement.SurfaceShare();
  json["changed_share"] = placement.ChangedShare();
  json["camera_share"] = placement.CameraShare();
  return json;
}

// The keys of docs/commands.md; `planes` and those of the photos follow in Align().
void FillReport(const Alignment& alignment, double reprojection_rms_after, Report* report) {
  Report& r = *report;
  r["scan_from_sparse"] = ToJson(alignment.scan_from_sparse);
  r["scan_from_sparse_from_picks"] = ToJson(alignment.start.scan_from_sparse);
  r["picks"] = PicksToJson(alignment);
  const ScaleEstimate& scale = alignment.start.scale;
  const bool has_scale = scale.num_features > 0;
  r["scale"]["value"] = has_scale ? Json(scale.scale) : Json(nullptr);
  r["scale"]["num_features"] = scale.num_features;
  r["scale"]["relative_mad"] = has_scale ? Json(scale.relative_mad) : Json(nullptr);
  r["planes"] = Json::array();
  const bool refined = alignment.fit.refined;
  const SimilarityFit& fit = alignment.fit.surface;
  // Of the similarity by the picks and the refined one; the adjustment has its own below.
  r["plane_rms_m"]["before"] = refined ? Json(fit.rms_before) : Json(nullptr);
  r["plane_rms_m"]["after"] = refined ? Json(fit.rms_after) : Json(nullptr);
  r["plane_rms_m"]["num_points"] = refined ? fit.num_points : 0;
  const PlaneBundle& bundle = alignment.adjustment.bundle;
  if (alignment.adjusted()) {
    r["plane_rms_m"]["before"] = bundle.plane_rms_before;
    r["plane_rms_m"]["after"] = bundle.plane_rms_after;
    r["plane_rms_m"]["num_points"] = bundle.constraints.size();
  }
  r["plane_bundle"] = PlaneBundleToJson(alignment);
  r["reprojection_rms_px"]["before"] = alignment.reprojection_rms_px;
  r["reprojection_rms_px"]["after"] = reprojection_rms_after;
  r["placement"] = PlacementToJson(alignment.placement);
  r["expected_error"] = ExpectedErrorToJson(alignment.expected_error);
  r["surface_geometry"] = refined ? OpenDirectionsToJson(alignment.open) : Json(nullptr);
  r["agreement"] = nullptr;
}

// The model on the Earth, with --geo_origin; the report's `geo`.
void WriteGeo(const Arguments& a, const SparseModel& aligned, const PlacedScans& placed,
              const std::optional<GeoReference>& geo, const Command::Context& context) {
  const std::string folder = a.output_path + "/geo";
  context.report["geo"] = nullptr;
  if (a.geo_origin.empty() && std::filesystem::exists(folder + "/geo.json")) {
    context.Warn(folder + " is from an earlier run: without --geo_origin it is not written anew");
  }
  if (!geo) return;
  if (!a.geo_origin.empty()) WriteGeoModel(aligned, *geo, folder);
  const GpsCheck gps = CheckGps(aligned, *geo, a.image_path);
  context.report["geo"] = GeoToJson(*geo, placed, gps);
  for (const std::string& warning : GeoWarnings(aligned, *geo, gps)) context.Warn(warning);
}

// What photos and scan say about each other; the report's `agreement` and `overlays`.
void CompareWithPhotos(const Arguments& a, const SparseModel& aligned,
                       const SurveyedScans& surveyed, const Command::Context& context) {
  context.report["overlays"] = Json::array();
  if (a.image_path.empty()) return;
  context.progress.Stage("agreement");
  const int num_threads = context.options.num_threads;
  std::vector<std::string> warnings;
  const AgreementOptions options;
  const Agreement agreement =
      MeasureAgreement(aligned, a.image_path, surveyed.viewer(), options, num_threads, &warnings);
  context.report["agreement"] = AgreementToJson(agreement, options);
  if (agreement.gradient.contradicts) context.report.SetUntrusted(agreement.gradient.reason);
  if (a.overlays > 0) {
    context.progress.Stage("overlays");
    for (const std::string& path :
         WriteOverlays(aligned, a.image_path, a.output_path + "/overlays", surveyed.viewer(),
                       a.overlays, OverlayOptions(), num_threads, &warnings)) {
      context.report["overlays"].push_back(path);
    }
  }
  for (const std::string& warning : warnings) context.Warn(warning);
}

// The planes of the scans (thesis 7.2), where they are asked for.
std::vector<ScanPlane> DetectPlanes(const Arguments& a, const SurveyedScans& surveyed,
                                    const Command::Context& context) {
  if (!a.alignment.plane_constrained && a.planes_path.empty()) return {};
  context.progress.Stage("planes");
  const std::vector<ScanPlane>& planes = surveyed.planes();
  if (!a.planes_path.empty()) {
    WriteScanPlanes(a.planes_path, surveyed.scans(), planes, context.options.num_threads);
  }
  return planes;
}

// None if the files contradict each other; the report then says so.
std::optional<Alignment> FindAlignment(const Arguments& a, const AlignmentInput& input,
                                       const Command::Context& context) {
  try {
    return AlignToScan(input, a.alignment, &context.progress);
  } catch (const Contradiction& contradiction) {
    context.report.SetUntrusted(contradiction.what());
    context.report["scan_from_sparse"] = nullptr;
    MakeFolder(a.output_path);
    context.report.AddCopy(a.output_path + "/alignment.json");
    return std::nullopt;
  }
}

void Align(const Arguments& a, const Command::Context& context) {
  CheckArguments(a);
  context.progress.Stage("read model");
  std::vector<std::string> face_warnings;
  SparseModel model = ReadModelOfPanoramas(a.input_path, a.panoramas_path, &face_warnings);
  for (const std::string& warning : face_warnings) context.Warn(warning);
  const std::vector<Pick> picks = ReadPicks(a.picks_path);
  CheckPicksAgainstModel(a.picks_path, picks, model);
  context.progress.Stage("read scan");
  const PlacedScans placed = ReadPlacedScans(a.scan_paths, a.scan_poses, a.scan_reader);
  const std::optional<GeoReference> geo = FindGeoReference(placed, ParseGeoOrigin(a.geo_origin));
  SurveyOptions options{a.alignment.surface, a.planes, a.alignment.mesh};
  options.num_threads = context.options.num_threads;
  const SurveyedScans surveyed(placed.scans, options);
  const std::vector<ScanPlane> planes = DetectPlanes(a, surveyed, context);
  const std::optional<Alignment> found =
      FindAlignment(a, {model, surveyed, picks, a.picks_path, a.scan_reader.azimuth}, context);
  if (!found) return;
  const Alignment& alignment = *found;
  for (const std::string& warning : alignment.warnings) context.Warn(warning);
  for (const std::string& reason : alignment.reasons) context.report.SetUntrusted(reason);

  context.progress.Stage("write");
  if (alignment.adjusted()) {
    model = alignment.adjustment.bundle.model;
  } else {
    TransformModel(alignment.scan_from_sparse, &model);
  }
  const ReprojectionErrors after = UpdateReprojectionErrors(&model);
  FillReport(alignment, after.rms_px, &context.report);
  context.report["images"] = PhotosToJson(alignment, model);
  context.report["planes"] = ScanPlanesToJson(planes, model);
  SetNumPointsOfPlanes(alignment, &context.report["planes"]);
  WriteSparseModel(model, a.output_path);
  WriteSimilarity(a.output_path + "/scan_from_sparse.txt", alignment.scan_from_sparse);
  WriteSimilarityMatrix(a.output_path + "/scan_from_sparse_matrix.txt", alignment.scan_from_sparse);
  WriteGeo(a, model, placed, geo, context);
  context.report.AddCopy(a.output_path + "/alignment.json");
  CompareWithPhotos(a, model, surveyed, context);
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  roomtex::Arguments arguments;
  roomtex::Command command(
      "roomtex-align", "Brings COLMAP's sparse model into the frame of a range scan, by picks.",
      "roomtex-align --input_path sparse/0 --scan_path room.rtpi --picks_path picks.csv "
      "--output_path aligned");
  roomtex::AddOptions(&arguments, &command);
  return command.Run(argc, argv, [&arguments](const roomtex::Command::Context& context) {
    roomtex::Align(arguments, context);
  });
}
