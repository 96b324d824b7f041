#pragma once
// Writes E57 files: scans of several stations, with colours and photos.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "core/output_file.h"
#include "core/scan.h"

namespace roomtex {

// Sections are written as they are added, the XML at the end: memory does not follow the scans. No
// index packet: some programs do not read files with one. In an E57 z is up: scans whose up axis is
// another (RTPI: y) are turned, and the photos with them.
class E57Writer {
 public:
  // Throws InputError if the file cannot be written.
  explicit E57Writer(const std::string& path);

  // The measured samples row by row from the top, in the station's frame to half a micrometre, with
  // row and column (where the scan has a grid), intensity and, unless null, colour (one per cell).
  // Scan without a name: "scan N".
  void AddScan(const Scan& scan, const CellColors* colors);

  // A photo of a pinhole camera (SIMPLE_PINHOLE, PINHOLE), or a panorama (EQUIRECTANGULAR). It is
  // said to belong to the nearest of the scans added so far.
  struct Photo {
    std::string name;
    std::string bytes;  // of a JPEG or PNG file
    Camera camera;
    Rigid cam_from_scan;
  };
  void AddPhoto(const Photo& photo);

  // Throws InputError when the disk is full.
  void Commit();

 private:
  struct Station {
    std::string guid;
    Eigen::Vector3d place;
  };

  // Bytes behind each other, with the checksums in between.
  void Write(const char* bytes, size_t count);
  void Write(const std::string& bytes) { Write(bytes.data(), bytes.size()); }
  void FlushPage();
  void Align();
  uint64_t PhysicalOffset() const;

  OutputFile output_;
  Eigen::Quaterniond file_from_scan_ = Eigen::Quaterniond::Identity();  // by the first scan's up
  std::string page_, first_page_;
  uint64_t num_pages_ = 0;
  std::vector<Station> stations_;
  std::string scans_xml_, images_xml_;
  int num_photos_ = 0;
};

// All scans in one file, with the colours that they have.
void WriteE57(const std::vector<Scan>& scans, const std::string& path);

}  // namespace roomtex
