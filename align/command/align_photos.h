#pragma once
// roomtex-align of photos that have no sparse model.

#include "align/command/align_options.h"
#include "core/command_line.h"

namespace roomtex {

// One to a few photos, each by its own picks; those with too few for a pose by what they show of
// the scan's intensity, where the picks allow. Throws InputError, UsageError.
void AlignPickedPhotos(const AlignCommandOptions& a, const Command::Context& context);
// Photos each by itself, by what it shows of the scan's intensity. Throws InputError, UsageError.
void AlignFoundPhotosAlone(const AlignCommandOptions& a, const Command::Context& context);

}  // namespace roomtex
