#include "texture/debug_images.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include "core/output_file.h"
#include "core/parallel.h"
#include "core/photo.h"
#include "texture/output/write_texture.h"

namespace roomtex {
namespace {

constexpr double kMostDisagreement = 64;  // grey levels, the last colour of the scale
constexpr int kMostViews = 16;            // photos, the last colour of the scale

// "003_name" for the photo's files.
std::string FileStem(const std::vector<PhotoView>& photos, int photo) {
  std::string name = std::filesystem::path(photos[photo].name).replace_extension().string();
  std::replace_if(
      name.begin(), name.end(), [](char c) { return c == '/' || c == '\\'; }, '_');
  return fmt::format("{:03}_{}", photo, name);
}

// "" for the first scan, "_1" for the second ...
std::string ScanSuffix(size_t scan) { return scan == 0 ? "" : "_" + std::to_string(scan); }

cv::Mat3b ColorScale(const cv::Mat1f& value, double most) {
  cv::Mat bytes, colors;
  value.convertTo(bytes, CV_8U, 255 / most);
  cv::applyColorMap(bytes, colors, cv::COLORMAP_TURBO);
  colors.setTo(cv::Scalar(0, 0, 0), value < 0);
  return colors;
}

// What every kept observation has of the blend, 0..1, store.Count() places per sample.
class Shares {
 public:
  Shares(const DebugInput& input, int num_threads)
      : capacity_(input.blend.max_views), shares_(input.store.num_samples() * capacity_, 0.0f) {
    constexpr int kAtOnce = 1 << 14;
    const auto count = static_cast<int>(input.store.num_samples());
    ParallelFor(num_threads, 0, (count + kAtOnce - 1) / kAtOnce, [&](int block) {
      for (int i = block * kAtOnce; i < std::min(count, (block + 1) * kAtOnce); ++i) {
        const auto slot = static_cast<size_t>(i);
        BlendSample(input.store.Begin(slot), input.store.Count(slot), input.gains,
                    input.blend.outlier, &shares_[slot * capacity_]);
      }
    });
  }
  float Of(size_t slot, int place) const { return shares_[slot * capacity_ + place]; }

