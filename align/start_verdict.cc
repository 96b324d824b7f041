#include "align/start_verdict.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <fmt/core.h>

#include "align/pick_findings.h"
#include "core/frames.h"
#include "core/text.h"

namespace roomtex {
namespace {

const char kHintRemedy[] =
    " Say where the photos belong: --near PHOTO,X,Y,Z with a place of the scan that the photo "
    "shows, or one to five picks (--picks_path, roomtex-pick).";
const char kApartRemedy[] =
    " One pick where these places differ tells them apart (--picks_path, roomtex-pick), and so "
    "does --near PHOTO,X,Y,Z, a place of the scan that the photo shows, where they lie far apart.";
// Where a hint is not enough.
const char kPicksRemedy[] = " Six picks place it without a search (--picks_path, roomtex-pick).";

// Share of the points on surfaces that face a way, below which nothing holds the model that way.
constexpr double kLeastFacing = 0.02;
// Patches in clear photos (gradient_shift.h): with so many, photos that do not support a start
// speak against it.
constexpr long kEnoughPatches = 100;
// With fewer, min_photo_share_of_few is asked for. Scans of 500 x 200 samples of a room of 5 x 4 m
// show 65 to 82: the right room had 0.63 of them, six of the same plan 0.35 to 0.56; with 210 and
// more 0.62 and 0.15 to 0.27.
constexpr long kFewPatches = 150;

// One wall, or two that meet, are their own mirror images: a reflected model that such a surface
// leaves open has to fit as well as a right one does. Of three captures that are mirrored 0.93 to
// 0.99 of the rays agree, of two that are not, and whose place was not found, 0.80 and 0.82
// (docs/automatic.md).
constexpr double kSurelyMirrored = 0.9;

// What geometry alone is worth where photos do not confirm it.
constexpr double kEvenOdds = 0.5;

// Photos of another room with the same walls and furniture agree at the edges of both, so that more
// fits than by chance: 0.1 to 0.25 in simulated rooms, where the right room has 0.45 to 0.9. Where
// model and scan differ by centimetres (0.1 in a real kitchen) as much cannot be asked for.
PhotoSupport SupportOf(const FittedStart& start, const StartVerdictOptions& options) {
  if (!start.photos || !start.photos->supports) return PhotoSupport::kNone;
  const double share = start.photos->shifts.at_pose.Share();
  const bool few = start.photos->shifts.at_pose.num < kFewPatches;
  if (share >= (few ? options.min_photo_share_of_few : options.min_photo_share)) {
    return PhotoSupport::kClear;
  }
  return start.rms > kExactRms ? PhotoSupport::kFaint : PhotoSupport::kNone;
}

// The one where photos and scan look alike. Else the best by its rays; of several that they agree
// with about as much, the only one that the photos support most.
void Choose(const StartSearch& search, const StartVerdictOptions& options, StartVerdict* verdict) {
  for (size_t i = 0; i < search.starts.size(); ++i) {
    if (!search.starts[i].looks_alike) continue;
    verdict->best = static_cast<int>(i);
    verdict->second = search.starts.size() < 2 ? -1 : i == 0 ? 1 : 0;
    verdict->support = SupportOf(search.starts[i], options);
    verdict->looks_alike = true;
    return;
  }
  verdict->best = 0;
  bool is_only = true;
  for (int i = 0; i < static_cast<int>(search.starts.size()); ++i) {
    const PhotoSupport support = SupportOf(search.starts[i], options);
    if (support > verdict->support) {
      verdict->support = support;
      verdict->best = i;
      is_only = true;
    } else if (support == verdict->support) {
      is_only = false;
    }
  }
  if (verdict->support == PhotoSupport::kNone || !is_only) {
    verdict->support = PhotoSupport::kNone;
    verdict->best = 0;
  }
  if (search.starts.size() > 1) verdict->second = verdict->best == 0 ? 1 : 0;
}

Eigen::Vector3d CentreAt(const SparseImage& image, const FittedStart& start) {
  return start.scan_from_sparse * image.cam_from_model.TargetOriginInSource();
}

// Both by the photo for which they differ most: the middle of all may be the same for two.
std::string TwoPlaces(const AlignmentInput& input, const FittedStart& a, const FittedStart& b) {
  const SparseImage* telling = nullptr;
  double farthest = -1;
  for (const auto& [id, image] : input.model.images) {
    const double apart = (CentreAt(image, a) - CentreAt(image, b)).norm();
    if (apart > farthest) {
      farthest = apart;
      telling = &image;
    }
  }
  const auto place = [&](const FittedStart& start) {
    const Eigen::Vector3d centre = input.scan_origin + CentreAt(*telling, start);
    return fmt::format("at ({:.2f}, {:.2f}, {:.2f}), where {:.0f} % of the photos' rays agree",
                       centre.x(), centre.y(), centre.z(), 100 * start.sights.Share());
  };
  const double turn =
      DegFromRad(RotationAngle(a.scan_from_sparse.rotation, b.scan_from_sparse.rotation));
  return fmt::format(
      "The sparse model fits the scan in more than one place, {:.0f} degrees apart: {} {}; or {}.",
      turn, telling->name, place(a), place(b));
}

// Where photos confirm a start, as counted. Else a logistic curve, set by hand: even odds where a
// start fits little better than any other.
double ChanceWrong(const StartVerdict& verdict, double score, double min_score) {
  const double evidence = 12 * (score - 0.5) + 14 * std::log(std::max(verdict.ratio, 0.1)) - 3.5;
  const double guess = std::max(kChanceAlike, 1 / (1 + std::exp(evidence)));
  if (verdict.support == PhotoSupport::kClear && score >= min_score) return kChanceClear;
  return verdict.looks_alike ? kChanceAlike : guess;
}

// Directions that the surface leaves open: nothing that the points lie on faces that way.
std::vector<Eigen::Vector3d> OpenSlides(const ScanPatches& surface, const SearchCloud& cloud,
                                        const Similarity& scan_from_sparse) {
  Eigen::Matrix3d facing = Eigen::Matrix3d::Zero();
  int count = 0;
  for (const SurfacePoint& point : cloud.points) {
    const auto nearest =
        surface.FindNearest(scan_from_sparse * point.x_in_sparse, surface.cell_size());
    if (!nearest) continue;
    const Eigen::Vector3d& normal = surface.patches()[nearest->patch].normal;
    facing += normal * normal.transpose();
    ++count;
  }
  std::vector<Eigen::Vector3d> open;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(facing);
  for (int k = 0; k < 3; ++k) {
    if (solver.eigenvalues()[k] < kLeastFacing * count) {
      open.emplace_back(solver.eigenvectors().col(k));
    }
  }
  return open;
}

std::string OpenReason(const std::vector<Eigen::Vector3d>& open) {
  std::string directions;
  for (const Eigen::Vector3d& d : open) {
    directions += fmt::format("{}({:.2f}, {:.2f}, {:.2f})", directions.empty() ? "" : " and ",
                              d.x(), d.y(), d.z());
  }
  return fmt::format(
      "The surface that the sparse points lie on leaves the model open: it faces {}, so that "
      "geometry alone cannot say where along {} the model lies, nor how it is turned{}.",
      open.size() > 1 ? "one way only" : "two ways only", directions,
      open.size() > 1 ? " about the surface's normal, nor how large it is" : "");
}

std::string UnconfirmedReason(const GradientShifts& shifts) {
  return fmt::format(
      "Photos and scan do not confirm the place that fits best: of {} corners of the scan's "
      "intensity, {:.1f} % lie where the photos have them, and {:.1f} % do so by chance.",
      shifts.clear.num, 100 * shifts.clear.Share(), 100 * shifts.elsewhere.Share());
}

const char kAloneReason[] =
    "Only geometry speaks for the place that was found, since the photos show too little that the "
    "scan's intensity shows, too: a room of the same shape would fit as well.";

std::string FaintReason(const GradientShifts& shifts) {
  return fmt::format(
      "Photos and scan confirm the place that was found too little: of {} corners of the scan's "
      "intensity, {:.1f} % lie where the photos have them, as in a room with the same furniture.",
      shifts.at_pose.num, 100 * shifts.at_pose.Share());
}

std::string WeakReason(const FittedStart& best, const StartVerdictOptions& options) {
  return fmt::format(
      "No place was found where the sparse model fits the scan: at the best one {:.0f} % of the "
      "photos' rays meet the surface where their points are, and {:.0f} % pass through it (at most "
      "{:.0f} %). Check that scan and photos are of the same room.",
      100 * best.sights.Share(), 100 * best.sights.ThroughShare(), 100 * options.max_through_share);
}

}  // namespace

const char* NameOf(StartVerdict::Kind kind) {
  switch (kind) {
    case StartVerdict::Kind::kTrusted:
      return "trusted";
    case StartVerdict::Kind::kUnconfirmed:
      return "unconfirmed";
    case StartVerdict::Kind::kNone:
      return "none";
    case StartVerdict::Kind::kWeak:
      return "weak";
    case StartVerdict::Kind::kOpen:
      return "open";
    case StartVerdict::Kind::kAmbiguous:
      return "ambiguous";
    case StartVerdict::Kind::kMirrored:
      return "mirrored";
    case StartVerdict::Kind::kByPhotos:
      return "photos contradict";
  }
  return "";
}

StartVerdict JudgeStarts(const AlignmentInput& input, const StartSearch& search, bool hinted,
                         const StartVerdictOptions& options) {
  using Kind = StartVerdict::Kind;
  StartVerdict verdict;
  if (search.starts.empty()) {
    verdict.reason =
        std::string("No place was found where the sparse model fits the scan.") + kPicksRemedy;
    return verdict;
  }
  Choose(search, options, &verdict);
  const FittedStart& best = search.starts[verdict.best];
  const double score = best.sights.Score();
  if (!search.mirrored.empty()) verdict.mirrored_score = search.mirrored[0].sights.Score();
  const double second = verdict.second < 0 ? 0 : search.starts[verdict.second].sights.Score();
  const bool confirmed = verdict.support == PhotoSupport::kClear || verdict.looks_alike;
  const bool alone = !confirmed && verdict.support == PhotoSupport::kNone;
  verdict.ratio = score / std::max({second, verdict.mirrored_score, 1e-6});
  const double min_score = verdict.support == PhotoSupport::kClear ? options.min_score_confirmed
                           : alone                                 ? options.min_score_alone
                                                                   : options.min_score;
  verdict.chance_wrong = ChanceWrong(verdict, score, min_score);
  const ScanPatches& surface = input.surveyed.patches();
  if (alone && verdict.mirrored_score >= min_score &&
      verdict.mirrored_score >= options.min_ratio_mirrored * score &&
      (verdict.mirrored_score >= kSurelyMirrored ||
       OpenSlides(surface, Mirrored(search.cloud), search.mirrored[0].scan_from_sparse).empty())) {
    verdict.kind = Kind::kMirrored;
    verdict.reason = fmt::format(
        "The scan is a mirror image of the room: reflected, {} of the photos' rays meet its "
        "surface where their points are, as it is {}. {}.",
        Percent(search.mirrored[0].sights.Share()), Percent(best.sights.Share()),
        MirrorRemedy(input));
    return verdict;
  }
  // What the surface leaves open the photos hold where they clearly confirm the place.
  const auto open = confirmed ? std::vector<Eigen::Vector3d>()
                              : OpenSlides(surface, search.cloud, best.scan_from_sparse);
  if (!open.empty()) {
    verdict.kind = Kind::kOpen;
    verdict.reason = OpenReason(open) + kPicksRemedy;
    return verdict;
  }
  if (!best.settled || score < min_score ||
      best.sights.ThroughShare() > options.max_through_share) {
    verdict.kind = Kind::kWeak;
    verdict.reason = WeakReason(best, options) + kPicksRemedy;
    return verdict;
  }
  // Photos that could confirm it and do not: what a user says of the place changes nothing.
  const bool denied = alone && best.photos && best.photos->shifts.clear.num >= kEnoughPatches;
  if (denied) verdict.chance_wrong = std::max(verdict.chance_wrong, kEvenOdds);
  if (!confirmed && verdict.ratio < options.min_ratio) {
    verdict.kind = Kind::kAmbiguous;
    // Of several places a hint leaves one; the mirror image is nowhere.
    verdict.hint_decides = !denied && score >= options.min_ratio * verdict.mirrored_score;
    verdict.reason = score < options.min_ratio * second
                         ? TwoPlaces(input, best, search.starts[verdict.second])
                         : fmt::format(
                               "The sparse model fits the scan little better than its mirror image "
                               "does ({:.0f} and {:.0f} % of the photos' rays agree).",
                               100 * best.sights.Share(), 100 * search.mirrored[0].sights.Share());
    verdict.reason += verdict.hint_decides ? kApartRemedy : kPicksRemedy;
    return verdict;
  }
  if (denied) {
    verdict.kind = Kind::kByPhotos;
    verdict.reason =
        best.photos->contradicts ? best.photos->reason : UnconfirmedReason(best.photos->shifts);
    verdict.reason += kPicksRemedy;
    return verdict;
  }
  if (!confirmed && !hinted) {
    verdict.kind = Kind::kUnconfirmed;
    verdict.hint_decides = true;
    verdict.chance_wrong = std::max(verdict.chance_wrong, kEvenOdds);
    verdict.reason = (alone ? kAloneReason : FaintReason(best.photos->shifts)) + kHintRemedy;
    return verdict;
  }
  verdict.chance_counted = confirmed;
  verdict.kind = Kind::kTrusted;
  return verdict;
}

}  // namespace roomtex
