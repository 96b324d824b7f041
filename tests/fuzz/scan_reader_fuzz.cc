// Any bytes as a scan file of any format: an InputError or a whole scan, never a crash, a hang or
// memory out of proportion. Good files of every format to begin with:
// tests/fuzz/make_scan_corpus.sh.

#include <cstdint>
#include <cstdlib>
#include <string>

#include <sys/mman.h>
#include <unistd.h>

#include "core/error.h"
#include "core/scan_mesh.h"
#include "importers/scan_reader.h"

namespace {

// A file that lives in memory only.
class MemoryFile {
 public:
  MemoryFile(const uint8_t* data, size_t size) : fd_(memfd_create("scan", 0)) {
    if (fd_ < 0 || write(fd_, data, size) != static_cast<ssize_t>(size)) std::abort();
  }
  ~MemoryFile() { close(fd_); }
  std::string path() const { return "/proc/self/fd/" + std::to_string(fd_); }

 private:
  int fd_;
};

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
  const MemoryFile file(data, size);
  try {
    for (const roomtex::Scan& scan : roomtex::ReadScanFile(file.path(), {}).scans)
      RequireWhole(scan);
  } catch (const roomtex::InputError&) {
  }
  return 0;
}
