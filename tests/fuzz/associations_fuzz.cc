// Any bytes as a table of associations: an InputError or named photos, never a crash.

#include <cstdint>
#include <cstdlib>

#include "core/error.h"
#include "tests/fuzz/memory_file.h"
#include "texture/sampling/photo_list.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const roomtex::MemoryFile file(data, size);
  try {
    for (const roomtex::AssociatedPhotos& pair : roomtex::ReadAssociations(file.path())) {
      if (pair.patterned_image.empty()) std::abort();
    }
  } catch (const roomtex::InputError&) {
  }
  return 0;
}
