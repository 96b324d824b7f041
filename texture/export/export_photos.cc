#include "texture/export/export_photos.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "colmap_ext/dense_workspace.h"
#include "core/error.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/parallel.h"
#include "core/photo.h"
#include "core/text.h"
#include "texture/export/moving_things.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;

constexpr int kJpegQuality = 95;
constexpr float kMaxMillimetres = 65535;
constexpr int kMaxPairs = 1000000;  // per photo, for the mask
// Photos that give the colour: with the one in which something moved, which mostly is none of them,
// three, since fewer cannot outvote one.
constexpr int kMinViewsToAgree = 2;
constexpr int kNormalRadius = 2;  // pixels

void WriteImageFile(const std::string& path, const cv::Mat& picture) {
  std::vector<uchar> bytes;
  const std::string extension = fs::path(path).extension().string();
  // What OpenCV cannot write becomes a JPEG of the same name: its content says what it is.
  if (!cv::haveImageWriter(path) ||
      !cv::imencode(extension, picture, bytes, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality})) {
    cv::imencode(".jpg", picture, bytes, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
  }
  OutputFile file(path);
  file.stream().write(reinterpret_cast<const char*>(bytes.data()),
                      static_cast<std::streamsize>(bytes.size()));
  file.Commit();
}

// Metres along the optical axis, 0 = unknown: the scan's mesh as drawn, which ends at depth edges.
cv::Mat1f DepthOfScan(const PhotoProjector& projector, const ExportScene& scene,
                      const cv::Mat1b& shown) {
  DepthMap map(projector.width(), projector.height(), 1.0);
  for (const OccluderTiles& tiles : scene.occluders) map.Draw(projector, tiles.surface);
  cv::Mat1f depth = map.inverse_depth();
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      depth(y, x) = depth(y, x) > 0 && shown(y, x) != 0 ? 1 / depth(y, x) : 0;
    }
  }
  return depth;
}

cv::Mat1w InMillimetres(const cv::Mat1f& depth) {
  cv::Mat1w result(depth.size());
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      const float mm = std::round(1000 * depth(y, x));
      result(y, x) = mm > 0 && mm <= kMaxMillimetres ? static_cast<uint16_t>(mm) : 0;
    }
  }
  return result;
}

// Holes that are smaller than the spacing of the samples are none.
cv::Mat1b ScannedArea(const cv::Mat1f& depth, double spacing_px) {
  cv::Mat1b scanned = depth > 0;
  const int size = 2 * static_cast<int>(std::ceil(spacing_px)) + 1;
  cv::morphologyEx(scanned, scanned, cv::MORPH_CLOSE,
                   cv::getStructuringElement(cv::MORPH_RECT, {size, size}));
  return scanned;
}

double ShareOfZeros(const cv::Mat1b& mask) {
  return 1 - static_cast<double>(cv::countNonZero(mask)) / static_cast<double>(mask.total());
}

class PhotoExporter {
 public:
  PhotoExporter(const ExportScene& scene, const PhotoView& photo, ExportFormat format,
                const ExportOptions& options, const std::string& folder)
      : scene_(scene), photo_(photo), format_(format), options_(options), folder_(folder) {}

  ExportedPhoto Export() {
    const cv::Mat taken = ReadPhoto(photo_.path, photo_.pixels);
    ExportedPhoto result{photo_.name,
                         *PinholeCamera(photo_.camera, options_.pinhole),
                         photo_.cam_from_scan,
                         {},
                         0,
                         0};
    const auto [picture, shown] = Undistorted(taken, result.camera);
    const std::string path = PathInside(folder_ + "/images", photo_.name);
    if (picture.data == taken.data && photo_.pixels == PhotoPixels::kAsStored) {
      fs::copy_file(photo_.path, path);  // already as it should be: no second JPEG
    } else {
      WriteImageFile(path, picture);
    }
    PhotoView view = photo_;
    view.camera = result.camera;
    const PhotoProjector projector(view);
    const cv::Mat1f depth = DepthOfScan(projector, scene_, shown);
    WriteDepth(result.camera, depth);
    const std::vector<ColorPair> pairs = LookAtSamples(projector, picture, shown, &result);
    const double spacing_px = scene_.angular_spacing * result.camera.MeanFocalLength();
    if (options_.masks) {
      const int cell = std::max({8, result.camera.width / 160, static_cast<int>(2 * spacing_px)});
      cv::Mat1b mask = MaskOfMovingThings(pairs, result.camera.width, result.camera.height, cell);
      result.share_moving = ShareOfZeros(mask);
      mask.setTo(0, shown == 0);
      WriteImageFile(PathInside(folder_ + "/masks", photo_.name + ".png"), mask);
    }
    const cv::Mat1b scanned = ScannedArea(depth, spacing_px);
    result.share_unscanned = ShareOfZeros(scanned);
    if (options_.masks) {
      WriteImageFile(PathInside(folder_ + "/scan_masks", photo_.name + ".png"), scanned);
    }
    return result;
  }

 private:
  // What is transparent in the photo shows nothing, as what lies beyond its borders.
  UndistortedPhoto Undistorted(const cv::Mat& taken, const Camera& pinhole) const {
    UndistortedPhoto result = UndistortPhoto(taken, photo_.camera, pinhole);
    if (!photo_.transparent) return result;
    const cv::Mat1b transparent = ReadTransparency(photo_.path, photo_.pixels);
    if (transparent.size() != taken.size()) return result;  // another file by now
    const cv::Mat there = UndistortPhoto(transparent, photo_.camera, pinhole).picture;
    result.shown.setTo(0, there > 0);
    return result;
  }

