#pragma once
// What roomtex-align says about picks before it believes an alignment by them: refusals, and
// warnings in sentences.

#include <string>
#include <vector>

#include "align/alignment_input.h"
#include "align/clicks/pick_view.h"
#include "align/start.h"
#include "core/error.h"

namespace roomtex {

// Metres from the surface of the scan (SurveyedScans::DistancesOf) up to which a pick counts as
// being on it.
inline constexpr double kPickReach = 0.06;

// The files are fine, but what they say contradicts each other so plainly that there is no
// alignment: exit 4.
class Contradiction : public InputError {
 public:
  using InputError::InputError;
};

// A Contradiction that is solved by reading the scan as its mirror image.
class MirroredScan : public Contradiction {
 public:
  MirroredScan(const std::string& path, const std::string& finding, const std::string& remedy,
               bool picks_on_mirror_image)
      : Contradiction(path, "", finding, remedy), picks_on_mirror_image_(picks_on_mirror_image) {}
  // The picks lie on the mirror image; else on the scan as it was read, so that they are mirrored,
  // too.
  bool picks_on_mirror_image() const { return picks_on_mirror_image_; }

 private:
  bool picks_on_mirror_image_;
};

// What to do about a mirrored scan.
std::string MirrorRemedy(const AlignmentInput& input);

// The picks lie on the surface of the scan that was read; if they lie on its mirror image instead,
// the file was read with the other azimuth sense than the one they were made with. Gives warnings;
// throws MirroredScan, Contradiction when half of the picks are off, and InputError for a scan
// without a sample.
std::vector<std::string> CheckPicksOnScan(const AlignmentInput& input);

// All picks but a third lie on the mirror image of the scan, too: a room may be symmetric where it
// was picked.
bool MirroredPicksLieOnScan(const AlignmentInput& input);

// Picks that say what is wrong with them are refused, as nothing that follows from them means
// anything: throws Contradiction for exchanged picks, MirroredScan. Warns of photos whose
// picks fix no pose, and of picks that were left out.
std::vector<std::string> CheckViews(const AlignmentInput& input,
                                    const std::vector<PickView>& views);

// The same of photos without a sparse model, each of which needs a pose of its own: one that has
// none is left out, said in a warning. Throws InputError or Contradiction if none has.
std::vector<std::string> CheckPhotoViews(const AlignmentInput& input,
                                         const std::vector<PickView>& views);

// Throws InputError or Contradiction if there is no start: views are those that it was looked for
// in. Warns of what does not go together with the other photos' picks.
std::vector<std::string> CheckStart(const AlignmentInput& input, const std::vector<PickView>& views,
                                    const PickStart& found);

}  // namespace roomtex
