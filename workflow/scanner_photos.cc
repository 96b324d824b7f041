#include "workflow/scanner_photos.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <fstream>

#include "core/input_guard.h"

namespace roomtex {
namespace {

constexpr uint64_t kPage = 1024, kPageBytes = 1020;  // the rest of a page is its checksum
constexpr uint64_t kLongestList = 1 << 28;           // bytes

// ASTM E2807, 5: a header, and where in the file the XML section lies. "" for another file.
std::string ListOfContents(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  char header[48];
  if (!stream.read(header, sizeof header) || std::memcmp(header, "ASTM-E57", 8) != 0) return "";
  uint64_t begin, length, page;
  std::memcpy(&begin, header + 24, 8);
  std::memcpy(&length, header + 32, 8);
  std::memcpy(&page, header + 40, 8);
  if (page != kPage || length > kLongestList) return "";
  std::string text;
  uint64_t skipped = begin % kPage;
  stream.seekg(static_cast<std::streamoff>(begin - skipped));
  char bytes[kPage];
  while (text.size() < length && stream.read(bytes, kPage)) {
    if (skipped < kPageBytes) text.append(bytes + skipped, bytes + kPageBytes);
    skipped = 0;
  }
  text.resize(std::min<uint64_t>(text.size(), length));
  return text;
}

bool Holds(const std::string& text, const char* word) {
  return text.find(word) != std::string::npos;
}

}  // namespace

bool HoldsPosedPhotos(const std::string& path) {
  const std::string text = ListOfContents(path);
  const size_t begin = text.find("<images2D"), end = text.find("</images2D", begin);
  if (begin == std::string::npos || end == std::string::npos) return false;
  const char kPhoto[] = "<vectorChild";
  for (size_t at = text.find(kPhoto, begin); at < end;) {
    const size_t next = std::min(text.find(kPhoto, at + 1), end);
    const std::string photo = text.substr(at, next - at);
    at = next;
    if (!Holds(photo, "<pose")) continue;
    if (Holds(photo, "<pinholeRepresentation") || Holds(photo, "<sphericalRepresentation")) {
      return true;
    }
  }
  return false;
}

bool HasPhotoSource(const AutoOptions& options) {
  return !options.image_path.empty() || !options.panoramas_path.empty() ||
         !options.video_path.empty();
}

std::string WhyNoScannerPhotos(const AutoOptions& options) {
  if (options.scanner_photos == "0") return "--scanner_photos is 0";
  if (!options.panoramas_path.empty()) return "faces of panoramas go another way";
  if (!options.scan_poses.empty()) {
    return "--scan_poses puts the scans elsewhere than their file has its photos";
  }
  return "";
}

std::string FindScannerScan(const AutoOptions& options) {
  if (!WhyNoScannerPhotos(options).empty()) return "";
  const auto found =
      std::find_if(options.scan_paths.begin(), options.scan_paths.end(),
                   [](const std::string& path) { return HoldsPosedPhotos(FileOf(path)); });
  return found == options.scan_paths.end() ? "" : *found;
}

}  // namespace roomtex
