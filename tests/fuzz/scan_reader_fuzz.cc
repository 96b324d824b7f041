// Any bytes as a scan file of any format: an InputError or a whole scan, never a crash, a hang or
// memory out of proportion. Good files of every format to begin with:
// tests/fuzz/make_scan_corpus.sh.

#include <cstdint>

#include "core/error.h"
#include "importers/scan_reader.h"
#include "tests/fuzz/memory_file.h"
#include "tests/fuzz/whole_scan.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const roomtex::MemoryFile file(data, size);
  roomtex::ScanReaderOptions options;
  // Which way is up is asked for one input in 16: of a mesh that takes 50 000 probes, however small
  // its file is.
  if (size % 16 != 0) options.up_axis = "z";
  try {
    for (const roomtex::Scan& scan : roomtex::ReadScanFile(file.path(), options).scans)
      roomtex::RequireWhole(scan);
  } catch (const roomtex::InputError&) {
  }
  return 0;
}
