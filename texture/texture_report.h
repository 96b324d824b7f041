#pragma once
// What report.json of roomtex-texture says of the colours, and whether they are to be trusted.

#include <string>
#include <vector>

#include "core/command_line.h"
#include "core/scan.h"
#include "importers/scan_reader.h"
#include "texture/colorize.h"

namespace roomtex {

// Coverage, and per photo gain, light in the corners, agreement, sharpness and registration.
void FillColorReport(const std::vector<PhotoView>& photos, const ColorizeOptions& options,
                     const ColorizeResult& result, const Command::Context& context);

// Warns of photos that are alone with what they show; untrusted are colours of photos that see
// nothing of the scan, or that differ as much as at random.
void JudgeColors(const std::vector<PhotoView>& photos, const ColorizeResult& result,
                 const Command::Context& context);

// Which scans were read how; they may be those that the aligned model remembers.
void FillScansReport(const PlacedScans& placed, Report* report);

// Of the last scan, read from `path`: which vertices of model.ply are its own.
Json SupplementReport(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                      const std::string& path);

}  // namespace roomtex
