#include "align/mirrored_reading.h"

#include <algorithm>
#include <utility>

#include "core/text.h"

namespace roomtex {
namespace {

std::vector<Pick> MirrorPicks(std::vector<Pick> picks, const Rigid& scan_from_station) {
  for (Pick& pick : picks) {
    pick.x_in_scan = MirroredAt(scan_from_station, pick.x_in_scan);
  }
  return picks;
}

AlignmentAttempt AttemptQuietly(const AlignmentInput& input, const AlignmentOptions& options,
                                Progress* progress) {
  try {
    return AttemptAlignment(input, options, progress);
  } catch (const InputError&) {
    return {};  // what is wrong was wrong before
  }
}

// Points off the surface, as a share of those judged. A model that found no hold on the surface may
// have shrunk to where nearly all of it is near some wall.
double ShareOff(const AlignmentAttempt& attempt) {
  const bool holds = attempt.alignment && attempt.alignment->fit.surface.converged;
  return holds ? 1 - attempt.alignment->placement.SurfaceShare() : 1;
}

// The photos' picks fit a mirrored scan about as well: they lie on one plane.
bool FitEitherWay(const AlignmentInput& input, const PickReviewOptions& options) {
  constexpr double kClickNoise = 1.5;  // pixels, rms of good picks
  for (const PickView& view : ReviewViews(input.model, input.picks, options)) {
    if (!view.HasPose()) continue;
    const double rms_px = std::max(kClickNoise, view.review.RmsPx());
    if (view.review.mirrored_rms_px > options.min_gain * rms_px) return false;
  }
  return true;
}

// Points that say that another room was scanned: in the open and behind the surface alike, as a
// share of those judged.
double ShareOfAnotherRoom(const AlignmentAttempt& attempt) {
  return attempt.alignment->placement.ChangedShare();
}

// Of a coarse scan many points are off the surface either way; how many look like another room,
// where nobody believes the scan as it is, tells the two apart.
bool IsBelieved(const AlignmentAttempt& mirrored, const AlignmentAttempt& as_read) {
  if (!mirrored.trusted()) return false;
  if (ShareOff(mirrored) < 0.5 * ShareOff(as_read)) return true;
  return !as_read.trusted() && as_read.alignment &&
         ShareOfAnotherRoom(mirrored) < 0.5 * ShareOfAnotherRoom(as_read);
}

std::string Evidence(const AlignmentAttempt& mirrored, const AlignmentAttempt& as_read) {
  const std::string there = Percent(1 - ShareOff(mirrored)) + " of the sparse points lie on it";
  if (ShareOff(as_read) == 1) return "reflected, " + there;
  const std::string here = "reflected, " + there + ", as it is " + Percent(1 - ShareOff(as_read));
  if (!as_read.alignment || ShareOff(mirrored) < 0.5 * ShareOff(as_read)) return here;
  return here + "; " + Percent(ShareOfAnotherRoom(mirrored)) +
         " lie as in another room, as it is " + Percent(ShareOfAnotherRoom(as_read));
}

}  // namespace

AlignmentAttempt AttemptAlignment(const AlignmentInput& input, const AlignmentOptions& options,
                                  Progress* progress) {
  AlignmentAttempt attempt;
  try {
    attempt.alignment = AlignToScan(input, options, progress);
  } catch (const MirroredScan& mirrored) {
    attempt.refusal = mirrored.what();
    attempt.says_mirrored = true;
    attempt.picks_on_mirror_image = mirrored.picks_on_mirror_image();
  } catch (const Contradiction& contradiction) {
    attempt.refusal = contradiction.what();
  }
  return attempt;
}

std::vector<Scan> MirrorScans(std::vector<Scan> scans) {
  for (Scan& scan : scans) {
    for (size_t i = 0; i < scan.points.size(); ++i) {
      if (scan.IsMissing(static_cast<int>(i))) continue;
      scan.points[i] = MirroredAt(scan.scan_from_station, scan.points[i]);
    }
    scan.viewpoint.x() *= -1;
    for (Triangle& triangle : scan.triangles) std::swap(triangle[1], triangle[2]);
  }
  return scans;
}

MirroredReading FindMirroredReading(const AlignmentInput& input, const AlignmentAttempt& attempt,
                                    const AlignmentOptions& options, Progress* progress) {
  MirroredReading reading;
  if (attempt.trusted() && !MirroredPicksLieOnScan(input) && !FitEitherWay(input, options.picks)) {
    return reading;
  }
  reading.scans = std::make_unique<const std::vector<Scan>>(MirrorScans(input.surveyed.scans()));
  reading.surveyed =
      std::make_unique<const SurveyedScans>(*reading.scans, input.surveyed.options());
  reading.attempt =
      AttemptQuietly(input.With(input.model, *reading.surveyed, input.picks), options, progress);
  const bool by_picks = attempt.picks_on_mirror_image && reading.attempt.alignment;
  if (by_picks || IsBelieved(reading.attempt, attempt)) {
    reading.kind = MirroredReading::Kind::kScan;
    reading.evidence = Evidence(reading.attempt, attempt);
    return reading;
  }
  if (input.surveyed.scans().size() > 1) return reading;
  const std::vector<Pick> picks =
      MirrorPicks(input.picks, input.surveyed.scans()[0].scan_from_station);
  const AlignmentAttempt both =
      AttemptQuietly(input.With(input.model, *reading.surveyed, picks), options, progress);
  if (!IsBelieved(both, attempt)) return reading;
  reading.kind = MirroredReading::Kind::kScanAndPicks;
  reading.evidence = Evidence(both, attempt);
  return reading;
}

}  // namespace roomtex
