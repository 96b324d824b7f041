#include "align/pick/pick_advice.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "align/pick_findings.h"
#include "core/text.h"

namespace roomtex {
namespace {

// Second extent of the scan points over the first, and spread over the photo's diagonal, below
// which picks are worth a warning. (FindLayoutProblem refuses 0.02 and 0.015.)
constexpr double kThinShare = 0.12, kCrowdedShare = 0.1;
// Photo and sparse model disagree: joint residuals over those of the photo alone, and pixels.
constexpr double kModelFactor = 3, kModelPx = 4;

// As the page numbers the picks.
std::string NumberOf(int index) { return std::to_string(index + 1); }

std::string HowToMirror(const std::string& azimuth) {
  return azimuth.empty() ? "" : " Press Mirror above the scan to read it the other way round.";
}

std::string MirrorWarning(double rms_px, double mirrored_rms_px, const std::string& azimuth) {
  return "The scan looks like a mirror image of the room: the picks miss by " + Number(rms_px, 1) +
         " pixels (rms), but by " + Number(mirrored_rms_px, 1) + " when the scan is reflected." +
         HowToMirror(azimuth);
}

std::string LeftOut(int index, double distance_px) {
  return "Pick " + NumberOf(index) + " is left out: it is " + Number(distance_px, 1) +
         " pixels away from where the others put it.";
}

std::string Count(int number, const std::string& noun) {
  return std::to_string(number) + " " + noun + (number == 1 ? "" : "s");
}

}  // namespace

double DistanceFromSurface(const PickScene& scene, const Eigen::Vector3d& x_in_scan) {
  double distance = std::numeric_limits<double>::infinity();
  for (int scan = 0; scan < scene.num_scans(); ++scan) {
    const auto place = scene.places(scan).PlaceOf(x_in_scan);
    if (!place) continue;
    const ScanPlaces::Found found = scene.places(scan).PointAt(*place);
    // At an edge the surface may be that of the one side or of the other.
    if (found.reason != ScanPlaces::Reason::kNone) return 0;
    distance = std::min(distance, (found.x_in_scan - x_in_scan).norm());
  }
  return distance;
}

std::string AsSentence(std::string text) {
  if (text.empty()) return text;
  text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
  if (text.back() != '.') text += '.';
  return text;
}

std::vector<std::string> ReviewWarnings(const PickReview& review, const std::vector<int>& on,
                                        const std::string& azimuth) {
  std::vector<std::string> warnings;
  if (static_cast<int>(on.size()) < kMinPicksPerPhoto) return warnings;
  if (review.mirrored && !(review.exchanged && review.exchanged_rms_px < review.mirrored_rms_px)) {
    warnings.push_back(MirrorWarning(review.RmsPx(), review.mirrored_rms_px, azimuth));
  } else if (review.exchanged) {
    warnings.push_back("Picks " + NumberOf(on[review.exchanged->first]) + " and " +
                       NumberOf(on[review.exchanged->second]) +
                       " look exchanged: with their places in the photo swapped all "
                       "picks fit to " +
                       Number(review.exchanged_rms_px, 1) + " pixels.");
  }
  for (size_t i = 0; i < on.size(); ++i) {
    if (review.used[i]) continue;
    warnings.push_back(LeftOut(on[i], review.leave_one_out_px[static_cast<int>(i)]));
  }
  return warnings;
}

std::vector<std::string> SpreadWarnings(const SpreadPickFit& spread, const std::vector<int>& on,
                                        const std::string& azimuth) {
  if (!spread.layout_problem.empty()) return {AsSentence(spread.layout_problem)};
  if (!spread.HasFit()) {
    return {
        "No place of the sparse model in the scan has the picks of all photos in front of their "
        "cameras. Check that they are of these photos."};
  }
  std::vector<std::string> warnings;
  if (spread.mirrored) {
    warnings.push_back(MirrorWarning(spread.rms_px[0], spread.mirrored_rms_px, azimuth));
  }
  for (size_t i = 0; i < on.size(); ++i) {
    if (spread.used[i] || !std::isfinite(spread.leave_one_out_px[i])) continue;
    warnings.push_back(LeftOut(on[i], spread.leave_one_out_px[i]));
  }
  return warnings;
}

std::vector<std::string> SpreadWarnings(const PointPairs& pairs, const Camera& camera) {
  std::vector<std::string> warnings;
  const Eigen::Vector3d extents = PrincipalExtents(pairs.x_in_scan);
  if (extents[1] < kThinShare * extents[0]) {
    warnings.push_back(
        "The picks lie nearly on one line, which fixes the turn about it badly. Pick a point far "
        "beside it.");
  } else if (pairs.size() >= 4 && extents[2] < kCoplanarShare * extents[0]) {
    warnings.push_back(
        "All picks lie on one plane. Two poses may fit them; a pick in front of the plane or "
        "behind it decides.");
  }
  const Eigen::Vector2d centre = pairs.x_in_img.rowwise().mean();
  const double spread = std::sqrt((pairs.x_in_img.colwise() - centre).squaredNorm() / pairs.size());
  if (spread < kCrowdedShare * std::hypot(camera.width, camera.height)) {
    warnings.push_back(
        "The picks crowd in one part of the photo. Spread over all of it they fix the pose much "
        "better.");
  }
  return warnings;
}

std::string ModelWarning(const PickReview& review, const PhotoState& photo) {
  if (static_cast<int>(review.used.size()) < kMinPicksPerPhoto) return "";
  const double own_px = review.RmsPx();
  if (!(photo.rms_px > kModelPx && photo.rms_px > kModelFactor * own_px)) return "";
  return "The picks of this photo agree with each other (" + Number(own_px, 1) +
         " pixels), but not with where the sparse model and the other picks have the photo (" +
         Number(photo.rms_px, 1) + " pixels): its pose in the model may be wrong.";
}

std::vector<std::string> SurfaceWarnings(const std::vector<SessionPick>& picks,
                                         const std::vector<int>& on, const PickScene& scene) {
  std::vector<std::string> warnings;
  int num_off = 0, num_mirrored_off = 0;
  for (size_t k = 0; k < on.size(); ++k) {
    const SessionPick& pick = picks[on[k]];
    const double off = DistanceFromSurface(scene, *pick.x_in_scan);
    if (!(off > kPickReach)) continue;
    ++num_off;
    const Eigen::Vector3d mirrored =
        MirroredAt(scene.ScanOf(pick).scan_from_station, *pick.x_in_scan);
    num_mirrored_off += !(DistanceFromSurface(scene, mirrored) <= kPickReach);
    warnings.push_back("The scan point of pick " + NumberOf(on[k]) + " lies " +
                       (std::isfinite(off) ? Number(off, 2) + " m" : std::string("far")) +
                       " off the scan's surface. Drag it to its place in the scan.");
  }
  if (num_off >= 2 && 3 * num_mirrored_off <= num_off) {
    warnings = {"These picks were made on a mirror image of this scan." +
                HowToMirror(scene.azimuth())};
  }
  return warnings;
}

namespace {

// The picks that count in the photos of one model.
struct Tally {
  int num_half = 0, total = 0, most = 0;
  std::string name;  // the photo with most
};

Tally TallyOf(const std::vector<SessionPick>& picks, int model, const PickScene& scene) {
  Tally tally;
  std::map<std::string, int> on;
  for (const SessionPick& pick : picks) {
    if (scene.FindPhoto(pick.image_name)->model != model) continue;
    if (!pick.complete()) ++tally.num_half;
    if (pick.complete() && pick.weight > 0) ++on[pick.image_name];
  }
  for (const auto& [image_name, count] : on) {
    tally.total += count;
    if (count <= tally.most) continue;
    tally.most = count;
    tally.name = image_name;
  }
  return tally;
}

// Without a sparse model, of each photo.
int NeededIn(FocalSource source) {
  return source == FocalSource::kPicks ? kMinPicksForFocal : kMinPicksPerPhoto;
}

// While there are fewer than needed; with a sparse model they may lie in one photo or in several.
std::string NextOfFew(const Tally& tally, int needed, const PickSolution& solution,
                      const PickScene& scene) {
  const PhotoState& photo = solution.photos.at(tally.name);
  const std::string more = Count(needed - tally.most, "more pair");
  const int model = scene.FindPhoto(tally.name)->model;
  const std::string where = !scene.has_model() ? " in this photo"
                            : scene.models().size() == 1
                                ? ", in this photo or in others"
                                : ", in this photo or in others of " + scene.ModelName(model);
  if (needed > kMinPicksPerPhoto) {
    return more +
           " to go in this photo: nothing says its focal length, and eight tell it, in front "
           "of a plane and behind it.";
  }
  if (tally.most < 3) {
    return more + " to go" + where + "; spread them over the photo and in depth.";
  }
  if (!photo.solved_by_picks() && !solution.with_rays)
    return more + " to go; the scan is being prepared.";
  if (!photo.solved_by_picks()) {
    return more + " to go. These alone fix no pose: " +
           (photo.warnings.empty() ? "pick another point." : photo.warnings[0]);
  }
  return more + " to go" + where + ". Click one side: the other shows where to look.";
}

struct Advice {
  std::string text;
  bool is_begun = false, is_done = false;
};

// The number of a pick of this model that is left out as wrong; 0 = none is.
int WrongPick(const std::vector<SessionPick>& picks, int model, const PickSolution& solution,
              const PickScene& scene) {
  for (size_t i = 0; i < picks.size(); ++i) {
    const bool is_wrong = solution.picks[i].status == PickState::Status::kBad &&
                          scene.FindPhoto(picks[i].image_name)->model == model;
    if (is_wrong) return static_cast<int>(i) + 1;
  }
  return 0;
}

std::string NextWithEnough(const std::vector<SessionPick>& picks, const Tally& tally, int needed,
                           const PickSolution& solution, const PickScene& scene, bool* is_done) {
  const int model_index = scene.FindPhoto(tally.name)->model;
  const ModelState& model = solution.models[model_index];
  const PhotoState& photo = solution.photos.at(tally.name);
  const int wrong = WrongPick(picks, model_index, solution, scene);
  const bool is_whole = tally.most >= kMinPicksPerPhoto || !scene.has_model();
  if (!photo.solved_by_picks() || (!is_whole && !model.scan_from_sparse)) {
    if (!is_whole && !solution.with_rays) return "Enough picks; the scan is being prepared.";
    if (!model.warnings.empty()) return model.warnings[0];
    return photo.warnings.empty() ? "These picks fix no pose: check them." : photo.warnings[0];
  }
  if (wrong > 0) {
    return "A pick is left out as wrong (pick " + std::to_string(wrong) +
           "): drag it to its place, or pick another point, so that " +
           (needed > kMinPicksPerPhoto ? "eight" : "six") + " remain.";
  }
  const TrustOptions trust;
  const Camera& camera = scene.FindPhoto(tally.name)->projection->camera();
  const double rms_px = is_whole ? photo.rms_px : model.rms_px;
  if (rms_px > trust.PickRmsLimit(camera)) {
    return "The picks miss by " + Number(rms_px, 1) +
           " pixels: look at the worst one, or switch picks off one by one.";
  }
  if (!solution.with_rays) return "Enough picks; the scan is being prepared.";
  *is_done = true;
  if (!scene.has_model()) {
    return "Enough picks for this photo: compare it with the scan by the back-projection, then "
           "align. Another photo needs as many of its own.";
  }
  if (!model.scan_from_sparse) {
    *is_done = false;
    return "The pose of the photo is known, but no sparse point of it lies on the scan: pick in a "
           "photo with more sparse points.";
  }
  return "Enough picks: compare photo and scan by the back-projection, then align.";
}

Advice AdviceOf(int model, const std::vector<SessionPick>& picks, const PickSolution& solution,
                const PickScene& scene) {
  const Tally tally = TallyOf(picks, model, scene);
  Advice advice;
  advice.is_begun = tally.num_half > 0 || tally.total > 0;
  const int needed = scene.has_model() ? kMinPicksPerPhoto - (tally.total - tally.most)
                                       : NeededIn(scene.focal_source(tally.name));
  if (tally.num_half > 0 && tally.most < needed) {
    advice.text = "Click the same point on the other side.";
  } else if (tally.total == 0) {
    advice.text =
        "Click a point that you recognise on both sides, such as the corner of a picture or a "
        "switch: once in the photo, once in the scan.";
  } else if (tally.most < needed) {
    advice.text = NextOfFew(tally, needed, solution, scene);
  } else {
    advice.text = NextWithEnough(picks, tally, needed, solution, scene, &advice.is_done);
  }
  return advice;
}

// Where the search has put the photos, as long as no picks do; "" = it has not.
std::string NextAfterSearch(const std::vector<SessionPick>& picks, const PickSolution& solution) {
  const bool by_picks =
      std::any_of(solution.photos.begin(), solution.photos.end(),
                  [](const auto& photo) { return photo.second.solved_by_picks(); });
  const bool is_half = std::any_of(picks.begin(), picks.end(),
                                   [](const SessionPick& pick) { return !pick.complete(); });
  if (!solution.found || by_picks || is_half) return "";
  if (solution.found->trusted) {
    return "The search has placed the photos: compare photo and scan by the back-projection.";
  }
  const std::string& confirm_in = solution.found->confirm_in;
  if (!confirm_in.empty() && picks.empty()) {
    return "The search has placed the photos, and one pair decides whether that is right: set it "
           "in " +
           confirm_in + ".";
  }
  if (!confirm_in.empty()) return "Align again: the search goes on with what you have set.";
  if (!picks.empty()) return "";
  return "The search has placed the photos, but is not to be trusted: compare photo and scan, and "
         "set six pairs.";
}

}  // namespace

std::string NextStep(const std::vector<SessionPick>& picks, const PickSolution& solution,
                     const PickScene& scene) {
  const std::string after_search = NextAfterSearch(picks, solution);
  if (!after_search.empty()) return after_search;
  std::string done, others;  // what is said of the models that have enough, and names of the rest
  for (size_t model = 0; model < scene.models().size(); ++model) {
    const int index = static_cast<int>(model);
    const Advice advice = AdviceOf(index, picks, solution, scene);
    if (advice.is_begun && !advice.is_done) return advice.text;
    if (advice.is_begun) {
      done = advice.text;
    } else {
      others += (others.empty() ? "" : ", ") + scene.ModelName(index);
    }
  }
  if (done.empty()) return AdviceOf(0, picks, solution, scene).text;
  if (others.empty()) return done;
  return done + " The photos of " + others +
         " have no picks: pick in one of them, too, or let the alignment search for them.";
}

}  // namespace roomtex