 private:
  int capacity_;
  std::vector<float> shares_;
};

// Calls body(slot, cell) for every sample of a grid.
template <typename Body>
void ForEachSample(const DebugInput& input, const GridOfSamples& grid, const Body& body) {
  for (size_t t = grid.first_tile; t < grid.end_tile; ++t) {
    const SampleTile& tile = input.scene.samples[t];
    for (int i = 0; i < tile.points.size(); ++i) {
      body(static_cast<size_t>(tile.first_slot) + i, tile.index[i]);
    }
  }
}

cv::Size SizeOf(const GridOfSamples& grid) { return {grid.num_columns, grid.num_rows}; }

void WriteScanImages(const DebugInput& input, size_t scan, const std::string& folder) {
  const GridOfSamples& grid = input.grids[scan];
  cv::Mat3b dominant(SizeOf(grid), cv::Vec3b(0, 0, 0));
  cv::Mat1f views(SizeOf(grid), -1.0f), disagreement(SizeOf(grid), -1.0f);
  ForEachSample(input, grid, [&](size_t slot, int cell) {
    const Observation* const seen = input.store.Begin(slot);
    const int count = NumThatCount(seen, input.store.Count(slot), input.gains);
    const int row = cell / grid.num_columns, column = cell % grid.num_columns;
    views(row, column) = count > 0 ? static_cast<float>(input.store.NumViews(slot)) : 0.0f;
    const BlendedSample sample = BlendSample(seen, count, input.gains, input.blend.outlier);
    if (sample.dominant_photo >= 0) dominant(row, column) = ColorOfPhoto(sample.dominant_photo);
    float sum = 0;
    int num_pairs = 0;
    std::vector<Eigen::Vector3f> colors;
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector3f light =
          UnpackColor(seen[i].color).cwiseProduct(input.gains[seen[i].photo]);
      Eigen::Vector3f& color = colors.emplace_back();
      for (int k = 0; k < 3; ++k) color[k] = SrgbByteFromLinear(light[k]);
      for (int j = 0; j < i; ++j, ++num_pairs) sum += (colors[i] - colors[j]).cwiseAbs().mean();
    }
    if (num_pairs > 0) disagreement(row, column) = sum / static_cast<float>(num_pairs);
  });
  const std::string suffix = ScanSuffix(scan) + ".png";
  WritePng(dominant, folder + "/significance" + suffix);
  WritePng(ColorScale(views, kMostViews), folder + "/num_photos" + suffix);
  WritePng(ColorScale(disagreement, kMostDisagreement), folder + "/disagreement" + suffix);
}

cv::Vec3b ColorOfSight(Sight sight) {
  switch (sight) {
    case Sight::kHidden:
      return {90, 90, 90};
    case Sight::kShadow:
      return {220, 90, 30};
    case Sight::kFringe:
      return {200, 60, 200};
    case Sight::kBoundary:
      return {40, 200, 240};
    case Sight::kClear:
      return {60, 180, 60};
  }
  return {0, 0, 0};
}

// How a photo sees a scan's samples. Clear ones are lighter where the thesis' weight is larger.
cv::Mat3b SightImage(const DebugInput& input, const GridOfSamples& grid,
                     const PhotoProjector& projector, const PhotoVisibility& visibility) {
  cv::Mat3b image(SizeOf(grid), cv::Vec3b(0, 0, 0));
  ProjectedBlock projected;
  const auto width = static_cast<float>(projector.width());
  const auto height = static_cast<float>(projector.height());
  for (size_t t = grid.first_tile; t < grid.end_tile; ++t) {
    const SampleTile& tile = input.scene.samples[t];
    if (!projector.MaySee(tile.points.origin, tile.points.radius)) continue;
    projector.Project(tile.points, &projected);
    const Eigen::Vector3f camera = projector.CentreFrom(tile.points.origin);
    for (int i = 0; i < tile.points.size(); ++i) {
      const float x = projected.x[i], y = projected.y[i], depth = projected.depth[i];
      if (!(depth > 0) || !(x >= 0 && y >= 0 && x <= width && y <= height)) continue;
      const Eigen::Vector3f point(tile.points.x[i], tile.points.y[i], tile.points.z[i]);
      cv::Vec3b color(40, 40, 40);  // turned away
      if (FacesCamera(camera - point, tile.NormalTowards(camera - point, i))) {
        const Sight sight = visibility.Look(x, y, depth);
        color = ColorOfSight(sight);
        if (sight == Sight::kClear) {
          color *= 0.5 + 0.6 * ThesisWeight(x, y, width, height, false);
        }
      }
      image(tile.index[i] / grid.num_columns, tile.index[i] % grid.num_columns) = color;
    }
  }
  return image;
}

// The photo's colours, brought to one exposure, times what they have of the blend: the sum of all
// photos' images, in linear light, is the blend.
cv::Mat3b ContributionImage(const DebugInput& input, const GridOfSamples& grid,
                            const Shares& shares, int photo) {
  cv::Mat3b image(SizeOf(grid), cv::Vec3b(0, 0, 0));
  ForEachSample(input, grid, [&](size_t slot, int cell) {
    const Observation* const seen = input.store.Begin(slot);
    for (int i = 0; i < input.store.Count(slot); ++i) {
      if (seen[i].photo != static_cast<unsigned>(photo)) continue;
      const Eigen::Vector3f light =
          shares.Of(slot, i) * UnpackColor(seen[i].color).cwiseProduct(input.gains[photo]);
      cv::Vec3b& pixel = image(cell / grid.num_columns, cell % grid.num_columns);
      for (int k = 0; k < 3; ++k) pixel[2 - k] = SrgbByteFromLinear(light[k]);
    }
  });
  return image;
}

// Millimetres along the optical axis in 16 bits.
cv::Mat DepthImage(const cv::Mat1f& inverse_depth) {
  cv::Mat_<uint16_t> image(inverse_depth.size(), uint16_t{0});
  std::transform(inverse_depth.begin(), inverse_depth.end(), image.begin(), [](float w) {
    return w > 0 ? static_cast<uint16_t>(std::clamp(1000.0f / w + 0.5f, 1.0f, 65535.0f)) : 0;
  });
  return image;
}

void WritePhotoImages(const DebugInput& input, const Shares& shares, int photo,
                      const std::string& folder) {
  const PhotoView& view = input.photos[photo];
  const std::string stem = folder + "/" + FileStem(input.photos, photo);
  const PhotoProjector projector(view);
  const PhotoVisibility visibility(projector, input.scene.occluders, input.scene.angular_spacing,
                                   input.occlusion);
  const cv::Mat1f& inverse_depth = visibility.surface().inverse_depth();
  WritePng(DepthImage(inverse_depth), stem + "_depth_mm.png");
  double nearest = 0;
  cv::minMaxLoc(inverse_depth, nullptr, &nearest);
  cv::Mat1f near = inverse_depth.clone();
  near.setTo(-1.0f, inverse_depth <= 0);
  WriteJpeg(ColorScale(near, std::max(nearest, 1e-6)), stem + "_depth.jpg");

  cv::Mat picture = ReadPhoto(view.path, view.pixels);
  cv::resize(picture, picture, inverse_depth.size(), 0, 0, cv::INTER_AREA);
  const auto tint = [&picture](const cv::Mat& mask, const cv::Scalar& color) {
    cv::Mat tinted = 0.4 * picture + 0.6 * color;
    tinted.copyTo(picture, mask);
  };
  tint(visibility.boundary_mask(), {40, 40, 255});
  tint(inverse_depth <= 0, {255, 80, 0});
  WriteJpeg(picture, stem + "_boundary.jpg");

  for (size_t s = 0; s < input.scans.size(); ++s) {
    if (!input.scans[s].organised) continue;
    const std::string suffix = ScanSuffix(s) + ".png";
    WritePng(SightImage(input, input.grids[s], projector, visibility), stem + "_sight" + suffix);
    WritePng(ContributionImage(input, input.grids[s], shares, photo),
             stem + "_contribution" + suffix);
  }
}

void WriteLegend(const DebugInput& input, const std::string& folder) {
  OutputFile file(folder + "/README.txt");
  std::ostream& out = file.stream();
  out << "What roomtex-texture --debug_path shows.\n\n"
         "Per photo, NNN_NAME_... (pictures of the photo have the size of its depth map):\n"
         "  depth_mm.png      depth along the optical axis, 16 bit, millimetres; 0 = no surface\n"
         "  depth.jpg         the same as colours: red = near ... blue = far; black = no surface\n"
         "  boundary.jpg      the photo; red = depth boundaries, where it has little weight;\n"
         "                    blue = no surface of the scan\n"
         "  sight.png         the scan's grid: green = seen, lighter with more weight; yellow =\n"
         "                    beside a depth boundary; violet = too near past the last sample of\n"
         "                    something nearer; blue = through space that the scanner did not "
         "see;\n"
         "                    grey = hidden; dark grey = turned away; black = not in the photo\n"
         "  contribution.png  the scan's grid: the photo's colours in the common exposure times\n"
         "                    its share of the blend; the sum over all photos, in linear light,\n"
         "                    is the blend without the preserved detail\n\n"
         "Per scan (_1, _2 ... = second, third scan):\n"
         "  significance.png  the photo that dominates (thesis 8.2.3), by colour, see below\n"
         "  num_photos.png    photos that see a sample: blue = 0 ... red = "
      << kMostViews
      << " or more\n"
         "  disagreement.png  mean difference between two photos that see a sample, in the common\n"
         "                    exposure: blue = 0 ... red = "
      << kMostDisagreement
      << " of 255 or more; black = fewer than two\n\n"
         "Colours of the photos, red green blue, and the factors that bring them to one exposure "
         "(linear light):\n";
  for (size_t i = 0; i < input.photos.size(); ++i) {
    const cv::Vec3b color = ColorOfPhoto(static_cast<int>(i));
    out << fmt::format("  {:3} {:3} {:3}   {:.3f} {:.3f} {:.3f}   {}\n", color[2], color[1],
                       color[0], input.gains[i][0], input.gains[i][1], input.gains[i][2],
                       FileStem(input.photos, static_cast<int>(i)));
  }
  file.Commit();
}

}  // namespace

