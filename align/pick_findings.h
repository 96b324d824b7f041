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

// The files are fine, but what they say contradicts each other so plainly that there is no
// alignment: exit 4.
class Contradiction : public InputError {
 public:
  using InputError::InputError;
};

// The picks lie on the surface of the scan that was read; if they lie on its mirror image instead,
// the file was read with the other azimuth sense than the one they were made with. Gives warnings;
// throws Contradiction for a mirrored scan and when half of the picks are off, InputError for a
// scan without a sample.
std::vector<std::string> CheckPicksOnScan(const AlignmentInput& input);

// Picks that say what is wrong with them are refused, as nothing that follows from them means
// anything: throws Contradiction for exchanged picks and a mirrored scan. Warns of photos whose
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
