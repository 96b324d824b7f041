#include "importers/scan_writer.h"

#include <algorithm>
#include <filesystem>

#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/output_file.h"
#include "core/text.h"
#include "importers/e57_writer.h"
#include "importers/pcd.h"
#include "importers/ply.h"
#include "importers/ptx.h"
#include "importers/rtpi.h"
#include "importers/xyz.h"

namespace roomtex {
namespace {

void WriteIntensityImage(const Scan& scan, const std::string& path) {
  std::vector<uint8_t> grey = IntensityAsGrey(scan);
  const cv::Mat image(scan.num_rows, scan.num_columns, CV_8UC1, grey.data());
  std::vector<uint8_t> png;
  if (!cv::imencode(".png", image, png)) {
    throw InputError(path, "", "the image cannot be encoded", "Decimate the scan");
  }
  OutputFile output(path);
  output.stream().write(reinterpret_cast<const char*>(png.data()),
                        static_cast<std::streamsize>(png.size()));
  output.Commit();
}

}  // namespace

const std::vector<std::string>& ScanWriterExtensions() {
  static const std::vector<std::string> kExtensions = {".ply", ".pcd", ".png", ".rtpi", ".ptx",
                                                       ".e57", ".las", ".xyz", ".pts",  ".csv"};
  return kExtensions;
}

std::string ScanWriterExtension(const std::string& path) {
  const std::string extension = LowerCase(std::filesystem::path(path).extension().string());
  const auto& known = ScanWriterExtensions();
  return std::find(known.begin(), known.end(), extension) != known.end() ? extension : "";
}

bool CanHold(const std::string& extension, Scan::Kind kind) {
  if (kind == Scan::Kind::kGrid) return true;
  if (extension == ".pcd" || extension == ".e57") return kind == Scan::Kind::kCloud;
  return extension != ".png" && extension != ".rtpi" && extension != ".ptx";
}

void WriteScan(const Scan& scan, const std::vector<Triangle>& triangles, const std::string& path,
               const ScanWriterOptions& options) {
  const std::string extension = ScanWriterExtension(path);
  if (extension.empty()) {
    throw UsageError(path +
                     ": the extension names no known format (.ply, .pcd, .png, .rtpi, .ptx, "
                     ".e57, .las, .xyz, .pts, .csv)");
  }
  if (!CanHold(extension, scan.kind())) {
    throw InputError(scan.path, "",
                     "is without a grid, so that it cannot be written as " + extension,
                     "Write a .ply or .las, or give the scan with its grid (RTPI, PTX or "
                     "organised PCD)");
  }
  if (extension == ".ply") WritePly({{&scan, &triangles}}, path);
  if (extension == ".pcd") WritePcd(scan, path);
  if (extension == ".png") WriteIntensityImage(scan, path);
  if (extension == ".rtpi") WriteRtpi(RtpiFromScan(scan, options.counterclockwise), path);
  if (extension == ".ptx") WritePtx({scan}, path);
  if (extension == ".e57") WriteE57({scan}, path);
  if (extension == ".las") {
    WriteLas({&scan}, path, options.las, options.coordinate_system);
  }
  if (const auto kind = XyzKindOf(extension)) WriteXyz({&scan}, path, *kind);
}

}  // namespace roomtex
