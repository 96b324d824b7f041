#include "align/command/align_photos.h"

#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "align/command/align_outputs.h"
#include "align/command/alignment_report.h"
#include "align/command/scan_reading.h"
#include "align/command/search_report.h"
#include "align/found_photos.h"
#include "align/mirrored_reading.h"
#include "align/photo_alignment.h"
#include "core/error.h"
#include "core/photo_files.h"

namespace roomtex {
namespace {

// None if the files contradict each other; `refusal` then says why.
std::optional<PhotoAlignment> FindPhotoAlignment(const AlignCommandOptions& a,
                                                 const AlignmentInput& input,
                                                 const PhotoModel& photos,
                                                 const Command::Context& context,
                                                 std::string* refusal) {
  try {
    return AlignPhotos(input, photos, a.alignment, &context.progress);
  } catch (const Contradiction& contradiction) {
    *refusal = contradiction.what();
    return std::nullopt;
  }
}

// The report of photos that were placed, and the model of them.
void WritePlacedPhotos(const AlignCommandOptions& a, PhotoAlignment* found, ScanReading* reading,
                       const std::set<std::string>& told, const Command::Context& context) {
  for (const std::string& note : found->notes) context.progress.Note(note);
  for (const std::string& warning : found->alignment.warnings) context.Warn(warning);
  for (const std::string& reason : found->alignment.reasons) context.report.SetUntrusted(reason);

  ColorPoints(a.image_path, &found->model);
  const ReprojectionErrors after = UpdateReprojectionErrors(&found->model);
  FillReport(found->alignment, after.rms_px, &context.report);
  NullWithoutModel(&context.report);
  context.report["images"] = PhotosToJson(found->alignment, found->model);
  AddLenses(*found, &context.report["images"]);
  CompareWithPhotos(a, found->model, *reading->surveyed, told, context);
  WriteAligned(a, found->model, std::nullopt, reading, told, context);
}

// Photos each by itself, without picks. Of RTPI scans the other reading, too, where in this one
// none of them is found and nobody said how to read.
FoundPhotos SearchPhotos(const AlignCommandOptions& a, const PhotoModel& photos,
                         ScanReading* reading, const Command::Context& context) {
  const auto find = [&](const SurveyedScans& surveyed) {
    return FindPhotos(photos, surveyed, a.image_path, FoundPhotoOptions(), a.alignment.trust,
                      context.options.num_threads, &context.progress);
  };
  FoundPhotos found = find(*reading->surveyed);
  if (!found.views.empty() || !MayTurn(a, *reading)) return found;
  MirroredReading other;
  other.scans = std::make_unique<const std::vector<Scan>>(MirrorScans(reading->surveyed->scans()));
  other.surveyed =
      std::make_unique<const SurveyedScans>(*other.scans, reading->surveyed->options());
  FoundPhotos again = find(*other.surveyed);
  if (again.views.empty()) return found;
  other.evidence = "only in the other reading the photos show what the scan shows";
  TakeMirroredReading(std::move(other), reading, context);
  return again;
}

}  // namespace

void AlignPickedPhotos(const AlignCommandOptions& a, const Command::Context& context) {
  context.progress.Stage("read photos");
  std::vector<Pick> picks = ReadPicks(a.picks_path);
  const PhotoModel photos = MakePhotoModel(a.image_path, a.picks_path, picks, a.camera);
  CheckPickNames(a.picks_path, picks, {&photos.model});
  const std::set<std::string> told = LookForPhotos(a, {&photos.model}, context);
  context.progress.Stage("read scan");
  ScanReading reading(a, context);
  reading.origin.MoveToLocal(&picks);
  AlignmentInput input{photos.model, *reading.surveyed, picks, a.picks_path, reading.azimuth()};
  input.scan_origin = reading.origin.offset();
  std::string refusal;
  std::optional<PhotoAlignment> found = FindPhotoAlignment(a, input, photos, context, &refusal);
  if (!found) return WriteRefusal(a, refusal, reading.origin, context);
  WritePlacedPhotos(a, &*found, &reading, told, context);
}

void AlignFoundPhotosAlone(const AlignCommandOptions& a, const Command::Context& context) {
  context.progress.Stage("read photos");
  const std::vector<std::string> names =
      ListPhotoFiles(a.image_path, "Check --image_path", /*below=*/true);
  const PhotoModel photos = MakePhotoModel(a.image_path, names, a.camera, UnfitPhotos::kTaken);
  const std::set<std::string> told = LookForPhotos(a, {&photos.model}, context);
  context.progress.Stage("read scan");
  ScanReading reading(a, context);
  const FoundPhotos found = SearchPhotos(a, photos, &reading, context);
  context.report["search"] = FoundPhotosToJson(found);
  const AlignmentInput input{photos.model, *reading.surveyed, found.picks, "", reading.azimuth()};
  PhotoAlignment placed = AlignFoundPhotos(input, photos, found, a.alignment.trust);
  if (found.views.empty()) {
    for (const std::string& warning : placed.alignment.warnings) context.Warn(warning);
    return WriteRefusal(a, placed.alignment.reasons[0], reading.origin, context);
  }
  WritePlacedPhotos(a, &placed, &reading, told, context);
}

}  // namespace roomtex
