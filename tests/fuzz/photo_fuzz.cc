// Any bytes as a photo: size, EXIF and pixels, or an InputError; never a crash.

#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "core/error.h"
#include "core/photo.h"
#include "tests/fuzz/memory_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const roomtex::MemoryFile file(data, size);
  roomtex::ReadPhotoSize(file.path());
  const roomtex::ExposureData exposure = roomtex::ReadExposureData(file.path());
  if (exposure.exposure_time && !(*exposure.exposure_time > 0)) std::abort();
  roomtex::ReadLensData(file.path());
  roomtex::ReadFocalLength(file.path());
  const auto gps = roomtex::ReadGpsData(file.path());
  if (gps && !(std::abs(gps->latitude_deg) <= 90)) std::abort();
  try {
    if (size < 4096) roomtex::ReadPhoto(file.path());
  } catch (const roomtex::InputError&) {
  }
  return 0;
}