cv::Vec3b ColorOfPhoto(int photo) {
  // Hues a golden ratio apart, in turns of lightness.
  const double hue = std::fmod(0.618033988749895 * photo, 1.0) * 180;
  const double value = 255 - 60 * (photo % 3), saturation = 220 - 70 * (photo / 3 % 2);
  const cv::Mat3b hsv(1, 1,
                      cv::Vec3b(static_cast<uint8_t>(hue), static_cast<uint8_t>(saturation),
                                static_cast<uint8_t>(value)));
  cv::Mat bgr;
  cv::cvtColor(hsv, bgr, cv::COLOR_HSV2BGR);
  return bgr.at<cv::Vec3b>(0, 0);
}

void WriteDebugImages(const std::string& folder, const DebugInput& input, int num_threads,
                      Progress* progress) {
  MakeFolder(folder);
  const auto num_photos = static_cast<int>(input.photos.size());
  progress->Stage("debug images", num_photos);
  for (size_t s = 0; s < input.scans.size(); ++s) {
    if (input.scans[s].organised) WriteScanImages(input, s, folder);
  }
  const Shares shares(input, num_threads);
  ParallelFor(num_threads, 0, num_photos, [&](int photo) {
    WritePhotoImages(input, shares, photo, folder);
    progress->Tick();
  });
  WriteLegend(input, folder);
}

}  // namespace roomtex
