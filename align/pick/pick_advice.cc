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
    const Rigid& scan_from_station = scene.scans()[0].scan_from_station;
    Eigen::Vector3d x_in_station = scan_from_station.Inverse() * *pick.x_in_scan;
    x_in_station.x() *= -1;
    num_mirrored_off +=
        !(DistanceFromSurface(scene, scan_from_station * x_in_station) <= kPickReach);
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

// The picks that count, over the photos.
struct Tally {
  int num_half = 0, total = 0, most = 0;
  std::string name;  // the photo with most
};

Tally TallyOf(const std::vector<SessionPick>& picks) {
  Tally tally;
  std::map<std::string, int> on;
  for (const SessionPick& pick : picks) {
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
  const std::string where = scene.has_model() ? ", in this photo or in others" : " in this photo";
  if (needed > kMinPicksPerPhoto) {
    return more +
           " to go in this photo: nothing says its focal length, and eight tell it, in front "
           "of a plane and behind it.";
  }
  if (tally.most < 3) {
    return more + " to go" + where + "; spread them over the photo and in depth.";
  }
  if (!photo.solved() && !solution.with_rays) return more + " to go; the scan is being prepared.";
  if (!photo.solved()) {
    return more + " to go. These alone fix no pose: " +
           (photo.warnings.empty() ? "pick another point." : photo.warnings[0]);
  }
  return more + " to go" + where + ". Click one side: the other shows where to look.";
}

}  // namespace

std::string NextStep(const std::vector<SessionPick>& picks, const PickSolution& solution,
                     const PickScene& scene) {
  const Tally tally = TallyOf(picks);
  const int needed = scene.has_model() ? kMinPicksPerPhoto - (tally.total - tally.most)
                                       : NeededIn(scene.focal_source(tally.name));
  if (tally.num_half > 0 && tally.most < needed) {
    return "Click the same point on the other side.";
  }
  if (tally.total == 0) {
    return "Click a point that you recognise on both sides, such as the corner of a picture or a "
           "switch: once in the photo, once in the scan.";
  }
  if (tally.most < needed) return NextOfFew(tally, needed, solution, scene);
  const PhotoState& photo = solution.photos.at(tally.name);
  const auto bad =
      std::find_if(solution.picks.begin(), solution.picks.end(),
                   [](const PickState& state) { return state.status == PickState::Status::kBad; });
  const bool is_whole = tally.most >= kMinPicksPerPhoto || !scene.has_model();
  if (!photo.solved() || (!is_whole && !solution.scan_from_sparse)) {
    if (!is_whole && !solution.with_rays) return "Enough picks; the scan is being prepared.";
    if (!solution.warnings.empty()) return solution.warnings[0];
    return photo.warnings.empty() ? "These picks fix no pose: check them." : photo.warnings[0];
  }
  if (bad != solution.picks.end()) {
    return "A pick is left out as wrong (pick " + std::to_string(bad - solution.picks.begin() + 1) +
           "): drag it to its place, or pick another point, so that " +
           (needed > kMinPicksPerPhoto ? "eight" : "six") + " remain.";
  }
  const TrustOptions trust;
  const Camera& camera = scene.FindPhoto(tally.name)->projection->camera();
  const double rms_px = is_whole ? photo.rms_px : solution.rms_px;
  if (rms_px > trust.PickRmsLimit(camera)) {
    return "The picks miss by " + Number(rms_px, 1) +
           " pixels: look at the worst one, or switch picks off one by one.";
  }
  if (!solution.with_rays) return "Enough picks; the scan is being prepared.";
  if (!scene.has_model()) {
    return "Enough picks for this photo: compare it with the scan by the back-projection, then "
           "align. Another photo needs as many of its own.";
  }
  if (!solution.scan_from_sparse) {
    return "The pose of the photo is known, but no sparse point of it lies on the scan: pick in a "
           "photo with more sparse points.";
  }
  return "Enough picks: compare photo and scan by the back-projection, then align.";
}

}  // namespace roomtex
