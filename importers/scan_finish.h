#pragma once
// What every scan goes through as soon as it is read, whatever its format.

#include "importers/scan_reader.h"

namespace roomtex {

// Far places out, grid and up axis found again where the file does not say them, doubts about its
// unit noted, colours taken for the intensity where options ask for it. scan: of `file`, as its
// format gave it. Throws InputError if nothing is left.
void FinishScan(const ScanReaderOptions& options, ScanFile* file, Scan* scan);

}  // namespace roomtex
