// Any bytes as a LAS file: an InputError or a whole scan; never a crash, a hang or memory out of
// proportion.

#include <cstdint>

#include "core/error.h"
#include "importers/las.h"
#include "tests/fuzz/memory_file.h"
#include "tests/fuzz/whole_scan.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const roomtex::MemoryFile file(data, size);
  for (const double max_range : {0.0, 10.0}) {
    try {
      roomtex::RequireWhole(roomtex::ReadLas(file.path(), {1, max_range}));
    } catch (const roomtex::InputError&) {
    }
  }
  return 0;
}
