#include "texture/texels/texel_pass.h"

#include <algorithm>
#include <cmath>

#include "core/free_vectors.h"

namespace roomtex {
namespace {

struct Band {
  int first, end;            // rows to colour
  int first_read, end_read;  // with the rows beside them that filters reach for
};

// Bands begin and end where tiles of samples do (mesh_tiles.cc), so that the numbers are the same
// to the last bit with any bands.
constexpr int kTileRows = 32;

std::vector<Band> SplitIntoBands(const TexelSource& source, const TexelPassOptions& options) {
  const int rows = source.num_rows();
  // Three sigmas of the Gaussian, the borders of dominance and their neighbours.
  const bool has_detail = options.blend.detail || options.choice != nullptr;
  const int halo =
      has_detail ? static_cast<int>(std::ceil(3 * options.detail.sigma)) + options.detail.border + 2
                 : 0;
  const double bytes_per_row = BytesPerTexel(options.blend) * source.num_columns();
  const double fitting = options.max_bytes / bytes_per_row - 2 * halo;
  const int most = static_cast<int>(std::clamp(fitting, std::max(16.0, 2.0 * halo), 1e9));
  const int count = std::max(1, (rows + most - 1) / most);
  std::vector<Band> bands;
  for (int i = 0; i < count; ++i) {
    const int first = static_cast<int>(static_cast<int64_t>(rows) * i / count);
    const int end = static_cast<int>(static_cast<int64_t>(rows) * (i + 1) / count);
    bands.push_back({first, end, std::max(0, (first - halo) / kTileRows * kTileRows),
                     std::min(rows, (end + halo + kTileRows - 1) / kTileRows * kTileRows)});
  }
  return bands;
}

// Numbers of the photos that may see something of the samples.
std::vector<int> PhotosThatMaySee(const std::vector<PhotoView>& photos,
                                  const std::vector<SampleTile>& samples) {
  std::vector<int> numbers;
  for (size_t i = 0; i < photos.size(); ++i) {
    const PhotoProjector projector(photos[i]);
    const bool may_see = std::any_of(samples.begin(), samples.end(), [&](const SampleTile& tile) {
      return projector.MaySee(tile.points.origin, tile.points.radius);
    });
    if (may_see) numbers.push_back(static_cast<int>(i));
  }
  return numbers;
}

ColorGrid ColorizeBand(const TexelSource& source, const Band& band,
                       const std::vector<PhotoView>& photos,
                       const std::vector<Eigen::Vector3f>& gains, const TexelPassOptions& options,
                       int num_threads, PhotoPassInput* scene, Progress* progress) {
  TexelBlock block = source.Rows(band.first_read, band.end_read);
  PhotoPassInput input;
  input.angular_spacing = scene->angular_spacing;
  const GridOfSamples grid = AddGrid(source.num_columns(), band.end_read - band.first_read,
                                     block.points, block.normals, source.station(), &input);
  FreeVectors(&block.points, &block.normals);
  std::vector<PhotoView> band_photos;
  std::vector<Eigen::Vector3f> band_gains;
  std::vector<int> numbers(photos.size(), -1);  // in the band
  for (int i : PhotosThatMaySee(photos, input.samples)) {
    numbers[i] = static_cast<int>(band_photos.size());
    band_photos.push_back(photos[i]);
    band_gains.push_back(gains[i]);
  }
  ObservationStore store(NumSlots(input), options.blend.max_views);
  input.occluders.swap(scene->occluders);
  ObservePhotos(input, band_photos, options.occlusion, options.blend, num_threads, progress,
                &store);
  for (size_t i = band_photos.size(); i < photos.size(); ++i) progress->Tick();
  input.occluders.swap(scene->occluders);
  GridColorizer colorizer(input, store, band_gains, options.blend, options.detail, num_threads);
  colorizer.SetChoice(options.choice, std::move(numbers));
  return colorizer.Colorize(grid, block.links, block.unseen);
}

// In samples: what the options say; in texels: what the filters of the image need.
TexelPassOptions InTexels(TexelPassOptions options, double texels_per_sample) {
  options.detail.sigma *= texels_per_sample;
  options.detail.border =
      static_cast<int>(std::ceil(options.detail.border * texels_per_sample - 1e-9));
  options.blend.footprint /= texels_per_sample;
  return options;
}

}  // namespace

double BytesPerTexel(const BlendOptions& blend) {
  // The block's and the tiles' places and normals, what one photo sees, blend and detail, beside
  // the observations.
  return 110 + 8.0 * blend.max_views + (blend.mode == "average" ? 0 : 4);
}

int NumBands(const TexelSource& source, const TexelPassOptions& options) {
  const TexelPassOptions in_texels = InTexels(options, source.texels_per_sample());
  return static_cast<int>(SplitIntoBands(source, in_texels).size());
}

ColorGrid ColorizeTexels(const TexelSource& source, const std::vector<PhotoView>& photos,
                         const std::vector<Eigen::Vector3f>& gains, const TexelPassOptions& options,
                         int num_threads, PhotoPassInput* scene, Progress* progress) {
  const TexelPassOptions in_texels = InTexels(options, source.texels_per_sample());
  ColorGrid result;
  result.num_columns = source.num_columns();
  result.num_rows = source.num_rows();
  const std::vector<Band> bands = SplitIntoBands(source, in_texels);
  if (bands.size() > 1) {
    const size_t count = static_cast<size_t>(source.num_columns()) * source.num_rows();
    result.rgb.reserve(count);
    result.views.reserve(count);
  }
  for (const Band& band : bands) {
    ColorGrid colors =
        ColorizeBand(source, band, photos, gains, in_texels, num_threads, scene, progress);
    if (bands.size() == 1) return colors;
    const size_t columns = source.num_columns();
    const size_t skip = (band.first - band.first_read) * columns;
    const size_t count = (band.end - band.first) * columns;
    result.rgb.insert(result.rgb.end(), colors.rgb.begin() + skip,
                      colors.rgb.begin() + skip + count);
    result.views.insert(result.views.end(), colors.views.begin() + skip,
                        colors.views.begin() + skip + count);
  }
  return result;
}

}  // namespace roomtex
