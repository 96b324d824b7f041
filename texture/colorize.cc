#include "texture/colorize.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "core/photo.h"
#include "texture/photo_pass.h"
#include "texture/texture_grid.h"

namespace roomtex {
namespace {

// The samples of one grid, and where they stand among all.
struct GridOfSamples {
  size_t first_tile = 0, end_tile = 0;
  int num_columns = 0, num_rows = 0;
};

void AddGrid(int columns, int rows, const std::vector<Eigen::Vector3d>& points,
             const std::vector<Eigen::Vector3f>& normals, const Eigen::Vector3d& station,
             PhotoPassInput* input, std::vector<GridOfSamples>* grids) {
  const int first_slot = input->samples.empty() ? 0
                                                : input->samples.back().first_slot +
                                                      input->samples.back().points.size();
  GridOfSamples grid{input->samples.size(), 0, columns, rows};
  for (SampleTile& tile : MakeSampleTiles(columns, rows, points, normals, station)) {
    tile.first_slot += first_slot;
    input->samples.push_back(std::move(tile));
  }
  grid.end_tile = input->samples.size();
  grids->push_back(grid);
}

// Blend of a grid's samples, scattered from slots to grid cells.
struct BlendedGrid {
  std::vector<Eigen::Vector3f> blend;
  DominantMap dominant;
};

BlendedGrid BlendGrid(const GridOfSamples& grid, const PhotoPassInput& input,
                      const ObservationStore& store, const std::vector<Eigen::Vector3f>& gains,
                      double outlier, int num_threads) {
  const size_t count = static_cast<size_t>(grid.num_columns) * grid.num_rows;
  BlendedGrid result;
  result.blend.assign(count, Eigen::Vector3f::Zero());
  result.dominant.color.assign(count, Eigen::Vector3f::Zero());
  result.dominant.photo.assign(count, -1);
  result.dominant.fits.assign(count, 0);
  const int first = static_cast<int>(grid.first_tile), end = static_cast<int>(grid.end_tile);
  ParallelFor(num_threads, first, end, [&](int t) {
    const SampleTile& tile = input.samples[t];
    for (int i = 0; i < tile.points.size(); ++i) {
      const size_t slot = static_cast<size_t>(tile.first_slot) + i;
      const BlendedSample sample =
          BlendSample(store.Begin(slot), store.Count(slot), gains, outlier);
      result.blend[tile.index[i]] = sample.blend;
      result.dominant.color[tile.index[i]] = sample.dominant;
      result.dominant.photo[tile.index[i]] = static_cast<int16_t>(sample.dominant_photo);
      result.dominant.fits[tile.index[i]] = sample.dominant_fits;
    }
  });
  return result;
}

ColorGrid EncodeGrid(const GridOfSamples& grid, const PhotoPassInput& input,
                     const ObservationStore& store, const BlendedGrid& blended,
                     const std::vector<uint8_t>& unseen_grey) {
  ColorGrid result;
  result.num_columns = grid.num_columns;
  result.num_rows = grid.num_rows;
  result.rgb.assign(blended.blend.size(), {0, 0, 0});
  result.views.assign(blended.blend.size(), 0);
  for (size_t t = grid.first_tile; t < grid.end_tile; ++t) {
    const SampleTile& tile = input.samples[t];
    for (int i = 0; i < tile.points.size(); ++i) {
      const int index = tile.index[i];
      const int views = blended.dominant.photo[index] < 0
                            ? 0
                            : store.NumViews(static_cast<size_t>(tile.first_slot) + i);
      result.views[index] = static_cast<uint8_t>(std::min(views, 255));
      if (views == 0) {
        result.rgb[index].fill(unseen_grey.empty() ? 0 : unseen_grey[index]);
        continue;
      }
      for (int k = 0; k < 3; ++k) {
        result.rgb[index][k] = SrgbByteFromLinear(blended.blend[index][k]);
      }
    }
  }
  return result;
}

PhotoPassInput MakeInput(const std::vector<Scan>& scans, std::vector<ScanSurface>* surfaces,
                         const ColorizeOptions& options, int num_threads,
                         std::vector<GridOfSamples>* sample_grids,
                         std::vector<GridOfSamples>* texture_grids) {
  PhotoPassInput input;
  for (const Scan& scan : scans) {
    ScanSurface surface = MakeScanSurface(scan, options.mesh, options.surface, num_threads);
    input.occluders.push_back(MakeOccluderTiles(scan, surface));
    const Eigen::Vector3d station =
        scan.organised ? scan.Station() : Eigen::Vector3d(Scan::MissingPoint());
    AddGrid(scan.num_columns, scan.num_rows, surface.points, surface.normals, station, &input,
            sample_grids);
    if (options.texture_scale > 1 && scan.organised) {
      const TextureGrid texture = MakeTextureGrid(scan, surface, options.texture_scale);
      AddGrid(texture.num_columns, texture.num_rows, texture.points, texture.normals, station,
              &input, texture_grids);
    } else {
      texture_grids->push_back({});
    }
    if (surface.angular_spacing > 0 &&
        (!(input.angular_spacing > 0) || surface.angular_spacing < input.angular_spacing)) {
      input.angular_spacing = surface.angular_spacing;
    }
    surface.points = {};
    surface.normals = {};
    surfaces->push_back(std::move(surface));
  }
  return input;
}

}  // namespace

void AppendProblems(const std::vector<std::string>& more, std::vector<std::string>* problems) {
  problems->insert(problems->end(), more.begin(), more.end());
}

std::vector<std::string> ColorizeOptions::Problems() const {
  std::vector<std::string> problems;
  AppendProblems(mesh.Problems(), &problems);
  AppendProblems(surface.Problems(), &problems);
  AppendProblems(occlusion.Problems(), &problems);
  AppendProblems(exposure.Problems(), &problems);
  AppendProblems(blend.Problems(), &problems);
  AppendProblems(detail.Problems(), &problems);
  if (unseen != "intensity" && unseen != "black") {
    problems.push_back("--Texture.unseen must be intensity or black");
  }
  if (texture_scale < 1 || texture_scale > 16) {
    problems.push_back("--Texture.scale must be 1 to 16");
  }
  return problems;
}

ColorizeResult ColorizeScans(const std::vector<Scan>& scans, const std::vector<PhotoView>& photos,
                             const ColorizeOptions& options, int num_threads, Progress* progress) {
  progress->Stage("mesh");
  std::vector<ScanSurface> surfaces;
  std::vector<GridOfSamples> sample_grids, texture_grids;
  PhotoPassInput input =
      MakeInput(scans, &surfaces, options, num_threads, &sample_grids, &texture_grids);
  const size_t num_slots = input.samples.empty()
                               ? 0
                               : static_cast<size_t>(input.samples.back().first_slot) +
                                     input.samples.back().points.size();

  progress->Stage("photos", static_cast<int>(photos.size()));
  ColorizeResult result;
  ObservationStore store(num_slots, options.blend.max_views);
  result.samples_seen =
      ObservePhotos(input, photos, options.occlusion, options.blend, num_threads, progress, &store);
  input.occluders.clear();

  progress->Stage("exposure");
  std::vector<ExposureData> exposures;
  for (const PhotoView& photo : photos) exposures.push_back(ReadExposureData(photo.path));
  const auto num_photos = static_cast<int>(photos.size());
  std::vector<Overlap> overlaps;
  if (options.exposure.mode != "none") overlaps = FindOverlaps(store, num_photos);
  result.exposure = SolveExposure(exposures, overlaps, options.exposure);
  if (options.exposure.mode != "none") {
    const float scale = OutputScale(store, result.exposure.gains);
    for (Eigen::Vector3f& gain : result.exposure.gains) gain *= scale;
  }
  result.disagreement = MeasureDisagreement(store, result.exposure.gains);

  progress->Stage("blend");
  for (size_t s = 0; s < scans.size(); ++s) {
    ColoredScan colored;
    const auto color_grid = [&](const GridOfSamples& grid, bool is_samples) {
      BlendedGrid blended =
          BlendGrid(grid, input, store, result.exposure.gains, options.blend.outlier, num_threads);
      Scan shape;
      shape.organised = scans[s].organised;
      shape.num_columns = grid.num_columns;
      shape.num_rows = grid.num_rows;
      if (options.blend.detail && shape.organised) {
        DetailOptions detail = options.detail;
        if (!is_samples) {
          detail.sigma *= options.texture_scale;
          detail.border *= options.texture_scale;
        }
        const GridLinks links = is_samples
                                    ? surfaces[s].links
                                    : TextureLinks(scans[s], surfaces[s], options.texture_scale);
        PreserveDetail(shape, links, blended.dominant, detail, num_threads, &blended.blend);
      }
      std::vector<uint8_t> grey;
      if (options.unseen == "intensity") {
        grey = IntensityAsGrey(scans[s]);
        if (!is_samples) grey = EnlargeGrey(scans[s], grey, options.texture_scale);
      }
      return EncodeGrid(grid, input, store, blended, grey);
    };
    colored.samples = color_grid(sample_grids[s], true);
    if (texture_grids[s].num_columns > 0) colored.texture = color_grid(texture_grids[s], false);
    colored.triangles = std::move(surfaces[s].triangles);
    for (size_t i = 0; i < scans[s].points.size(); ++i) {
      result.num_vertices += !scans[s].IsMissing(static_cast<int>(i));
    }
    for (uint8_t views : colored.samples.views) {
      result.num_colored += views > 0;
      result.views_mean += views;
    }
    result.scans.push_back(std::move(colored));
  }
  if (result.num_colored > 0) result.views_mean /= static_cast<double>(result.num_colored);
  return result;
}

}  // namespace roomtex
