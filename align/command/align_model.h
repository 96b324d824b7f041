#pragma once
// roomtex-align of a sparse model.

#include "align/command/align_options.h"
#include "core/command_line.h"

namespace roomtex {

// Reads, aligns by picks, by known poses or without either, and writes. Throws InputError,
// UsageError.
void AlignModel(const AlignCommandOptions& a, const Command::Context& context);

}  // namespace roomtex
