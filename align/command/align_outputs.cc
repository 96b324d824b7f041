#include "align/command/align_outputs.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <memory>
#include <utility>
#include <vector>

#include "align/geo/geo_output.h"
#include "align/trust/agreement.h"
#include "align/trust/agreement_report.h"
#include "align/trust/overlay.h"
#include "align/trust/photo_comparison.h"
#include "align/trust/scan_view.h"
#include "colmap_ext/model_output.h"
#include "core/commit_together.h"
#include "core/output_file.h"
#include "core/output_set.h"
#include "core/photo_fit.h"
#include "core/result_names.h"
#include "core/standard_files.h"
#include "importers/scan_record.h"

namespace roomtex {
namespace {

constexpr char kTransformName[] = "scan_from_sparse.txt",
               kMatrixName[] = "scan_from_sparse_matrix.txt", kOverlayFolder[] = "overlays",
               kGeoFolder[] = "geo";

// The model on the Earth, with --geo_origin; the report's `geo`.
void WriteGeo(const AlignCommandOptions& a, const SparseModel& aligned, const PlacedScans& placed,
              const std::optional<GeoReference>& geo, const OutputSet& outputs,
              const Command::Context& context) {
  const std::string folder = outputs.folder() + "/" + kGeoFolder;
  context.report["geo"] = nullptr;
  if (a.geo_origin.empty() && std::filesystem::exists(folder + "/geo.json")) {
    context.Warn(folder + " is from an earlier run: without --geo_origin it is not written anew");
  }
  if (!geo) return;
  if (!a.geo_origin.empty()) {
    WriteGeoModel(aligned, *geo, outputs.aside() + "/" + kGeoFolder, context.report.reason());
  }
  const GpsCheck gps = CheckGps(aligned, *geo, a.image_path);
  context.report["geo"] = GeoToJson(*geo, placed, gps);
  for (const std::string& warning : GeoWarnings(aligned, *geo, gps)) context.Warn(warning);
}

// Warnings "START: REASON" of photos whose reason was not told before.
void WarnOfPhotos(const AlignCommandOptions& a, const std::vector<std::string>& warnings,
                  const std::string& start, const std::set<std::string>& told,
                  const Command::Context& context) {
  for (const std::string& warning : warnings) {
    const std::string reason =
        warning.compare(0, start.size(), start) == 0 ? warning.substr(start.size()) : warning;
    if (told.count(reason) > 0) continue;
    if (a.strict) ThrowIfAnyLeftOut({{"", reason}}, a.image_path);
    context.Warn(warning);
  }
}

// The report's `overlays`.
void WriteOverlayPictures(const AlignCommandOptions& a, const AlignedPhotos& aligned,
                          const SurveyedScans& surveyed, const std::set<std::string>& told,
                          OutputSet* outputs, const Command::Context& context) {
  context.report["overlays"] = Json::array();
  outputs->ReplaceFolder(kOverlayFolder);  // those of another alignment show another one
  if (a.overlays == 0) return;
  context.progress.Stage("overlays");
  std::vector<std::string> warnings;
  for (const std::string& path :
       WriteOverlays(aligned, outputs->aside() + "/" + kOverlayFolder, surveyed.viewer(),
                     a.overlays, OverlayOptions(), context.options.num_threads, &warnings)) {
    context.report["overlays"].push_back(outputs->folder() + path.substr(outputs->aside().size()));
  }
  WarnOfPhotos(a, warnings, "Overlay: ", told, context);
}

std::string UntrustedPath(std::string output_path) {
  while (output_path.size() > 1 && output_path.back() == '/') output_path.pop_back();
  return output_path + ".untrusted";
}

// An untrusted result of an earlier run stays beside this one, and nobody shall take it for newer.
void WarnOfUntrusted(const AlignCommandOptions& a, const Command::Context& context) {
  const std::string aside = UntrustedPath(a.output_path);
  if (!ReadAlignmentRecord(aside).found) return;
  context.Warn(aside + " is of an earlier run, which was not to be trusted: this one is in " +
               a.output_path + ". Remove " + aside + " if nothing needs it");
}

// Cut into faces, or placed without a model, panoramas need no COLMAP that knows them: the user's
// may be an older one, which ends with a stack trace on what is written here.
void WarnOfPanoramas(const AlignCommandOptions& a, const SparseModel& model,
                     const std::string& output_path, const Command::Context& context) {
  if (!a.input_path.empty() && a.panoramas_path.empty()) return;
  const bool has_some = std::any_of(model.cameras.begin(), model.cameras.end(),
                                    [](const auto& camera) { return camera.second.IsPanorama(); });
  if (!has_some) return;
  context.Warn("The model in " + output_path +
               " has panoramas (EQUIRECTANGULAR), which COLMAP reads from 4.1 on: older ones end "
               "with an error. For those look at it with roomtex-texture and roomtex-view, which "
               "read it as it is");
}

// Where the result goes: a trusted one that is there is kept.
std::string ChooseOutput(const AlignCommandOptions& a, const Command::Context& context) {
  if (context.report.trusted()) return a.output_path;
  const AlignmentRecord there = ReadAlignmentRecord(a.output_path);
  if (!there.found || !there.trusted) return a.output_path;
  const std::string output_path = UntrustedPath(a.output_path);
  context.Warn("The trusted result in " + a.output_path + " is kept; this one is in " +
               output_path + ".");
  return output_path;
}

}  // namespace

std::vector<std::string> FilesOfAlignedModel() {
  std::vector<std::string> names(std::begin(kSparseModelFiles), std::end(kSparseModelFiles));
  names.insert(names.end(), {kTransformName, kMatrixName});
  return names;
}

std::set<std::string> LookForPhotos(const AlignCommandOptions& a,
                                    const std::vector<const SparseModel*>& models,
                                    const Command::Context& context) {
  std::set<std::string> told;
  std::vector<PhotoLeftOut> left_out;
  if (a.image_path.empty()) {
    ReportPhotosLeftOut(left_out, context);
    return told;
  }
  std::vector<std::string> notes;
  std::set<std::string> names;
  for (const SparseModel* model : models) {
    for (const SparseImage* image : SpreadImages(*model, static_cast<int>(model->images.size()))) {
      if (!names.insert(image->name).second) continue;
      const Camera& camera = model->cameras.at(image->camera_id);
      const PhotoFit fit = FitPhotoToCamera(a.image_path + "/" + image->name, image->name,
                                            camera.width, camera.height);
      if (!fit.note.empty()) notes.push_back(fit.note);
      if (fit.usable()) continue;
      left_out.push_back({image->name, fit.problem});
      told.insert(fit.problem);
    }
  }
  if (a.strict) ThrowIfAnyLeftOut(left_out, a.image_path);
  ReportPhotosLeftOut(left_out, context);
  for (const std::string& note : FirstNotes(notes)) context.Warn(note);
  return told;
}

WhatPhotosSay CompareWithPhotos(const AlignCommandOptions& a, const AlignedPhotos& aligned,
                                const SurveyedScans& surveyed, const std::set<std::string>& told,
                                const Command::Context& context) {
  if (a.image_path.empty()) return {};
  context.progress.Stage("agreement");
  std::vector<std::string> warnings;
  const AgreementOptions options;
  const Agreement agreement =
      MeasureAgreement(aligned, surveyed.viewer(), options, context.options.num_threads, &warnings);
  context.report["agreement"] = AgreementToJson(agreement, options);
  if (agreement.gradient.contradicts) context.report.SetUntrusted(agreement.gradient.reason);
  WarnOfPhotos(a, warnings, "Agreement: ", told, context);
  const PhotoComparison comparison = ComparePhotosOnScan(
      aligned, surveyed.viewer(), PhotoComparisonOptions(), context.options.num_threads);
  context.report["divided_photos"] = ToJson(comparison);
  if (comparison.Contradicts()) {
    context.report.SetUntrusted(
        "Photos contradict each other where they see the same of the scan (divided_photos): they "
        "stand elsewhere than they were aligned, all of them, or some, so that the sparse model is "
        "folded. Two projectors with one pattern or rooms that look alike do that: leave the "
        "photos of one out, or map them apart. So do photos with and without a pattern in one "
        "folder: give the plain ones.");
  }
  const std::optional<double> shown = agreement.gradient.shifts.ShownShare();
  const bool is_this_room = !shown || *shown >= a.alignment.trust.min_shown_share;
  return {agreement.gradient.supports && is_this_room && comparison.Agrees(), shown};
}

void WritePlanes(const AlignCommandOptions& a, const ScanReading& reading,
                 const Command::Context& context) {
  CommitFilesAtEnd();
  if (a.planes_path.empty()) return;
  WriteScanPlanes(a.planes_path, reading.surveyed->scans(), reading.surveyed->planes(),
                  context.options.num_threads, reading.origin.offset());
}

void WriteRefusal(const AlignCommandOptions& a, const std::string& refusal,
                  const ScanReading& reading, const Command::Context& context) {
  reading.origin.MoveBack(&context.report.keys());
  context.report.SetUntrusted(refusal);
  JudgeStations(reading, context);
  for (const char* key :
       {"scan_from_sparse", "picks", "scale", "planes", "plane_rms_m", "reprojection_rms_px",
        "expected_error", "agreement", "images", "search", "mirrored"}) {
    if (!context.report.keys().contains(key)) context.report[key] = nullptr;
  }
  const std::string output_path = ChooseOutput(a, context);
  const auto outputs = std::make_shared<OutputSet>(output_path);
  if (ReadAlignmentRecord(output_path).found) {
    // An earlier result that is not trusted either: the report of this one must not speak of it.
    for (const std::string& name : FilesOfAlignedModel()) outputs->Remove(name);
    for (const char* name : {kOverlayFolder, kGeoFolder}) outputs->ReplaceFolder(name);
  }
  CommitWithReport(kAlignReportName, outputs);
  AnswerAtEnd(output_path + "\n");
}

void WriteAligned(const AlignCommandOptions& a, SparseModel model, const RowMotions& row_motions,
                  const std::optional<Similarity>& local_from_sparse, ScanReading* reading,
                  const std::set<std::string>& told, const Command::Context& context) {
  JudgeStations(*reading, context);
  const std::string output_path = ChooseOutput(a, context);
  if (context.report.trusted()) WarnOfUntrusted(a, context);
  RequireNoRigs(output_path);
  WarnOfPanoramas(a, model, output_path, context);
  const auto outputs = std::make_shared<OutputSet>(output_path);
  WriteOverlayPictures(a, {model, a.image_path, row_motions}, *reading->surveyed, told,
                       outputs.get(), context);
  context.progress.Stage("write");
  reading->origin.MoveBack(&model);
  reading->origin.MoveBack(&reading->placed.scans);
  reading->placed.Reorder(reading->as_named);
  reading->origin.MoveBack(&context.report.keys());
  WriteSparseModel(model, outputs->aside());
  if (local_from_sparse) {
    const Similarity scan_from_sparse = reading->origin.MovedBack(*local_from_sparse);
    WriteSimilarity(outputs->Path(kTransformName), scan_from_sparse);
    WriteSimilarityMatrix(outputs->Path(kMatrixName), scan_from_sparse);
  } else {
    // One of an earlier run would contradict.
    outputs->Remove(kTransformName);
    outputs->Remove(kMatrixName);
  }
  WriteGeo(a, model, reading->placed, reading->geo, *outputs, context);
  context.report["scans"] = ToJson(RecordScans(reading->placed, output_path));
  CommitWithReport(kAlignReportName, outputs);
  AnswerAtEnd(output_path + "\n");
}

}  // namespace roomtex
