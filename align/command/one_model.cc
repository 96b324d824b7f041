#include "align/command/one_model.h"

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "align/alignment.h"
#include "align/automatic_alignment.h"
#include "align/command/align_outputs.h"
#include "align/command/alignment_report.h"
#include "align/command/lens_report.h"
#include "align/command/plane_bundle_report.h"
#include "align/command/scan_reading.h"
#include "align/command/search_report.h"
#include "align/mirrored_reading.h"
#include "align/surface/scan_planes_report.h"
#include "align/trust/disagreement.h"
#include "align/trust/photo_verdict.h"
#include "colmap_ext/database.h"
#include "colmap_ext/duplicate_photos.h"
#include "colmap_ext/lens_labels.h"
#include "colmap_ext/mapper_verdict.h"
#include "colmap_ext/match_support.h"
#include "colmap_ext/panorama_model.h"
#include "core/commit_together.h"
#include "core/error.h"
#include "importers/photo_picks.h"
#include "importers/scan_record.h"

namespace roomtex {
namespace {

// What was searched for, from here on the attempt.
void TakeAutomatic(AutomaticAlignment found, ScanReading* reading) {
  reading->search = SearchToJson(found);
  reading->attempt = std::move(found.attempt);
}

// Aligns without picks, or with few as a hint. A mirrored scan is read the other way, as below.
void SearchScans(const AlignmentInput& input, const std::vector<NearHint>& near,
                 const AlignmentOptions& options, bool may_turn, ScanReading* reading,
                 const Command::Context& context) {
  AutomaticAlignment found = AlignAutomatically(input, near, options, &context.progress);
  const bool turns = found.attempt.says_mirrored && may_turn;
  TakeAutomatic(std::move(found), reading);
  if (!turns) return;
  MirroredReading other;
  other.scans = std::make_unique<const std::vector<Scan>>(MirrorScans(input.surveyed.scans()));
  other.surveyed = std::make_unique<const SurveyedScans>(*other.scans, input.surveyed.options());
  const AlignmentInput turned = input.With(input.model, *other.surveyed, input.picks);
  AutomaticAlignment again = AlignAutomatically(turned, near, options, &context.progress);
  if (!again.attempt.alignment) return;
  reading->search = SearchToJson(again);
  other.attempt = std::move(again.attempt);
  other.evidence = "without picks, only the other reading fits the photos";
  TakeMirroredReading(std::move(other), reading, context);
}

// Places of the scans in the photos that are known to stand somewhere: those that roomtex-mapper
// holds there, in `model`, hold what the surface leaves open; those of a single standpoint, of
// which only the poses in the file are known, put a model of any frame into the scan, its scale by
// the depth of its points in them.
std::vector<Pick> PicksOfKnownPhotos(const MapperVerdict& verdict, const SparseModel& model,
                                     const Eigen::Vector3d& origin,
                                     const std::vector<Scan>& scans) {
  std::vector<PosedPhoto> photos;
  const auto add = [&](const std::string& name, const Rigid* told) {
    const SparseImage& image = *model.FindImage(name);
    photos.push_back(
        {name, model.cameras.at(image.camera_id), told ? *told : image.cam_from_model});
  };
  for (const std::string& name : verdict.photos_held) add(name, nullptr);
  for (auto [name, cam_from_scan] : verdict.told_poses) {
    cam_from_scan.translation += cam_from_scan.rotation * origin;
    add(name, &cam_from_scan);
  }
  std::vector<Pick> picks;
  for (const PhotoPick& pick : PicksOfPosedPhotos(photos, scans)) {
    picks.push_back({pick.image_name, pick.x_in_img, pick.x_in_scan});
  }
  return picks;
}

// From rough poses of photos, by which roomtex-mapper has put the model into the scan's frame and
// which hold nothing. False: that is not to be trusted, and the place has to be searched for.
bool AlignFromKnownPoses(const AlignCommandOptions& a, const AlignmentInput& input,
                         const AlignmentOptions& options, double known_rms, ScanReading* reading,
                         const Command::Context& context) {
  // Metres, one standard deviation: scanners know the places of their cameras to centimetres.
  constexpr double kLeastSigma = 0.03;
  AlignmentAttempt attempt;
  attempt.alignment = AlignToScan(
      input,
      StartFromSimilarity(input.model, input.picks, Similarity(), std::max(kLeastSigma, known_rms)),
      options, &context.progress);
  if (!attempt.trusted() && !a.image_path.empty()) {
    context.Warn("the model does not lie in the scan where the known poses put it (" +
                 attempt.alignment->reasons[0] + "); its place is searched for");
    return false;
  }
  reading->attempt = std::move(attempt);
  return true;
}

// By the places of the scans in photos of a single standpoint. False: that is not to be trusted,
// and the place has to be searched for.
bool AlignFromOnePlace(const AlignCommandOptions& a, const AlignmentInput& input,
                       const AlignmentOptions& options, ScanReading* reading,
                       const Command::Context& context) {
  std::string problem;
  try {
    reading->attempt = AttemptAlignment(input, options, &context.progress);
    if (reading->attempt.trusted() || a.image_path.empty()) {
      reading->search = {{"method", "known_poses"}, {"position_rms_m", nullptr}};
      return true;
    }
    problem = reading->attempt.alignment ? reading->attempt.alignment->reasons[0]
                                         : reading->attempt.refusal;
  } catch (const InputError& error) {
    if (a.image_path.empty()) throw;
    problem = error.what();
  }
  context.Warn("the known poses do not put the model into the scan (" + problem +
               "); its place is searched for");
  return false;
}

// Aligns, and finds out whether the scan is mirrored: then reads it the other way, if nobody said
// how and there is no other format among the scans, or says so.
// known_rms: MapperVerdict's. one_place: the picks are those of known photos at one standpoint.
void AlignScans(const AlignCommandOptions& a, const AlignmentInput& input,
                const std::vector<NearHint>& near, const std::optional<double>& known_rms,
                bool one_place, bool may_turn, ScanReading* reading,
                const Command::Context& context) {
  const std::vector<PlacedScans::File>& files = reading->placed.files;
  AlignmentOptions options = a.alignment;
  options.refine_intrinsics = RefineIntrinsicsFromWord(a.refine_intrinsics);
  if (known_rms && input.picks.empty() && near.empty() &&
      AlignFromKnownPoses(a, input, options, *known_rms, reading, context)) {
    return;
  }
  if (one_place) {
    if (AlignFromOnePlace(a, input, options, reading, context)) return;
    static const std::vector<Pick> kNone;
    return SearchScans(input.With(input.model, input.surveyed, kNone), near, options, may_turn,
                       reading, context);
  }
  if (AreHints(input.picks)) {
    return SearchScans(input, near, options, may_turn, reading, context);
  }
  AlignmentAttempt& attempt = reading->attempt;
  attempt = AttemptAlignment(input, options, &context.progress);
  if (attempt.says_mirrored && !may_turn) return;
  MirroredReading found = FindMirroredReading(input, attempt, options, &context.progress);
  if (found.kind == MirroredReading::Kind::kNone) return;
  if (found.kind == MirroredReading::Kind::kScan && may_turn) {
    TakeMirroredReading(std::move(found), reading, context);
  } else if (!attempt.says_mirrored) {
    const bool both = found.kind == MirroredReading::Kind::kScanAndPicks;
    attempt.says_mirrored = true;
    reading->picks_are_mirrored = both;
    attempt.alignment.reset();
    attempt.refusal = MirroredScan(files[0].path,
                                   std::string("the scan is a mirror image of the room") +
                                       (both ? ", and so are the picks: " : ": ") + found.evidence,
                                   MirrorRemedy(input), !both)
                          .what();
  }
}

// The report's `mirrored`: what the refusal says is to be read the other way; null = nothing.
Json MirroredToJson(const ScanReading& reading) {
  if (!reading.attempt.says_mirrored) return nullptr;
  return reading.picks_are_mirrored ? "scan and picks" : "scan";
}

// What roomtex-mapper held against the model. A lens that was adjusted here is no longer the one
// that it refused, and photos are judged here, too. How the cameras moved it had to tell from
// matches alone, which a narrow baseline, a rolling shutter or a wall leave open by degrees: scan
// and photos together know better, where both show the same (photos_agree).
void CarryMapperVerdict(const MapperVerdict& verdict, const Alignment& alignment, bool photos_agree,
                        const Command::Context& context) {
  const std::string source = "roomtex-mapper did not trust the sparse model: ";
  const bool mended =
      alignment.lenses.mended || (alignment.adjusted() && alignment.adjustment.freed);
  for (const std::string& reason : verdict.calibration) {
    if (!mended) context.report.SetUntrusted(source + reason);
  }
  for (const std::string& reason : verdict.motion) {
    if (photos_agree) {
      context.Warn(source + reason +
                   " It is believed all the same: the photos show the scan's intensity where it "
                   "is, and each other's colours.");
    } else {
      context.report.SetUntrusted(source + reason);
    }
  }
  for (const std::string& reason : verdict.photos) context.Warn(source + reason);
}

// Where picks alone say that scan and photos belong together. Photos of another room with the same
// walls and furniture show 0 to 21 % of what the scan shows, those of the right one 59 % and more
// in simulated rooms; a real floor 43 %, a real kitchen and a desk 21 to 32 % (docs/real-rooms.md),
// but these differ from their scans in shape by 25 mm and more: there it takes less to refuse.
void DoubtRoom(const AlignCommandOptions& a, const WhatPhotosSay& photos_say, double disagreement,
               const Command::Context& context) {
  constexpr double kAlikeInShape = 0.02;  // metres
  if (!photos_say.shown_share) return;
  const double least = a.alignment.trust.min_shown_share, shown = *photos_say.shown_share;
  if (shown >= least) return;
  const std::string finding = fmt::format(
      "Of the corners of the scan's intensity the photos show {} where the scan has them (beyond "
      "chance; --Trust.min_shown_share {:g}), as photos of another room with the same walls and "
      "furniture do. Check that scan and photos are of the same room; of photos under a projected "
      "pattern give the plain ones.",
      Percent(shown), least);
  if (disagreement <= kAlikeInShape || shown < 0.5 * least) {
    context.report.SetUntrusted(finding);
  } else {
    context.Warn(finding);
  }
}

// What EXIF says of the photos' lenses, where the photos are given.
LensLabels PhotoLabels(const SparseModel& model, const std::string& image_path) {
  std::map<uint32_t, std::string> names;
  for (const auto& [id, image] : model.images) names[id] = image.name;
  return ReadLensLabels(names, image_path);
}

// Photos that say nothing new, until the others have found their places.
struct DuplicatesAside {
  std::map<uint32_t, uint32_t> photos;  // FindDuplicates()
  SparseModel input;                    // with them; empty if there are none
};

// Takes them out of the model, which is said.
DuplicatesAside SetDuplicatesAside(const MapperVerdict& verdict, const std::vector<Pick>& picks,
                                   const std::vector<NearHint>& near, SparseModel* model,
                                   const Command::Context& context) {
  std::set<std::string> kept(verdict.photos_held.begin(), verdict.photos_held.end());
  for (const auto& [name, pose] : verdict.told_poses) kept.insert(name);
  for (const Pick& pick : picks) kept.insert(pick.image_name);
  for (const NearHint& hint : near) kept.insert(hint.image_name);
  DuplicatesAside aside;
  aside.photos = FindDuplicates(*model, kept);
  if (aside.photos.empty()) return aside;
  const auto& [id, of] = *aside.photos.begin();
  context.Warn(
      fmt::format("{} of {} photos show the same from the same place as another ({} as {}): "
                  "they count once",
                  aside.photos.size(), model->images.size(), model->images.at(id).name,
                  model->images.at(of).name));
  aside.input = std::move(*model);
  std::set<uint32_t> image_ids;
  for (const auto& [duplicate, photo] : aside.photos) image_ids.insert(duplicate);
  *model = WithoutPhotos(aside.input, image_ids);
  return aside;
}

// Where photos can be compared with each other on the surface.
void CompareDoubtfulPhotos(const AlignedPhotos& aligned, const SurveyedScans& surveyed,
                           int num_threads, std::map<uint32_t, PhotoVerdict>* photos) {
  std::set<uint32_t> asked, doubtful;
  for (const auto& [id, photo] : *photos) {
    if (photo.doubt.empty()) continue;
    doubtful.insert(id);
    if (photo.lacks_sights || photo.other_room >= 0) asked.insert(id);
  }
  if (asked.empty() || aligned.image_path.empty()) return;
  BelieveWhatShowsTheSame(
      CompareDetail(aligned, surveyed.viewer(), asked, doubtful, PhotoDetailOptions(), num_threads),
      photos);
}

// Photos that agree with nobody are named; too many of them, and the model is not to be trusted.
std::map<uint32_t, PhotoVerdict> JudgeSinglePhotos(
    const AlignCommandOptions& a, const Database* database, const AlignedPhotos& photographed,
    const std::vector<Pick>& picks, const std::set<uint32_t>& ran_away,
    const SurveyedScans& surveyed, const Command::Context& context) {
  const SparseModel& aligned = photographed.model;
  constexpr double kMostDoubtful = 0.34;
  context.progress.Stage("single photos");
  std::map<uint32_t, double> support;
  if (database != nullptr) {
    support = MatchSupport(*database, aligned, HypothesisOptions());
    if (support.empty()) {
      context.Warn(a.database_path +
                   " holds no verified matches between photos of the model: none were asked");
    }
  }
  std::set<uint32_t> picked;
  for (const Pick& pick : picks) {
    const SparseImage* const image = aligned.FindImage(pick.image_name);
    if (image != nullptr && pick.weight > 0) picked.insert(image->image_id);
  }
  auto photos = JudgePhotos(aligned, surveyed.patches(), surveyed.free_space(),
                            SurfaceTolerance(a.alignment.trust, surveyed.patches()),
                            KeypointSigma(aligned), support, picked);
  for (const uint32_t id : ran_away) {
    PhotoVerdict& photo = photos.at(id);
    // Whatever it shows, its pose is not to be believed.
    photo.lacks_sights = false;
    photo.other_room = -1;
    if (!photo.doubt.empty()) continue;
    photo.doubt =
        "its points want it elsewhere than the sparse model has it, so that it was not adjusted to "
        "the scan, and how far it is off is not known";
  }
  CompareDoubtfulPhotos(photographed, surveyed, context.options.num_threads, &photos);
  size_t num_doubtful = 0;
  for (const auto& [id, photo] : photos) {
    if (photo.doubt.empty()) continue;
    ++num_doubtful;
    context.Warn(aligned.images.at(id).name +
                 " is doubtful and takes no part in colours: " + photo.doubt);
  }
  if (static_cast<double>(num_doubtful) > kMostDoubtful * static_cast<double>(photos.size())) {
    context.report.SetUntrusted(
        fmt::format("{} of {} photos are doubtful (the report's `images` say why): which of them "
                    "are right cannot be told.",
                    num_doubtful, photos.size()));
  }
  return photos;
}

// A model that roomtex-align moved onto a scan of another shape fits that scan better than it knows
// the room: what is left between them says nothing of the error any more.
void DoubtAlignedBefore(const std::string& input_path, const Command::Context& context) {
  const AlignmentRecord before = ReadAlignmentRecord(input_path);
  if (before.disagreement < kSameShape) return;
  context.report.SetUntrusted(fmt::format(
      "{} was aligned before, where model and scan differed in shape by {:.0f} mm: it was moved "
      "onto the scan there, so that nothing shows the difference now. Align the sparse model that "
      "it was made of.",
      input_path, 1000 * before.disagreement));
}

}  // namespace

ModelToAlign ReadModelToAlign(const AlignCommandOptions& options, const Command::Context& context) {
  ModelToAlign one;
  one.options = options;
  std::vector<std::string> face_warnings;
  one.model = ReadModelOfPanoramas(options.input_path, options.panoramas_path, &face_warnings);
  for (const std::string& warning : face_warnings) context.Warn(warning);
  // The mapper judged the faces, where there are some; what it knows of single ones is theirs.
  one.verdict = ReadMapperVerdict(options.input_path, options.panoramas_path.empty()
                                                          ? one.model
                                                          : ReadSparseModel(options.input_path));
  if (!options.panoramas_path.empty()) {
    one.verdict.photos_held.clear();
    one.verdict.told_poses.clear();
  }
  return one;
}

std::vector<NearHint> ReadHints(const AlignCommandOptions& a, const std::vector<Pick>& picks,
                                const SparseModel& model, const Command::Context& context) {
  if (a.picks_path.empty() || (AreHints(picks) && !a.image_path.empty())) {
    CheckPickNames(a.picks_path, picks, {&model});
  } else {
    CheckPicksAgainstModel(a.picks_path, picks, model);
  }
  if (a.near.empty()) return {};
  const NearHint near = ParseNearHint(a.near);
  CheckPhotoName("--near", near.image_name, PhotoNames({&model}), "in the sparse model");
  if (!AreHints(picks)) {
    context.Warn("--near is not used: six picks place the model without a search");
    return {};
  }
  return {near};
}

void MoveToLocal(const ScanReading& reading, ModelToAlign* one) {
  reading.origin.MoveToLocal(&one->picks);
  reading.origin.MoveToLocal(&one->near);
}

std::vector<ScanPlane> PlanesOf(const AlignCommandOptions& a, const SurveyedScans& surveyed) {
  if (!a.alignment.plane_constrained && a.planes_path.empty()) return {};
  return surveyed.planes();
}

std::optional<AlignedModel> AlignOne(ModelToAlign one, const Database* database, bool may_turn,
                                     ScanReading* reading, std::string* refusal,
                                     const Command::Context& context) {
  const AlignCommandOptions& a = one.options;
  const MapperVerdict& verdict = one.verdict;
  SparseModel& model = one.model;
  // A model that is in the scan's frame already moves about the same origin.
  Similarity local_from_sparse;
  if (verdict.known_rms) {
    local_from_sparse.translation = -reading->origin.offset();
    TransformModel(local_from_sparse, &model);
  }
  if (a.picks_path.empty() && one.near.empty()) {
    one.picks =
        PicksOfKnownPhotos(verdict, model, reading->origin.offset(), reading->surveyed->scans());
  }
  const bool one_place = !one.picks.empty() && !verdict.told_poses.empty() && a.picks_path.empty();
  if (!verdict.known_rms && !one_place) RequirePicksOrPhotos(a);
  const DuplicatesAside duplicates =
      SetDuplicatesAside(verdict, one.picks, one.near, &model, context);
  context.progress.Stage("planes");
  PlanesOf(a, *reading->surveyed);
  AlignmentInput input{model, *reading->surveyed, one.picks, a.picks_path, reading->azimuth()};
  input.photo_labels = PhotoLabels(model, a.image_path);
  input.lenses_refined = verdict.refined;
  input.image_path = a.image_path;
  input.num_threads = context.options.num_threads;
  input.scan_origin = reading->origin.offset();
  reading->search = Json();
  reading->picks_are_mirrored = false;
  AlignScans(a, input, one.near, verdict.known_rms, one_place, may_turn, reading, context);
  if (verdict.known_rms && reading->search.is_null() && a.picks_path.empty()) {
    reading->search = {{"method", "known_poses"}, {"position_rms_m", *verdict.known_rms}};
  }
  context.report["search"] = reading->search;
  context.report["mirrored"] = MirroredToJson(*reading);
  AlignedModel aligned;
  const std::vector<ScanPlane> planes = PlanesOf(a, *reading->surveyed);
  if (!reading->attempt.alignment) {
    *refusal = reading->attempt.refusal;
    return std::nullopt;
  }
  Alignment& alignment = *reading->attempt.alignment;
  for (const std::string& warning : alignment.warnings) context.Warn(warning);
  for (const std::string& reason : alignment.reasons) context.report.SetUntrusted(reason);
  DoubtAlignedBefore(a.input_path, context);

  std::map<uint32_t, std::vector<Eigen::Vector2d>> keypoints;
  for (const auto& [id, image] : model.images) {
    if (alignment.rolling_shutter) keypoints[id] = image.points2d;
  }
  if (alignment.lenses.mended) model = *alignment.lenses.mended;
  if (alignment.adjusted()) {
    model = alignment.adjustment.bundle.model;
  } else {
    TransformModel(alignment.scan_from_sparse, &model);
  }
  for (Similarity* answer : {&alignment.scan_from_sparse, &alignment.start.scan_from_sparse}) {
    *answer = *answer * local_from_sparse;  // from the model as it was read
  }
  const ReprojectionErrors after = UpdateReprojectionErrors(&model);
  FillReport(alignment, after.rms_px, &context.report);
  context.report["cameras"] = CamerasToJson(alignment);
  if (alignment.rolling_shutter) aligned.row_motions = alignment.rolling_shutter->motions;
  const AlignedPhotos photographed{model, a.image_path, aligned.row_motions};
  auto photos =
      JudgeSinglePhotos(a, database, photographed, one.picks, alignment.adjustment.bundle.ran_away,
                        *reading->surveyed, context);
  context.report["planes"] = ScanPlanesToJson(planes, model);
  SetNumPointsOfPlanes(alignment, &context.report["planes"]);
  const WhatPhotosSay photos_say =
      CompareWithPhotos(a, photographed, *reading->surveyed, one.told, context);
  CarryMapperVerdict(verdict, alignment, photos_say.agree, context);
  if (reading->search.is_null()) DoubtRoom(a, photos_say, alignment.disagreement.rms, context);
  for (auto& [id, points2d] : keypoints) model.images.at(id).points2d = std::move(points2d);
  if (alignment.rolling_shutter) UpdateReprojectionErrors(&model);
  PutDuplicatesBack(duplicates.input, duplicates.photos, alignment.scan_from_sparse.scale, &model);
  for (const auto& [id, of] : duplicates.photos) {
    // They stand and fall together.
    photos[id] = photos.at(of);
    photos[id].duplicate_of = model.images.at(of).name;
    const auto sigma = alignment.photo_sigmas.find(of);
    if (sigma != alignment.photo_sigmas.end()) alignment.photo_sigmas[id] = sigma->second;
  }
  context.report["images"] = PhotosToJson(alignment, model);
  AddVerdicts(photos, model, &context.report["images"]);
  aligned.model = std::move(model);
  aligned.local_from_sparse = alignment.scan_from_sparse;
  return aligned;
}

}  // namespace roomtex