  void WriteDepth(const Camera& camera, const cv::Mat1f& depth) const {
    if (format_ == ExportFormat::kNerfstudio) {
      WriteImageFile(PathInside(folder_ + "/depths", photo_.name + ".png"), InMillimetres(depth));
      return;
    }
    const DenseWorkspace workspace{folder_};
    WriteDenseArray({depth}, workspace.DepthMapPath(photo_.name, "geometric"));
    WriteDenseArray(NormalsOfDepth(depth, camera.params, kNormalRadius),
                    workspace.NormalMapPath(photo_.name, "geometric"));
  }

  std::vector<ColorPair> LookAtSamples(const PhotoProjector& projector, const cv::Mat& picture,
                                       const cv::Mat1b& shown, ExportedPhoto* result) const {
    const PhotoVisibility visibility(projector, scene_.occluders, scene_.angular_spacing,
                                     options_.occlusion);
    cv::Mat blurred;
    cv::blur(picture, blurred, {3, 3});
    const int every = static_cast<int>(scene_.colors.size() / kMaxPairs) + 1;
    std::vector<ColorPair> pairs;
    ProjectedBlock projected;
    for (const SampleTile& tile : scene_.samples) {
      if (!projector.MaySee(tile.points.origin, tile.points.radius)) continue;
      projector.Project(tile.points, &projected);
      const Eigen::Vector3f camera = projector.CentreFrom(tile.points.origin);
      for (int i = 0; i < tile.points.size(); ++i) {
        const int slot = tile.first_slot + i;
        const int point = scene_.point_of_sample[slot];
        const bool for_mask = slot % every == 0 && scene_.views[slot] >= kMinViewsToAgree;
        if (point < 0 && !for_mask) continue;
        const float x = projected.x[i], y = projected.y[i], depth = projected.depth[i];
        if (!(depth > 0 && x >= 0 && y >= 0 && x < static_cast<float>(picture.cols) &&
              y < static_cast<float>(picture.rows))) {
          continue;
        }
        const int column = static_cast<int>(x), row = static_cast<int>(y);
        const Eigen::Vector3f sample(tile.points.x[i], tile.points.y[i], tile.points.z[i]);
        if (shown(row, column) == 0 || !FacesCamera(camera - sample, tile.normals[i])) continue;
        if (visibility.Look(x, y, depth) != Sight::kClear) continue;
        if (point >= 0) result->sights.push_back({point, {x, y}});
        const auto& bgr = blurred.at<cv::Vec3b>(row, column);
        if (for_mask) pairs.push_back({x, y, {bgr[2], bgr[1], bgr[0]}, scene_.colors[slot]});
      }
    }
    return pairs;
  }

  const ExportScene& scene_;
  const PhotoView& photo_;
  ExportFormat format_;
  const ExportOptions& options_;
  const std::string& folder_;
};

}  // namespace

void ExportOptions::Declare(OptionFields* fields) {
  fields
      ->Int("max_points", &max_points,
            "Largest number of points, spread evenly over what at least two photos see. Larger = "
            "finer, slower to train.")
      .Within(100, 20000000);
  fields
      ->Int("max_image_size", &pinhole.max_image_size,
            "Longest side of the undistorted photos, pixels; 0 = as fine as the photos. Depth maps "
            "and masks have the same size.")
      .Within(16, 100000, "pixels")
      .Or(0);
  fields
      ->Number("max_field_of_view", &pinhole.max_field_deg,
               "Largest angle between opposite sides of an undistorted fisheye photo, degrees. "
               "Larger = more is kept, and the borders are stretched more.")
      .Within(10, 170, "degrees");
  fields->Bool("masks", &masks,
               "Write masks: of what moved (masks/), and of what the scan does not have "
               "(scan_masks/); black = not to be used.");
}

std::vector<std::string> ExportOptions::Problems() const {
  std::vector<std::string> problems = ProblemsOf(*this);
  AppendProblems(occlusion.Problems(), &problems);
  return problems;
}

std::vector<ExportedPhoto> ExportPhotos(const ExportScene& scene,
                                        const std::vector<PhotoView>& photos, ExportFormat format,
                                        const ExportOptions& options, const std::string& folder,
                                        int num_threads, Progress* progress,
                                        std::vector<PhotoLeftOut>* left_out) {
  std::vector<std::optional<ExportedPhoto>> results(photos.size());
  std::vector<std::string> problems(photos.size());
  ParallelFor(num_threads, 0, static_cast<int>(photos.size()), [&](int i) {
    if (!PinholeCamera(photos[i].camera, options.pinhole)) {
      problems[i] = photos[i].camera.IsPanorama()
                        ? "It is a panorama, which no pinhole camera shows: cut it into faces "
                          "(roomtex-import), or export with --format e57."
                        : "Nothing of it is left without its distortion: check its camera.";
      return;
    }
    try {
      results[i] = PhotoExporter(scene, photos[i], format, options, folder).Export();
    } catch (const InputError& error) {
      // Of the photo itself: what cannot be written is nobody's fault but the disk's.
      if (BeginsWith(error.what(), folder)) throw;
      problems[i] = error.what();
    }
    progress->Tick();
  });
  std::vector<ExportedPhoto> exported;
  for (size_t i = 0; i < photos.size(); ++i) {
    if (results[i]) exported.push_back(std::move(*results[i]));
    if (!problems[i].empty()) left_out->push_back({photos[i].name, problems[i]});
  }
  return exported;
}

}  // namespace roomtex
