#include "align/command/align_photos.h"

#include <algorithm>
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
                                                 const PhotoModel& photos, const FoundPhotos& found,
                                                 const Command::Context& context,
                                                 std::string* refusal) {
  try {
    return AlignPhotos(input, photos, found, a.alignment, &context.progress);
  } catch (const MirroredScan& mirrored) {
    context.report["mirrored"] = "scan";
    *refusal = mirrored.what();
    return std::nullopt;
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
  CompareWithPhotos(a, {found->model, a.image_path}, *reading->surveyed, told, context);
  WriteAligned(a, found->model, {}, std::nullopt, reading, told, context);
}

// Photos each by itself, without the picks for a pose. Of RTPI scans the other reading, too, where
// in this one none of them is found and nobody said how to read.
FoundPhotos SearchPhotos(const AlignCommandOptions& a, const PhotoModel& photos,
                         const PhotoHints& hints, bool may_turn, ScanReading* reading,
                         const Command::Context& context) {
  const auto find = [&](const SurveyedScans& surveyed) {
    return FindPhotos(photos, surveyed, a.image_path, hints, FoundPhotoOptions(), a.alignment.trust,
                      context.options.num_threads, &context.progress);
  };
  FoundPhotos found = find(*reading->surveyed);
  if (!found.views.empty() || !may_turn || !MayTurn(a, *reading)) return found;
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

// Those with fewer picks than a pose asks for.
PhotoModel WithFewPicks(const PhotoModel& photos, const std::vector<Pick>& picks) {
  PhotoModel few = photos;
  for (const auto& [id, image] : photos.model.images) {
    const auto is_of_it = [&, &image = image](const Pick& pick) {
      return pick.image_name == image.name && pick.weight > 0;
    };
    if (std::count_if(picks.begin(), picks.end(), is_of_it) < kMinPicksPerPhoto) continue;
    few.model.images.erase(id);
    few.model.cameras.erase(image.camera_id);
  }
  return few;
}

// Photos of which none has the picks for a pose.
void AlignFoundPhotosOnly(const AlignCommandOptions& a, const PhotoModel& photos, PhotoHints hints,
                          const Command::Context& context) {
  const std::set<std::string> told = LookForPhotos(a, {&photos.model}, context);
  context.progress.Stage("read scan");
  ScanReading reading(a, context);
  reading.origin.MoveToLocal(&hints.picks);
  reading.origin.MoveToLocal(&hints.near);
  const FoundPhotos found = SearchPhotos(a, photos, hints, hints.picks.empty(), &reading, context);
  context.report["search"] = FoundPhotosToJson(found);
  const AlignmentInput input{photos.model, *reading.surveyed, found.picks, "", reading.azimuth()};
  PhotoAlignment placed = AlignFoundPhotos(input, photos, found, a.alignment.trust);
  WritePlanes(a, reading, context);
  if (found.views.empty()) {
    for (const std::string& warning : placed.alignment.warnings) context.Warn(warning);
    return WriteRefusal(a, placed.alignment.reasons[0], reading, context);
  }
  WritePlacedPhotos(a, &placed, &reading, told, context);
}

}  // namespace

void AlignPickedPhotos(const AlignCommandOptions& a, const Command::Context& context) {
  context.progress.Stage("read photos");
  PhotoHints hints;
  hints.picks = ReadPicks(a.picks_path);
  const PhotoModel photos = MakePhotoModel(a.image_path, a.picks_path, hints.picks, a.camera);
  CheckPickNames(a.picks_path, hints.picks, {&photos.model});
  const PhotoModel few = WithFewPicks(photos, hints.picks);
  if (!a.near.empty()) {
    const NearHint near = ParseNearHint(a.near);
    if (few.model.FindImage(near.image_name) != nullptr) {
      hints.near = {near};
    } else {
      context.Warn("--near is not used: " + near.image_name +
                   " is none of the photos that are searched for with fewer picks");
    }
  }
  if (few.model.images.size() == photos.model.images.size()) {
    return AlignFoundPhotosOnly(a, photos, hints, context);
  }
  const std::set<std::string> told = LookForPhotos(a, {&photos.model}, context);
  context.progress.Stage("read scan");
  ScanReading reading(a, context);
  reading.origin.MoveToLocal(&hints.picks);
  reading.origin.MoveToLocal(&hints.near);
  AlignmentInput input{photos.model, *reading.surveyed, hints.picks, a.picks_path,
                       reading.azimuth()};
  input.scan_origin = reading.origin.offset();
  FoundPhotos found;
  context.report["search"] = nullptr;
  if (!few.model.images.empty()) {
    found = SearchPhotos(a, few, hints, false, &reading, context);
    context.report["search"] = FoundPhotosToJson(found);
  }
  std::string refusal;
  std::optional<PhotoAlignment> placed =
      FindPhotoAlignment(a, input, photos, found, context, &refusal);
  WritePlanes(a, reading, context);
  if (!placed) return WriteRefusal(a, refusal, reading, context);
  WritePlacedPhotos(a, &*placed, &reading, told, context);
}

void AlignFoundPhotosAlone(const AlignCommandOptions& a, const Command::Context& context) {
  context.progress.Stage("read photos");
  const std::vector<std::string> names =
      ListPhotoFiles(a.image_path, "Check --image_path", /*below=*/true);
  const PhotoModel photos = MakePhotoModel(a.image_path, names, a.camera, UnfitPhotos::kTaken);
  PhotoHints hints;
  if (!a.near.empty()) {
    hints.near.push_back(ParseNearHint(a.near));
    CheckPhotoName("--near", hints.near[0].image_name, PhotoNames({&photos.model}),
                   "among those of --image_path");
  }
  AlignFoundPhotosOnly(a, photos, std::move(hints), context);
}

}  // namespace roomtex
