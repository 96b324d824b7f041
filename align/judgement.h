#pragma once
// Whether an alignment is to be believed, in sentences (Alignment::reasons); trust.h has what it
// is measured by.

#include <string>

#include "align/alignment.h"

namespace roomtex {

std::string Number(double value, int digits);  // fixed, `digits` behind the point
std::string LineOf(const Pick& pick);          // "line 4"

// Picks, scale and placement of an alignment before its poses are adjusted.
void JudgeAlignment(const AlignmentInput& input, const TrustOptions& trust, Alignment* result);

// Fewer than six picks that can be used are too few to rely on (kMinPicksPerPhoto), unless those
// that were left out turn out to be right on the surface. The alignment by the others stands.
void JudgePicksLeftOut(double rms_limit_px, Alignment* result);

}  // namespace roomtex
