// Any bytes as a picks file: an InputError or finite picks, never a crash.

#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "align/clicks/picks.h"
#include "core/error.h"
#include "tests/fuzz/memory_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const roomtex::MemoryFile file(data, size);
  try {
    for (const roomtex::Pick& pick : roomtex::ReadPicks(file.path())) {
      if (!pick.x_in_img.allFinite() || !pick.x_in_scan.allFinite() || !(pick.weight >= 0))
        std::abort();
    }
  } catch (const roomtex::InputError&) {
  }
  return 0;
}
