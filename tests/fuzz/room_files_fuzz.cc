// Any bytes as what roomtex-auto and roomtex-site read: site.csv, cameras.txt, evidence.ply, and
// the steps.json, report.json and log/align.json of a room; an InputError or an answer, never a
// crash.

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "core/partial_path.h"
#include "tests/fuzz/try_read.h"
#include "workflow/capture_facts.h"
#include "workflow/evidence_points.h"
#include "workflow/room_coverage.h"
#include "workflow/site_page.h"
#include "workflow/site_rooms.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const roomtex::PartialFolder folder(std::filesystem::temp_directory_path().string());
  static const bool made = std::filesystem::create_directories(folder / "room/log");
  if (!made) std::abort();
  for (const char* name : {"steps.json", "report.json", "log/align.json"}) {
    std::ofstream stream(folder / ("room/" + std::string(name)), std::ios::binary);
    stream.write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  }
  const std::string path = folder / "room/report.json";
  roomtex::TryRead([&] { roomtex::ReadSiteRooms(path); });
  roomtex::TryRead([&] { roomtex::ReadKnownCameras(path); });
  roomtex::TryRead([&] {
    const std::vector<roomtex::EvidencePoint> points = roomtex::ReadEvidencePoints(path);
    const roomtex::PlanFrame frame =
        roomtex::MakePlanFrame(points, Eigen::Vector3d::UnitZ(), nullptr);
    roomtex::MeasureCoverage(points, frame, {});
  });
  roomtex::TryRead([&] {
    const roomtex::Json keys =
        roomtex::MakeSiteKeys(folder.path(), roomtex::FindSiteRooms(folder.path()));
    roomtex::MakeSitePage(keys, "");
  });
  return 0;
}
