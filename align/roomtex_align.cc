// roomtex-align: the sparse model into the scan, by picks or without.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "align/align_command_options.h"
#include "align/alignment.h"
#include "align/alignment_report.h"
#include "align/automatic_alignment.h"
#include "align/found_photos.h"
#include "align/geo/geo_output.h"
#include "align/lens_report.h"
#include "align/local_origin.h"
#include "align/mirrored_reading.h"
#include "align/photo_alignment.h"
#include "align/plane_bundle_report.h"
#include "align/search_report.h"
#include "align/surface/scan_planes_report.h"
#include "align/trust/agreement.h"
#include "align/trust/agreement_report.h"
#include "align/trust/overlay.h"
#include "align/trust/station_check.h"
#include "colmap_ext/lens_labels.h"
#include "colmap_ext/mapper_verdict.h"
#include "colmap_ext/model_output.h"
#include "colmap_ext/panorama_model.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/input_guard.h"
#include "core/output_file.h"
#include "core/output_set.h"
#include "core/photo_files.h"
#include "core/photo_fit.h"
#include "core/resource_limits.h"
#include "core/surfels.h"
#include "importers/photo_picks.h"
#include "importers/scan_reader.h"
#include "importers/scan_record.h"

namespace roomtex {
namespace {

// The model on the Earth, with --geo_origin; the report's `geo`.
void WriteGeo(const AlignCommandOptions& a, const SparseModel& aligned, const PlacedScans& placed,
              const std::optional<GeoReference>& geo, const OutputSet& outputs,
              const Command::Context& context) {
  const std::string folder = outputs.folder() + "/geo";
  context.report["geo"] = nullptr;
  if (a.geo_origin.empty() && std::filesystem::exists(folder + "/geo.json")) {
    context.Warn(folder + " is from an earlier run: without --geo_origin it is not written anew");
  }
  if (!geo) return;
  if (!a.geo_origin.empty()) WriteGeoModel(aligned, *geo, outputs.aside() + "/geo");
  const GpsCheck gps = CheckGps(aligned, *geo, a.image_path);
  context.report["geo"] = GeoToJson(*geo, placed, gps);
  for (const std::string& warning : GeoWarnings(aligned, *geo, gps)) context.Warn(warning);
}

// The photos that can be compared with the scan; what there is to say about the others. Returns the
// reasons that were told.
std::set<std::string> LookForPhotos(const AlignCommandOptions& a, const SparseModel& model,
                                    const Command::Context& context) {
  std::set<std::string> told;
  if (a.image_path.empty()) return told;
  std::vector<PhotoLeftOut> left_out;
  std::vector<std::string> notes;
  for (const SparseImage* image : SpreadImages(model, static_cast<int>(model.images.size()))) {
    const Camera& camera = model.cameras.at(image->camera_id);
    const PhotoFit fit = FitPhotoToCamera(a.image_path + "/" + image->name, image->name,
                                          camera.width, camera.height);
    if (!fit.note.empty()) notes.push_back(fit.note);
    if (fit.usable()) continue;
    left_out.push_back({image->name, fit.problem});
    told.insert(fit.problem);
  }
  if (a.strict) ThrowIfAnyLeftOut(left_out, a.image_path);
  ReportPhotosLeftOut(left_out, context);
  for (const std::string& note : FirstNotes(notes)) context.Warn(note);
  return told;
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

// What photos and scan say about each other; the report's `agreement`.
void CompareWithPhotos(const AlignCommandOptions& a, const SparseModel& aligned,
                       const SurveyedScans& surveyed, const std::set<std::string>& told,
                       const Command::Context& context) {
  if (a.image_path.empty()) return;
  context.progress.Stage("agreement");
  std::vector<std::string> warnings;
  const AgreementOptions options;
  const Agreement agreement = MeasureAgreement(aligned, a.image_path, surveyed.viewer(), options,
                                               context.options.num_threads, &warnings);
  context.report["agreement"] = AgreementToJson(agreement, options);
  if (agreement.gradient.contradicts) context.report.SetUntrusted(agreement.gradient.reason);
  WarnOfPhotos(a, warnings, "Agreement: ", told, context);
}

// The report's `overlays`.
void WriteOverlayPictures(const AlignCommandOptions& a, const SparseModel& aligned,
                          const SurveyedScans& surveyed, const std::set<std::string>& told,
                          const OutputSet& outputs, const Command::Context& context) {
  context.report["overlays"] = Json::array();
  if (a.overlays == 0) return;
  context.progress.Stage("overlays");
  std::vector<std::string> warnings;
  for (const std::string& path :
       WriteOverlays(aligned, a.image_path, outputs.aside() + "/overlays", surveyed.viewer(),
                     a.overlays, OverlayOptions(), context.options.num_threads, &warnings)) {
    context.report["overlays"].push_back(outputs.folder() + path.substr(outputs.aside().size()));
  }
  WarnOfPhotos(a, warnings, "Overlay: ", told, context);
}

// Another scan than the one that a model was aligned to before is no mistake here.
PlacedScans ReadScansToAlign(const AlignCommandOptions& a) {
  const double max_samples = a.bound.max_samples;
  const SampleWork work("aligning to", kAlignBytesPerSample, max_samples);
  ScanReaderOptions reader = a.scan_reader;
  reader.colors_as_intensity = !a.image_path.empty();
  if (!a.scan_paths.empty()) {
    return ReadPlacedScans(a.scan_paths, a.scan_poses, reader, max_samples);
  }
  return ReadScansOfModel(ReadAlignmentRecord(a.input_path),
                          {a.scan_paths, a.scan_poses, reader, max_samples});
}

// Scans of several stations against each other; the report's `stations`.
void CompareStations(const AlignCommandOptions& a, PlacedScans* placed,
                     const Command::Context& context) {
  std::vector<Scan>* const scans = &placed->scans;
  context.report["stations"] = Json::array();
  if (scans->size() < 2) return;
  context.progress.Stage("stations");
  if (a.register_stations) {
    for (const int moved : RegisterStations(scans)) {
      context.Warn((*scans)[moved].path + " was moved onto the other scans");
      int scan = 0;
      for (PlacedScans::File& file : placed->files) {
        for (size_t k = 0; k < file.placed.size(); ++k, ++scan) {
          if (scan == moved) file.placed[k] = true;  // the aligned model remembers where it is now
        }
      }
    }
  }
  const StationCheck check = CheckStations(*scans);
  context.report["stations"] = StationsToJson(check, *scans);
  if (!check.wrong.empty()) context.report.SetUntrusted(check.Sentence(*scans));
}

// The scans as they are read, and the alignment to them. The reading may turn out to be the other
// one (--azimuth auto).
struct Reading {
  Reading(const AlignCommandOptions& a, const Command::Context& context)
      : placed(ReadScansToAlign(a)) {
    for (const std::string& note : placed.notes) context.Warn(note);
    context.report["sample_stride"] = placed.stride;
    if (placed.stride > 1) {
      context.progress.Note("The scans have more than --max_samples: of every " +
                            std::to_string(placed.stride) + " columns and rows one is held.");
    }
    ReplaceClouds(&placed.scans, context.options.num_threads);
    CompareStations(a, &placed, context);
    as_named = placed.SortByPath();
    geo = FindGeoReference(placed, ParseGeoOrigin(a.geo_origin));
    origin = LocalOrigin(placed.scans);
    origin.MoveToLocal(&placed.scans);
    SurveyOptions options{a.alignment.surface, a.planes, a.alignment.mesh};
    options.num_threads = context.options.num_threads;
    surveyed = std::make_unique<const SurveyedScans>(placed.scans, options);
  }
  Reading(const Reading&) = delete;  // the survey is one of these scans
  Reading& operator=(const Reading&) = delete;

  PlacedScans placed;            // about the origin and sorted by path, until WriteAligned()
  std::vector<size_t> as_named;  // the order of its files on the command line
  LocalOrigin origin{{}};
  std::unique_ptr<const std::vector<Scan>> mirrored;  // in place of placed.scans
  std::unique_ptr<const SurveyedScans> surveyed;
  std::optional<GeoReference> geo;
  AlignmentAttempt attempt;
  Json search;  // of an alignment without picks

  // Of the first RTPI scan; "" = there is none.
  std::string azimuth() const {
    for (const PlacedScans::File& file : placed.files) {
      if (!file.azimuth.empty()) return file.azimuth;
    }
    return "";
  }
};

std::string OtherAzimuth(const std::string& azimuth) {
  return azimuth == "clockwise" ? "counterclockwise" : "clockwise";
}

// Nobody said how the scans are to be read, and all of them could be mirrored.
bool MayTurn(const AlignCommandOptions& a, const Reading& reading) {
  const std::vector<PlacedScans::File>& files = reading.placed.files;
  return a.scan_reader.azimuth == "auto" &&
         std::all_of(files.begin(), files.end(),
                     [](const PlacedScans::File& file) { return !file.azimuth.empty(); });
}

// The planes of the scans (thesis 7.2), where they are asked for.
std::vector<ScanPlane> PlanesOf(const AlignCommandOptions& a, const SurveyedScans& surveyed) {
  if (!a.alignment.plane_constrained && a.planes_path.empty()) return {};
  return surveyed.planes();
}

// The other reading of RTPI scans, which the picks have shown.
void TakeMirroredReading(MirroredReading found, Reading* reading, const Command::Context& context) {
  for (PlacedScans::File& file : reading->placed.files) {
    if (file.azimuth.empty()) continue;
    context.Warn(file.path + " is read " + OtherAzimuth(file.azimuth) + " (--azimuth auto): read " +
                 file.azimuth + " it is a mirror image of the room; " + found.evidence + ".");
    file.azimuth = OtherAzimuth(file.azimuth);
  }
  reading->mirrored = std::move(found.scans);
  reading->surveyed = std::move(found.surveyed);
  reading->attempt = std::move(found.attempt);
}

// What was searched for, from here on the attempt.
void TakeAutomatic(AutomaticAlignment found, Reading* reading) {
  reading->search = SearchToJson(found);
  reading->attempt = std::move(found.attempt);
}

// Aligns without picks, or with few as a hint. A mirrored scan is read the other way, as below.
void SearchScans(const AlignmentInput& input, const std::vector<NearHint>& near,
                 const AlignmentOptions& options, bool may_turn, Reading* reading,
                 const Command::Context& context) {
  AutomaticAlignment found = AlignAutomatically(input, near, options, &context.progress);
  const bool turns = found.attempt.says_mirrored && may_turn;
  TakeAutomatic(std::move(found), reading);
  if (!turns) return;
  MirroredReading other;
  other.scans = std::make_unique<const std::vector<Scan>>(MirrorScans(input.surveyed.scans()));
  other.surveyed = std::make_unique<const SurveyedScans>(*other.scans, input.surveyed.options());
  AlignmentInput turned{input.model,          *other.surveyed,  input.picks,
                        input.picks_path,     input.azimuth,    input.photo_labels,
                        input.lenses_refined, input.image_path, input.num_threads};
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
                         const AlignmentOptions& options, double known_rms, Reading* reading,
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
                       const AlignmentOptions& options, Reading* reading,
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
                bool one_place, Reading* reading, const Command::Context& context) {
  const std::vector<PlacedScans::File>& files = reading->placed.files;
  const bool may_turn = MayTurn(a, *reading);
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
    attempt.alignment.reset();
    attempt.refusal = MirroredScan(files[0].path,
                                   std::string("the scan is a mirror image of the room") +
                                       (both ? ", and so are the picks: " : ": ") + found.evidence,
                                   MirrorRemedy(input), !both)
                          .what();
  }
}

// Where the result goes: a trusted one that is there is kept.
std::string ChooseOutput(const AlignCommandOptions& a, const Command::Context& context) {
  if (context.report.trusted()) return a.output_path;
  const AlignmentRecord there = ReadAlignmentRecord(a.output_path);
  if (!there.found || !there.trusted) return a.output_path;
  std::string output_path = a.output_path;
  while (output_path.size() > 1 && output_path.back() == '/') output_path.pop_back();
  output_path += ".untrusted";
  context.Warn("The trusted result in " + a.output_path + " is kept; this one is in " +
               output_path + ".");
  return output_path;
}

// Nothing but the report, which says why.
void WriteRefusal(const AlignCommandOptions& a, const std::string& refusal,
                  const Command::Context& context) {
  context.report.SetUntrusted(refusal);
  context.report["scan_from_sparse"] = nullptr;
  const std::string output_path = ChooseOutput(a, context);
  MakeFolder(output_path);
  context.report.AddCopy(output_path + "/alignment.json");
}

// The aligned model and what belongs to it; without scan_from_sparse there was no sparse model.
void WriteAligned(const AlignCommandOptions& a, SparseModel model,
                  const std::optional<Similarity>& local_from_sparse, Reading* reading,
                  const std::set<std::string>& told, const Command::Context& context) {
  const std::string output_path = ChooseOutput(a, context);
  const char transform_name[] = "scan_from_sparse.txt",
             matrix_name[] = "scan_from_sparse_matrix.txt";
  RequireNoRigs(output_path);
  const auto outputs = std::make_shared<OutputSet>(output_path);
  WriteOverlayPictures(a, model, *reading->surveyed, told, *outputs, context);
  context.progress.Stage("write");
  reading->origin.MoveBack(&model);
  reading->origin.MoveBack(&reading->placed.scans);
  reading->placed.Reorder(reading->as_named);
  reading->origin.MoveBack(&context.report.keys());
  WriteSparseModel(model, outputs->aside());
  if (local_from_sparse) {
    const Similarity scan_from_sparse = reading->origin.MovedBack(*local_from_sparse);
    WriteSimilarity(outputs->Path(transform_name), scan_from_sparse);
    WriteSimilarityMatrix(outputs->Path(matrix_name), scan_from_sparse);
  } else {
    // One of an earlier run would contradict.
    outputs->Remove(transform_name);
    outputs->Remove(matrix_name);
  }
  WriteGeo(a, model, reading->placed, reading->geo, *outputs, context);
  context.report["scans"] = ToJson(RecordScans(reading->placed, a.scan_reader, output_path));
  CommitWithReport("alignment.json", outputs);
}

// What roomtex-mapper held against the model. A lens that was adjusted here is no longer the one
// that it refused, and photos are judged here, too.
void CarryMapperVerdict(const MapperVerdict& verdict, const Alignment& alignment,
                        const Command::Context& context) {
  const std::string source = "roomtex-mapper did not trust the sparse model: ";
  const bool mended =
      alignment.lenses.mended || (alignment.adjusted() && alignment.adjustment.freed);
  for (const std::string& reason : verdict.calibration) {
    if (!mended) context.report.SetUntrusted(source + reason);
  }
  for (const std::string& reason : verdict.motion) context.report.SetUntrusted(source + reason);
  for (const std::string& reason : verdict.photos) context.Warn(source + reason);
}

// What EXIF says of the photos' lenses, where the photos are given.
LensLabels PhotoLabels(const SparseModel& model, const std::string& image_path) {
  std::map<uint32_t, std::string> names;
  for (const auto& [id, image] : model.images) names[id] = image.name;
  return ReadLensLabels(names, image_path);
}

// Where the photos belong, besides the picks, which are checked: fewer than six are a hint where
// there are photos to confirm what is found.
std::vector<NearHint> ReadHints(const AlignCommandOptions& a, const std::vector<Pick>& picks,
                                const SparseModel& model) {
  if (a.picks_path.empty() || (AreHints(picks) && !a.image_path.empty())) {
    CheckPickNames(a.picks_path, picks, model);
  } else {
    CheckPicksAgainstModel(a.picks_path, picks, model);
  }
  if (a.near.empty()) return {};
  const NearHint near = ParseNearHint(a.near);
  if (!AreHints(picks)) throw UsageError("--near is a hint for a search, which six picks need not");
  if (model.FindImage(near.image_name) == nullptr) {
    throw UsageError("--near names " + near.image_name + ", which is not in the sparse model");
  }
  return {near};
}

void Align(const AlignCommandOptions& a, const Command::Context& context) {
  context.progress.Stage("read model");
  std::vector<std::string> face_warnings;
  SparseModel model = ReadModelOfPanoramas(a.input_path, a.panoramas_path, &face_warnings);
  for (const std::string& warning : face_warnings) context.Warn(warning);
  const MapperVerdict verdict = ReadMapperVerdict(a.input_path, model);
  if (!verdict.known_rms && verdict.told_poses.empty()) RequirePicksOrPhotos(a);
  std::vector<Pick> picks = a.picks_path.empty() ? std::vector<Pick>() : ReadPicks(a.picks_path);
  NamePicksAsInModel(model, &picks);
  std::vector<NearHint> near = ReadHints(a, picks, model);
  const std::set<std::string> told = LookForPhotos(a, model, context);
  context.progress.Stage("read scan");
  Reading reading(a, context);
  reading.origin.MoveToLocal(&picks);
  reading.origin.MoveToLocal(&near);
  // A model that is in the scan's frame already moves about the same origin.
  Similarity local_from_sparse;
  if (verdict.known_rms) {
    local_from_sparse.translation = -reading.origin.offset();
    TransformModel(local_from_sparse, &model);
  }
  if (a.picks_path.empty() && near.empty()) {
    picks = PicksOfKnownPhotos(verdict, model, reading.origin.offset(), reading.surveyed->scans());
  }
  const bool one_place = !picks.empty() && !verdict.told_poses.empty() && a.picks_path.empty();
  if (!verdict.known_rms && !one_place) RequirePicksOrPhotos(a);
  context.progress.Stage("planes");
  PlanesOf(a, *reading.surveyed);
  AlignScans(a,
             {model, *reading.surveyed, picks, a.picks_path, reading.azimuth(),
              PhotoLabels(model, a.image_path), verdict.refined, a.image_path,
              context.options.num_threads},
             near, verdict.known_rms, one_place, &reading, context);
  if (verdict.known_rms && reading.search.is_null() && a.picks_path.empty()) {
    reading.search = {{"method", "known_poses"}, {"position_rms_m", *verdict.known_rms}};
  }
  context.report["search"] = reading.search;
  const std::vector<ScanPlane> planes = PlanesOf(a, *reading.surveyed);
  if (!a.planes_path.empty()) {
    WriteScanPlanes(a.planes_path, reading.surveyed->scans(), planes, context.options.num_threads,
                    reading.origin.offset());
  }
  if (!reading.attempt.alignment) return WriteRefusal(a, reading.attempt.refusal, context);
  Alignment& alignment = *reading.attempt.alignment;
  for (const std::string& warning : alignment.warnings) context.Warn(warning);
  for (const std::string& reason : alignment.reasons) context.report.SetUntrusted(reason);
  CarryMapperVerdict(verdict, alignment, context);

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
  context.report["images"] = PhotosToJson(alignment, model);
  context.report["planes"] = ScanPlanesToJson(planes, model);
  SetNumPointsOfPlanes(alignment, &context.report["planes"]);
  CompareWithPhotos(a, model, *reading.surveyed, told, context);
  WriteAligned(a, model, alignment.scan_from_sparse, &reading, told, context);
}

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
void WritePlacedPhotos(const AlignCommandOptions& a, PhotoAlignment* found, Reading* reading,
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

// One to a few photos, each by its own picks.
void AlignPickedPhotos(const AlignCommandOptions& a, const Command::Context& context) {
  context.progress.Stage("read photos");
  std::vector<Pick> picks = ReadPicks(a.picks_path);
  const PhotoModel photos = MakePhotoModel(a.image_path, a.picks_path, picks, a.camera);
  CheckPickNames(a.picks_path, picks, photos.model);
  const std::set<std::string> told = LookForPhotos(a, photos.model, context);
  context.progress.Stage("read scan");
  Reading reading(a, context);
  reading.origin.MoveToLocal(&picks);
  const AlignmentInput input{photos.model, *reading.surveyed, picks, a.picks_path,
                             reading.azimuth()};
  std::string refusal;
  std::optional<PhotoAlignment> found = FindPhotoAlignment(a, input, photos, context, &refusal);
  if (!found) return WriteRefusal(a, refusal, context);
  WritePlacedPhotos(a, &*found, &reading, told, context);
}

// Photos each by itself, without picks. Of RTPI scans the other reading, too, where in this one
// none of them is found and nobody said how to read.
FoundPhotos SearchPhotos(const AlignCommandOptions& a, const PhotoModel& photos, Reading* reading,
                         const Command::Context& context) {
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

// Photos each by itself, by what it shows of the scan's intensity.
void AlignFoundPhotosAlone(const AlignCommandOptions& a, const Command::Context& context) {
  context.progress.Stage("read photos");
  const std::vector<std::string> names =
      ListPhotoFiles(a.image_path, "Check --image_path", /*below=*/true);
  const PhotoModel photos = MakePhotoModel(a.image_path, names, a.camera, UnfitPhotos::kTaken);
  const std::set<std::string> told = LookForPhotos(a, photos.model, context);
  context.progress.Stage("read scan");
  Reading reading(a, context);
  const FoundPhotos found = SearchPhotos(a, photos, &reading, context);
  context.report["search"] = FoundPhotosToJson(found);
  const AlignmentInput input{photos.model, *reading.surveyed, found.picks, "", reading.azimuth()};
  PhotoAlignment placed = AlignFoundPhotos(input, photos, found, a.alignment.trust);
  if (found.views.empty()) {
    for (const std::string& warning : placed.alignment.warnings) context.Warn(warning);
    return WriteRefusal(a, placed.alignment.reasons[0], context);
  }
  WritePlacedPhotos(a, &placed, &reading, told, context);
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  roomtex::AlignCommandOptions arguments;
  roomtex::Command command(
      "roomtex-align",
      "Brings COLMAP's sparse model into the frame of a range scan, by picks or without.",
      "roomtex-align --input_path sparse/0 --scan_path room.rtpi --picks_path picks.csv "
      "--output_path aligned");
  roomtex::AddOptions(&arguments, &command);
  return command.Run(argc, argv, [&arguments](const roomtex::Command::Context& context) {
    roomtex::CheckOptions(arguments);
    if (!arguments.input_path.empty()) {
      roomtex::Align(arguments, context);
    } else if (!arguments.picks_path.empty()) {
      roomtex::AlignPickedPhotos(arguments, context);
    } else {
      roomtex::AlignFoundPhotosAlone(arguments, context);
    }
  });
}
