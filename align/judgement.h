#pragma once
// Whether an alignment is to be believed, in sentences; trust.h has what it is measured by.

#include <map>
#include <string>
#include <vector>

#include "align/alignment_fit.h"
#include "align/alignment_input.h"
#include "align/start.h"
#include "align/trust/disagreement.h"
#include "align/trust/expected_error.h"
#include "align/trust/gradient_shift.h"
#include "align/trust/open_directions.h"

namespace roomtex {

struct Judgement {
  // Of the similarity: by the surface where it was refined, else by the picks; with what sparse
  // model and scan disagree in.
  ExpectedError expected_error;
  std::map<uint32_t, PhotoSigma> photo_sigmas;  // by image_id
  ShapeDisagreement disagreement;
  OpenDirections open;  // what the surface leaves to the picks
  Placement placement;
  std::vector<std::string> warnings;
  // Why the answer is not to be trusted; empty = trusted.
  std::vector<std::string> reasons;
  // One more reason, or "", that photos can overrule (OverruleByPhotos): too few points on the
  // surface for a laser scan; or too few for a coarse one, or too many before it and behind, so
  // that scan and photos differ.
  struct Doubt {
    std::string reason;
    bool differs = false;  // the latter
  } doubt;
  // Photos overruled that they differ: the surface is where the room is, but not as the photos have
  // it. Following it brings photos out of place: in scans that drift by 4 cm per coordinate from 51
  // and 88 mm to 141 and 110, for no better colours (docs/real-rooms.md).
  bool follows_surface = true;
};

// Metres; a sparse point this near to the surface is on it.
double SurfaceTolerance(const TrustOptions& trust, const ScanPatches& surface);

// Picks and scale of the start, similarity and placement of the fit: before the poses are adjusted,
// which brings points to the surface that do not belong there, too.
Judgement JudgeFit(const AlignmentInput& input, const AlignmentStart& start,
                   const AlignmentFit& fit, const AlignmentOptions& options);

// Whether photos overrule such a doubt. differs: points float, or hardly any lies on the surface;
// else they are merely few.
bool Overrules(const GradientAgreement& photos, bool differs, const TrustOptions& trust);

// Decides on Judgement::doubt: by photos and intensity (agreement.h), where there are both; else it
// is a reason like the others.
void OverruleByPhotos(const AlignmentInput& input, const AlignmentFit& fit,
                      const TrustOptions& trust, Judgement* judgement);

// What speaks against an adjustment, or should be known of it. All of it warnings: the similarity
// remains.
std::vector<std::string> AdjustmentWarnings(const ModelAdjustment& adjustment,
                                            const ShapeDisagreement& disagreement,
                                            const SparseModel& model);

// Fewer than six picks that can be used are too few to rely on (kMinPicksPerPhoto), unless those
// that were left out turn out to be right on the surface. The alignment by the others stands. A
// reason, or "". surface_px: one per pick, distance where the sparse points lie on the surface.
std::string JudgePicksLeftOut(const AlignmentInput& input, const AlignmentStart& start,
                              const std::vector<double>& surface_px, const TrustOptions& trust);

// Picks that stand far off where the aligned model puts them although nothing suffers, since the
// surface holds it: a wrong click is worth knowing of. Farther than five times the median and than
// min_bad_pick_px; surface_px as above.
std::vector<std::string> PicksOffWarnings(const AlignmentStart& start,
                                          const std::vector<double>& surface_px,
                                          double min_bad_pick_px);

}  // namespace roomtex
