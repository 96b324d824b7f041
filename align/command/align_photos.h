#pragma once
// roomtex-align of photos that have no sparse model.

#include "align/command/align_options.h"
#include "core/command_line.h"

namespace roomtex {

// One to a few photos, each by its own picks. Throws InputError, UsageError.
void AlignPickedPhotos(const AlignCommandOptions& a, const Command::Context& context);
// Photos each by itself, by what it shows of the scan's intensity. Throws InputError.
void AlignFoundPhotosAlone(const AlignCommandOptions& a, const Command::Context& context);

}  // namespace roomtex
