// Any bytes as an E57 file whose checksums are not looked at, so that what lies behind them is
// reached: an InputError or whole scans, never a crash, a hang or memory out of proportion. Good
// files to begin with: tests/fuzz/make_scan_corpus.sh.

#include <cstdint>

#include "core/error.h"
#include "importers/e57.h"
#include "tests/fuzz/memory_file.h"
#include "tests/fuzz/whole_scan.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const roomtex::MemoryFile file(data, size);
  roomtex::E57Options options;
  options.check = false;
  try {
    for (const roomtex::Scan& scan : roomtex::ReadE57(file.path(), "", options, nullptr)) {
      roomtex::RequireWhole(scan);
    }
  } catch (const roomtex::InputError&) {
  }
  return 0;
}
