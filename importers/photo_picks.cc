#include "importers/photo_picks.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/csv.h"
#include "core/output_file.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr int kCellsAcross = 3;           // of a photo, both ways
constexpr size_t kMostPhotos = 24;        // that picks are made in
constexpr size_t kFewestOfPhoto = 6;      // that give a pose
constexpr size_t kMostSamples = 2000000;  // of a scan that are looked at
constexpr double kRadius = 0.01;          // of the width, around the middle of a cell

struct Nearest {
  double range = 0;  // from the camera, metres; 0 = none yet
  PhotoPick pick;
};

std::vector<PhotoPick> PicksOf(const PosedPhoto& photo, const std::vector<Scan>& scans) {
  const CameraProjection camera(photo.camera);
  const Eigen::Vector2d cell(static_cast<double>(photo.camera.width) / kCellsAcross,
                             static_cast<double>(photo.camera.height) / kCellsAcross);
  const double radius = std::max(2.0, kRadius * photo.camera.width);
  std::array<Nearest, kCellsAcross * kCellsAcross> nearest;
  for (const Scan& scan : scans) {
    const size_t every = scan.points.size() / kMostSamples + 1;
    for (size_t i = 0; i < scan.points.size(); i += every) {
      if (scan.IsMissing(static_cast<int>(i))) continue;
      const Eigen::Vector3d x_in_cam = photo.cam_from_scan * scan.points[i];
      const auto x_in_img = camera.ImgFromCam(x_in_cam);
      if (!x_in_img || !camera.InImage(*x_in_img)) continue;
      const Eigen::Vector2d at = x_in_img->cwiseQuotient(cell).array().floor();
      const Eigen::Vector2d middle = (at.array() + 0.5) * cell.array();
      const double range = x_in_cam.norm();
      if ((*x_in_img - middle).norm() > radius || !(range > 0)) continue;
      const auto column = static_cast<size_t>(std::min<double>(at.x(), kCellsAcross - 1));
      const auto row = static_cast<size_t>(std::min<double>(at.y(), kCellsAcross - 1));
      Nearest& best = nearest[row * kCellsAcross + column];
      if (best.range > 0 && best.range <= range) continue;
      best = {range, {photo.name, *x_in_img, scan.points[i]}};
    }
  }
  std::vector<PhotoPick> picks;
  for (const Nearest& found : nearest) {
    if (found.range > 0) picks.push_back(found.pick);
  }
  if (picks.size() < kFewestOfPhoto) picks.clear();
  return picks;
}

}  // namespace

std::vector<PhotoPick> PicksOfPosedPhotos(const std::vector<PosedPhoto>& photos,
                                          const std::vector<Scan>& scans) {
  std::vector<PhotoPick> picks;
  const size_t count = std::min(photos.size(), kMostPhotos);
  for (size_t i = 0; i < count; ++i) {
    const std::vector<PhotoPick> some = PicksOf(photos[i * photos.size() / count], scans);
    picks.insert(picks.end(), some.begin(), some.end());
  }
  return picks;
}

void WritePhotoPicks(const std::vector<PhotoPick>& picks, const std::string& path) {
  OutputFile output(path);
  output.stream() << "# Made from the poses of the photos in the E57\n"
                     "image_name,x,y,scan_x,scan_y,scan_z\n";
  for (const PhotoPick& pick : picks) {
    std::vector<std::string> fields = {pick.image_name};
    for (const double x : pick.x_in_img) fields.push_back(Number(x, 6));
    for (const double x : pick.x_in_scan) fields.push_back(Number(x, 6));
    output.stream() << CsvLine(fields);
  }
  output.Commit();
}

}  // namespace roomtex
