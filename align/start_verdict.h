#pragma once
// Whether a start that was found without clicks is the right one, by evidence that the search did
// not use: the next best start, the mirror image of the model (which is nowhere), whether the
// photos show the scan's intensity where it is, and whether features that photos and scan have in
// common lead there, too.

#include <string>
#include <vector>

#include "align/alignment_input.h"
#include "align/start_search.h"

namespace roomtex {

struct StartVerdictOptions {
  // Of the photos' rays (SightAgreement::Score()): what the best start needs at least, and how many
  // times as much as the next best and as the mirror image. Larger = stricter. Where the photos
  // confirm the start, no other counts; where they support it faintly, as those of a similar room
  // do, too, and where nothing but geometry speaks for it (min_score_alone), a user must have said
  // that it is this room. Photos that confirm it clearly need less (min_score_confirmed): of a room
  // of which a third was scanned, two thirds of the rays end where nobody measured.
  double min_score = 0.55, min_score_alone = 0.7, min_score_confirmed = 0.3, min_ratio = 1.3;
  // The scan is called a mirror image where that of the model has so many times the score.
  double min_ratio_mirrored = 1.15;
  // Of the rays, those that may pass through the surface. Larger = more tolerant.
  double max_through_share = 0.12;
  // Of the corners of the scan's intensity, those that the photos must have where they should be to
  // confirm a start. Larger = stricter. With fewer they support it faintly at most, and not at all
  // where sparse points and surface agree within kExactRms: then so few are those of another room.
  // Where a coarse scan shows few corners at all, they are those of frames and furniture, which a
  // room of the same plan has, too: more of them are asked for.
  double min_photo_share = 0.35, min_photo_share_of_few = 0.6;
};

enum class PhotoSupport { kNone, kFaint, kClear };

// Of simulated rooms, what the counted ones leave possible (95 %): none of the answers with clear
// support was wrong, and none where photos and scan look alike.
inline constexpr double kChanceClear = 0.055, kChanceAlike = 0.13;

struct StartVerdict {
  enum class Kind {
    kTrusted,
    kUnconfirmed,  // little but geometry speaks for it, and no user said so
    kNone,         // there is no start at all
    kWeak,         // the best one fits too badly
    kOpen,         // the surface does not hold the model in some direction
    kAmbiguous,    // another one fits as well
    kMirrored,     // the mirror image of the model fits better
    kByPhotos,     // the photos contradict, or do not confirm what they could
  };
  Kind kind = Kind::kNone;
  int best = -1, second = -1;  // indices into StartSearch::starts; -1 = there is none
  PhotoSupport support = PhotoSupport::kNone;  // of the best one, and of no other
  bool looks_alike = false;   // the best one: as good as clear support, but where it lies exactly
  double ratio = 0;           // best score over the larger of second's and the mirror image's
  double mirrored_score = 0;  // of the best start of the mirror image
  // How many of 1000 answers with evidence like this are wrong at most, over 1000. Where the photos
  // support the place it was counted (docs/automatic.md); else it is a guess by a curve.
  double chance_wrong = 1;
  bool chance_counted = false;
  // One pick more, or --near, is all that is missing: it says that scan and photos are of one room,
  // or which of several places it is (for which --near is enough where they lie far apart).
  bool hint_decides = false;
  std::string reason;  // in sentences, with a remedy; empty if trusted
};

// As the report has it.
const char* NameOf(StartVerdict::Kind kind);

// search: the photos have been asked (start_photos.h). hinted: a user said where the photos belong,
// so that scan and photos are of one room.
StartVerdict JudgeStarts(const AlignmentInput& input, const StartSearch& search, bool hinted,
                         const StartVerdictOptions& options);

}  // namespace roomtex
