// Any bytes as a scan file of any format: an InputError or a whole scan, never a crash, a hang or
// memory out of proportion. Good files of every format to begin with:
// tests/fuzz/make_scan_corpus.sh.

#include <cstdint>
#include <cstdlib>

#include "core/error.h"
#include "core/scan_mesh.h"
#include "importers/scan_reader.h"
#include "tests/fuzz/memory_file.h"

namespace {

void RequireWhole(const roomtex::Scan& scan) {
  const size_t cells = static_cast<size_t>(scan.num_columns) * scan.num_rows;
  if (scan.points.size() != cells || scan.intensity.size() != cells) std::abort();
  if (scan.NumMissing() == static_cast<int>(cells)) std::abort();
  for (size_t i = 0; i < cells; ++i) {
    const bool missing = scan.IsMissing(static_cast<int>(i));
    if (!missing && !scan.points[i].allFinite()) std::abort();
    if (missing && (scan.intensity[i] != 0 || scan.points[i].z() == scan.points[i].z()))
      std::abort();
  }
  for (const roomtex::Triangle& triangle : roomtex::BuildScanMesh(scan, {})) {
    for (const int corner : triangle) {
      if (corner < 0 || static_cast<size_t>(corner) >= cells || scan.IsMissing(corner))
        std::abort();
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const roomtex::MemoryFile file(data, size);
  try {
    for (const roomtex::Scan& scan : roomtex::ReadScanFile(file.path(), {}).scans)
      RequireWhole(scan);
  } catch (const roomtex::InputError&) {
  }
  return 0;
}
