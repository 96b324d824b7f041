#pragma once
// Is the scan a mirror image of the room? Its picks alone cannot always tell: on one wall they fit
// either way, and in a symmetric room they lie on both surfaces. The whole alignment can.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "align/alignment.h"
#include "align/surveyed_scans.h"

namespace roomtex {

// An alignment by picks, or why there is none.
struct AlignmentAttempt {
  std::optional<Alignment> alignment;
  std::string refusal;         // of a Contradiction
  bool says_mirrored = false;  // the refusal says that the scan is mirrored
  // And that the picks were made on its mirror image: they lie there and not on the scan.
  bool picks_on_mirror_image = false;

  bool trusted() const { return alignment && alignment->reasons.empty(); }
};
// Throws InputError for picks that cannot fix a pose.
AlignmentAttempt AttemptAlignment(const AlignmentInput& input, const AlignmentOptions& options,
                                  Progress* progress);

// The scans as the other azimuth sense reads them: x of each station turned over.
std::vector<Scan> MirrorScans(std::vector<Scan> scans);

struct MirroredReading {
  enum class Kind {
    kNone,          // the scan is not mirrored, or nobody can tell
    kScan,          // it is, and the picks are right
    kScanAndPicks,  // it is, and the picks were made on it
  };
  Kind kind = Kind::kNone;
  // What speaks for it: a part of a sentence.
  std::string evidence;
  // Of kScan: the scans read the other way, and the alignment to them.
  std::unique_ptr<const std::vector<Scan>> scans;
  std::unique_ptr<const SurveyedScans> surveyed;
  AlignmentAttempt attempt;
};
// After an attempt that is not trusted, or of picks that lie on the mirror image of the scan as
// well, or fit it as well (on one wall): the same with the scan mirrored, then, with one scan, with
// the picks mirrored, too. Believed where that is trusted and leaves at most half as many sparse
// points off the surface (or, where it is not trusted as it is read, where another room would have
// them), or where the picks lie on the mirror image only.
MirroredReading FindMirroredReading(const AlignmentInput& input, const AlignmentAttempt& attempt,
                                    const AlignmentOptions& options, Progress* progress);

}  // namespace roomtex
