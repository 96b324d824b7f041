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

namespace {

// From observations to colours, grid by grid.
class GridColorizer {
 public:
  GridColorizer(const PhotoPassInput& input, const ObservationStore& store,
                const std::vector<Eigen::Vector3f>& gains, const ColorizeOptions& options,
                int num_threads)
      : input_(input), store_(store), gains_(gains), options_(options), num_threads_(num_threads) {}

  // unseen_grey: per grid cell; empty = black.
  ColorGrid Colorize(const GridOfSamples& grid, bool organised, const GridLinks& links, int scale,
                     const std::vector<uint8_t>& unseen_grey) const {
    BlendedGrid blended =
        BlendGrid(grid, input_, store_, gains_, options_.blend.outlier, num_threads_);
    if (options_.blend.detail && organised) {
      Scan shape;
      shape.num_columns = grid.num_columns;
      shape.num_rows = grid.num_rows;
      DetailOptions detail = options_.detail;  // in samples
      detail.sigma *= scale;
      detail.border *= scale;
      PreserveDetail(shape, links, blended.dominant, detail, num_threads_, &blended.blend);
    }
    return EncodeGrid(grid, input_, store_, blended, unseen_grey);
  }

 private:
  const PhotoPassInput& input_;
  const ObservationStore& store_;
  const std::vector<Eigen::Vector3f>& gains_;
  const ColorizeOptions& options_;
  int num_threads_;
};

size_t NumSlots(const PhotoPassInput& input) {
  if (input.samples.empty()) return 0;
  const SampleTile& last = input.samples.back();
  return static_cast<size_t>(last.first_slot) + last.points.size();
}

ExposureSolution UnifyExposure(const ObservationStore& store, const std::vector<PhotoView>& photos,
                               const ExposureOptions& options) {
  std::vector<ExposureData> exposures;
  for (const PhotoView& photo : photos) exposures.push_back(ReadExposureData(photo.path));
  if (options.mode == "none") return SolveExposure(exposures, {}, options);
  ExposureSolution solution =
      SolveExposure(exposures, FindOverlaps(store, static_cast<int>(photos.size())), options);
  const float scale = OutputScale(store, solution.gains);
  for (Eigen::Vector3f& gain : solution.gains) gain *= scale;
  return solution;
}

void CountVertices(const std::vector<Scan>& scans, ColorizeResult* result) {
  for (size_t s = 0; s < scans.size(); ++s) {
    result->num_vertices += scans[s].points.size() - scans[s].NumMissing();
    for (uint8_t views : result->scans[s].samples.views) {
      result->num_colored += views > 0;
      result->views_mean += views;
    }
  }
  if (result->num_colored > 0) result->views_mean /= static_cast<double>(result->num_colored);
}

}  // namespace

ColorizeResult ColorizeScans(const std::vector<Scan>& scans, const std::vector<PhotoView>& photos,
                             const ColorizeOptions& options, int num_threads, Progress* progress) {
  progress->Stage("mesh");
  std::vector<ScanSurface> surfaces;
  std::vector<GridOfSamples> sample_grids, texture_grids;
  PhotoPassInput input =
      MakeInput(scans, &surfaces, options, num_threads, &sample_grids, &texture_grids);

  progress->Stage("photos", static_cast<int>(photos.size()));
  ColorizeResult result;
  ObservationStore store(NumSlots(input), options.blend.max_views);
  result.samples_seen =
      ObservePhotos(input, photos, options.occlusion, options.blend, num_threads, progress, &store);
  input.occluders.clear();

  progress->Stage("exposure");
  result.exposure = UnifyExposure(store, photos, options.exposure);
  result.disagreement = MeasureDisagreement(store, result.exposure.gains);

  progress->Stage("blend");
  const GridColorizer colorizer(input, store, result.exposure.gains, options, num_threads);
  for (size_t s = 0; s < scans.size(); ++s) {
    std::vector<uint8_t> grey;
    if (options.unseen == "intensity") grey = IntensityAsGrey(scans[s]);
    ColoredScan colored;
    colored.samples =
        colorizer.Colorize(sample_grids[s], scans[s].organised, surfaces[s].links, 1, grey);
    if (texture_grids[s].num_columns > 0) {
      const int scale = options.texture_scale;
      if (!grey.empty()) grey = EnlargeGrey(scans[s], grey, scale);
      colored.texture = colorizer.Colorize(texture_grids[s], true,
                                           TextureLinks(scans[s], surfaces[s], scale), scale, grey);
    }
    colored.triangles = std::move(surfaces[s].triangles);
    result.scans.push_back(std::move(colored));
  }
  CountVertices(scans, &result);
  return result;
}

}  // namespace roomtex
