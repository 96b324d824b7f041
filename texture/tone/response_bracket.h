#pragma once
// The response curve from a bracket: photos of one still scene, exposed differently (Debevec and
// Malik 1997, by OpenCV).

#include <string>

#include "texture/sampling/photo_tone.h"

namespace roomtex {

// folder: at least three photos of the same size, taken from one place, whose EXIF exposures span
// at least two EV. One curve for all channels. Throws InputError.
ResponseCurve ResponseFromBracket(const std::string& folder);

}  // namespace roomtex
