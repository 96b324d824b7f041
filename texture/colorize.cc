#include "texture/colorize.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <set>

#include <fmt/core.h>

#include "core/cloud_stations.h"
#include "core/cpu_stages.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/free_vectors.h"
#include "core/option_fields.h"
#include "core/parallel.h"
#include "core/photo.h"
#include "core/statistics.h"
#include "core/surfels.h"
#include "texture/debug_images.h"
#include "texture/sampling/looked_past.h"
#include "texture/sampling/photo_pass.h"
#include "texture/sampling/single_holes.h"
#include "texture/texels/texture_grid.h"
#include "texture/texels/texture_scale.h"
#include "texture/tone/contradicted_parts.h"
#include "texture/tone/unify_exposure.h"

namespace roomtex {
namespace {

// Radians between neighbouring points of a cloud as the photos have them before them: what the
// scanner's steps are to a grid, that depth maps are fine enough and their cracks are closed.
double SpacingInPhotos(const CloudSurface& cloud, const std::vector<PhotoView>& photos) {
  constexpr size_t kAsked = 1000;
  std::vector<double> angles;
  for (size_t i = 0; i < cloud.points.size(); i += cloud.points.size() / kAsked + 1) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const PhotoView& photo : photos) {
      nearest = std::min(nearest, (photo.Centre() - cloud.points[i]).norm());
    }
    if (nearest > 0 && std::isfinite(nearest)) angles.push_back(cloud.spacing / nearest);
  }
  return Median(&angles);
}

// What the scanner could not see from a station, as a grid around that shows it.
void AddShadows(const Scan& cloud, const CloudStation& station, const ColorizeOptions& options,
                int num_threads, ShadowsOfStations* shadows) {
  constexpr double kStep = 1.5;     // spacings; finer leaves cells empty
  constexpr double kFinest = 2e-3;  // radians; shadows need not be exact
  const double step = std::max(kFinest, kStep * station.angular_spacing);
  const Scan grid = GridAroundStation(cloud, station.place, station.begin, station.end,
                                      static_cast<int>(std::lround(kPi / step)) + 1);
  const SmoothedScan surface = MakeSmoothedScan(grid, options.mesh, options.surface, num_threads);
  OccluderTiles tiles = MakeOccluderTiles(grid, surface);
  shadows->Take(grid, surface.angular_spacing, surface.range_noise, &tiles);
}

// The front of a surface is where it was measured from. Returns whether all points have one.
bool TurnToStations(const std::vector<CloudStation>& stations, CloudSurface* cloud) {
  size_t num_turned = 0;
  for (const CloudStation& station : stations) {
    for (size_t i = station.begin; i < station.end; ++i) {
      const Eigen::Vector3f to_station = (station.place - cloud->points[i]).cast<float>();
      if (cloud->normals[i].dot(to_station) < 0) cloud->normals[i] *= -1;
    }
    num_turned += station.end - station.begin;
  }
  return num_turned == cloud->points.size();
}

// The samples are the points of the cloud, what hides them are its surfels.
SmoothedScan SurfaceOfCloud(const Scan& scan, const std::vector<PhotoView>& photos,
                            const ColorizeOptions& options, int num_threads,
                            OccluderTiles* occluder, ShadowsOfStations* shadows) {
  CloudSurface cloud = FindCloudSurface(scan, num_threads);
  SmoothedScan surface;
  surface.range_noise = cloud.noise;
  surface.station_is_known = cloud.angular_spacing > 0;
  surface.angular_spacing =
      surface.station_is_known ? cloud.angular_spacing : SpacingInPhotos(cloud, photos);
  surface.points = std::move(cloud.patches.points);
  surface.triangles = std::move(cloud.patches.triangles);
  *occluder = MakeOccluderTiles(cloud.patches, surface);
  FreeVectors(&cloud.spacings, &cloud.patches.intensity, &surface.points, &surface.triangles);
  const std::vector<CloudStation> stations =
      surface.station_is_known ? std::vector<CloudStation>{{scan.Station(), 0, scan.points.size(),
                                                            cloud.angular_spacing}}
                               : FindStations(scan, num_threads);
  surface.front_is_known = cloud.front_is_known || TurnToStations(stations, &cloud);
  surface.has_shadows = !stations.empty();
  for (const CloudStation& station : stations) {
    AddShadows(scan, station, options, num_threads, shadows);
  }
  surface.points = std::move(cloud.points);
  surface.normals = std::move(cloud.normals);
  surface.links = FindGridLinks(scan, {});
  return surface;
}

// Everything that photos are asked about, and what lies between.
struct Scene {
  PhotoPassInput input;
  std::vector<GridOfSamples> grids;    // one per scan
  std::vector<SmoothedScan> surfaces;  // one per scan
  std::vector<MeshAtlas> atlases;      // one per scan, most of them empty
  bool has_atlas = false;
};

// All but the atlases.
Scene MakeSamples(const std::vector<Scan>& scans, const std::vector<PhotoView>& photos,
                  const ColorizeOptions& options, int num_threads) {
  const CpuTimer timer(CpuStage::kMesh, CpuTimer::Scope::kProcess);
  Scene scene;
  PhotoPassInput& input = scene.input;
  ShadowsOfStations shadows;
  for (const Scan& scan : scans) {
    const bool is_cloud = scan.kind() == Scan::Kind::kCloud;
    SmoothedScan surface;
    input.occluders.emplace_back();
    if (is_cloud) {
      surface =
          SurfaceOfCloud(scan, photos, options, num_threads, &input.occluders.back(), &shadows);
      if (!options.surface.reduce_range_noise) surface.points = scan.points;
    } else {
      surface = MakeSmoothedScan(scan, options.mesh, options.surface, num_threads);
      input.occluders.back() = MakeOccluderTiles(scan, surface);
      if (scan.organised) {
        shadows.Take(scan, surface.angular_spacing, surface.range_noise, &input.occluders.back());
      }
    }
    const Eigen::Vector3d station =
        surface.station_is_known ? scan.Station() : Eigen::Vector3d(Scan::MissingPoint());
    scene.grids.push_back(
        AddGrid(scan.num_columns, scan.num_rows, surface.points, surface.normals, station, &input));
    for (size_t t = scene.grids.back().first_tile; t < scene.grids.back().end_tile; ++t) {
      input.samples[t].is_two_sided = is_cloud && !surface.front_is_known;
    }
    if (surface.angular_spacing > 0 &&
        (!(input.angular_spacing > 0) || surface.angular_spacing < input.angular_spacing)) {
      input.angular_spacing = surface.angular_spacing;
    }
    if (options.texture_scale == 1 || !scan.organised) {
      FreeVectors(&surface.points, &surface.normals);
    }
    scene.surfaces.push_back(std::move(surface));
  }
  if (!scans.empty()) shadows.Give(&input.occluders.back(), num_threads);
  return scene;
}

}  // namespace

void ColorizeOptions::Declare(OptionFields* fields) {
  fields->Choice("Texture.unseen", &unseen, {"intensity", "scan", "black"},
                 "Colour of samples that no photo sees: their scan intensity as grey; scan: the "
                 "colour that the scan's file has there, of a scan without colours its intensity; "
                 "or black.");
  fields
      ->Int("Texture.scale", &texture_scale,
            "Texels per sample and direction of texture.png and model.glb, 1 to " +
                std::to_string(kMaxTextureScale) +
                "; above 1 the surface between the samples is coloured, too. auto (or 0): as fine "
                "as the "
                "photos, pixels per sample rounded up, but at most " +
                std::to_string(kMaxAutoScale) + ", " +
                std::to_string(static_cast<int>(kMaxAutoTexels / 1e6)) +
                " million texels, and what --Texture.max_memory_mb lets do in " +
                std::to_string(kMaxAutoBands) +
                " passes over the photos. Larger = sharper; time and memory grow with its square. "
                "model.ply does not depend on it.")
      .ZeroIs("auto")
      .Within(0, kMaxTextureScale)
      .Says("must be 1 to " + std::to_string(kMaxTextureScale) + ", or 0 (auto)");
  fields
      ->Number("Texture.max_memory_mb", &texture_memory_mb,
               "Working memory for texture images with a scale above 1, megabytes, beside "
               "the scan and 7 bytes a texel. Less = more passes over the photos, same "
               "result.")
      .Within(64, 1e6)
      .Says("must be 64 to 1e6 megabytes");
}

std::vector<std::string> ColorizeOptions::Problems() const {
  std::vector<std::string> problems;
  AppendProblems(mesh.Problems(), &problems);
  AppendProblems(surface.Problems(), &problems);
  AppendProblems(occlusion.Problems(), &problems);
  AppendProblems(exposure.Problems(), &problems);
  AppendProblems(registration.Problems(), &problems);
  AppendProblems(blend.Problems(), &problems);
  AppendProblems(detail.Problems(), &problems);
  AppendProblems(ProblemsOf(*this), &problems);
  AppendProblems(atlas.Problems(), &problems);
  return problems;
}

namespace {

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

std::vector<float> Disagreements(const GridOfSamples& grid, const PhotoPassInput& input,
                                 const ObservationStore& store,
                                 const std::vector<Eigen::Vector3f>& gains, int num_threads) {
  std::vector<float> result(static_cast<size_t>(grid.num_columns) * grid.num_rows,
                            std::numeric_limits<float>::quiet_NaN());
  ParallelFor(
      num_threads, static_cast<int>(grid.first_tile), static_cast<int>(grid.end_tile), [&](int t) {
        const SampleTile& tile = input.samples[t];
        for (int i = 0; i < tile.points.size(); ++i) {
          const size_t slot = static_cast<size_t>(tile.first_slot) + i;
          result[tile.index[i]] = SampleDisagreement(store.Begin(slot), store.Count(slot), gains);
        }
      });
  return result;
}

// One that is everywhere the same says nothing: many meshes and clouds have none.
bool HasIntensity(const Scan& scan) {
  std::optional<float> first;
  for (size_t i = 0; i < scan.intensity.size(); ++i) {
    if (scan.IsMissing(static_cast<int>(i)) || !std::isfinite(scan.intensity[i])) continue;
    if (!first) first = scan.intensity[i];
    if (scan.intensity[i] != *first) return true;
  }
  return false;
}

std::vector<Rgb> UnseenColors(const Scan& scan, const ColorizeOptions& options) {
  std::vector<Rgb> colors;
  if (options.unseen == "black") return colors;
  if (options.unseen == "scan" && !scan.colors.empty()) return scan.colors;
  if (!HasIntensity(scan)) {
    constexpr uint8_t kMiddle = 128;  // neither black nor white
    colors.assign(scan.points.size(), {kMiddle, kMiddle, kMiddle});
    return colors;
  }
  for (const uint8_t grey : IntensityAsGrey(scan)) colors.push_back({grey, grey, grey});
  return colors;
}

// Texels of the atlas of a mesh, per pixel of all photos: more of them show nothing more, except on
// surface that no photo sees.
constexpr double kMaxTexelsPerPixel = 4;

// Atlases of the meshes without a grid, which share the texels by their areas. Probes on their
// surfaces are added to what the photos are asked about: few vertices would say little about
// exposures.
std::vector<MeshAtlas> PlanAtlases(const std::vector<Scan>& scans,
                                   const std::vector<PhotoView>& photos,
                                   const std::vector<SmoothedScan>& surfaces,
                                   const ColorizeOptions& options, PhotoPassInput* input) {
  constexpr int kNumProbes = 200000;
  double pixels = 0;
  for (const PhotoView& photo : photos) {
    const Camera& camera = photo.camera;
    pixels += static_cast<double>(camera.width) * camera.height;
  }
  const double max_texels =
      std::min({kMaxAutoTexels, kMaxTexelsPerPixel * pixels,
                kMaxAutoBands * 1e6 * options.texture_memory_mb / BytesPerTexel(options.blend)});
  const auto has_atlas = [&](size_t s) {
    return scans[s].kind() == Scan::Kind::kMesh && options.atlas.mode != "0";
  };
  std::vector<double> areas(scans.size(), 0);
  for (size_t s = 0; s < scans.size(); ++s) {
    if (has_atlas(s)) areas[s] = SurfaceArea(scans[s].points, surfaces[s].triangles);
  }
  const double all_area = std::accumulate(areas.begin(), areas.end(), 0.0);
  std::vector<MeshAtlas> atlases(scans.size());
  for (size_t s = 0; s < scans.size(); ++s) {
    if (!has_atlas(s)) continue;
    const std::vector<Triangle>& triangles = surfaces[s].triangles;
    const SurfaceProbes probes = SpreadProbes(scans[s].points, triangles, kNumProbes);
    atlases[s] = LayOutAtlas(scans[s].points, triangles, PixelOnSurface(probes, photos),
                             max_texels * areas[s] / std::max(all_area, 1e-12), options.atlas);
    if (atlases[s].empty()) continue;
    AddGrid(static_cast<int>(probes.points.size()), 1, probes.points, probes.normals,
            Scan::MissingPoint(), input);
  }
  return atlases;
}

// Texture images finer than the samples, from the exposures found on the samples.
void ColorizeTextures(const std::vector<Scan>& scans, const std::vector<PhotoView>& photos,
                      const ColorizeOptions& options, int num_threads,
                      std::vector<SmoothedScan>* surfaces, PhotoPassInput* input,
                      const PhotoChoice* choice, Progress* progress, ColorizeResult* result) {
  const TexelPassOptions texels{options.occlusion, options.blend, options.detail, choice,
                                1e6 * options.texture_memory_mb};
  // A mesh has no spacing of samples that says how fine a depth map must be.
  TexelPassOptions on_mesh = texels;
  on_mesh.occlusion.depth_map_size = std::max(texels.occlusion.depth_map_size, 2048);
  size_t num_bands = 0;
  for (size_t s = 0; s < scans.size(); ++s) {
    const ColoredScan& colored = result->scans[s];
    for (int page = 0; page < colored.atlas.num_pages; ++page) {
      num_bands += NumBands(
          AtlasTexels(scans[s].points, colored.triangles, colored.atlas, colored.samples.rgb, page),
          on_mesh);
    }
    if (!scans[s].organised || result->texture_scale == 1) continue;
    num_bands += NumBands(
        ScanTexels(scans[s], (*surfaces)[s], colored.samples, result->texture_scale), texels);
  }
  progress->Stage("texture", static_cast<int>(num_bands * photos.size()));
  for (size_t s = 0; s < scans.size(); ++s) {
    MeshAtlas& atlas = result->scans[s].atlas;
    for (int page = 0; page < atlas.num_pages; ++page) {
      const AtlasTexels source(scans[s].points, result->scans[s].triangles, atlas,
                               result->scans[s].samples.rgb, page);
      atlas.pages.push_back(ColorizeTexels(source, photos, result->exposure.gains, on_mesh,
                                           num_threads, input, progress));
      FinishPage(source, &atlas.pages.back(), &atlas.num_texels, &atlas.num_seen);
    }
    if (!scans[s].organised || result->texture_scale == 1) continue;
    SmoothedScan& surface = (*surfaces)[s];
    FillHoles(scans[s], FindSingleHoles(scans[s], surface.links), &surface);
    const ScanTexels source(scans[s], surface, result->scans[s].samples, result->texture_scale);
    result->scans[s].texture = ColorizeTexels(source, photos, result->exposure.gains, texels,
                                              num_threads, input, progress);
  }
}

// At most a fifth: if more contradict each other, it is the poses that are wrong, or the room that
// moves, and none of them is to be believed more than another.
constexpr size_t kForeignOf = 5;

// Throws UnusablePhotos. Not where a photo may look through what the scanner left open: the backs
// of things in a cloud whose scanners nobody knows.
void LeaveOutForeignPhotos(const std::vector<PhotoView>& photos,
                           const std::vector<PhotoAgreement>& agreement,
                           const std::vector<SmoothedScan>& surfaces,
                           const ColorizeOptions& options) {
  const double min_correlation = options.blend.min_agreement;
  if (min_correlation == 0) return;  // below it are photos that contradict more than chance does
  if (!std::all_of(surfaces.begin(), surfaces.end(),
                   [](const SmoothedScan& surface) { return surface.has_shadows; })) {
    return;
  }
  const std::vector<int> foreign = FindForeignPhotos(agreement, min_correlation);
  const size_t before = options.num_left_out_as_foreign, all = before + foreign.size();
  if (foreign.empty() || kForeignOf * all > before + photos.size()) return;
  std::vector<PhotoLeftOut> left_out;
  for (const int i : foreign) {
    left_out.push_back(
        {photos[i].name,
         fmt::format("It shows something else than the other photos at the same places "
                     "(correlation {:.2f}): another room that looks alike, or furniture that was "
                     "moved. Remove it, or keep it by --Blend.min_agreement 0.",
                     agreement[i].correlation)});
  }
  throw ForeignPhotos(std::move(left_out));
}

// Whether any photo has another weight now.
bool WeighBySharpness(const std::vector<PhotoSharpness>& sharpness, const BlendOptions& blend,
                      std::vector<PhotoView>* photos) {
  if (!blend.sharpness_weight) return false;
  bool any = false;
  for (size_t i = 0; i < photos->size(); ++i) {
    (*photos)[i].weight = static_cast<float>(sharpness[i].weight);
    any = any || sharpness[i].weight < 1;
  }
  return any;
}

// Whether any photo has such parts.
bool MaskMovingThings(const PhotoPassInput& input, const ObservationStore& store,
                      const std::vector<Eigen::Vector3f>& gains, const BlendOptions& blend,
                      int num_threads, std::vector<PhotoView>* photos) {
  if (!blend.leave_out_moving) return false;
  const auto masks = FindContradictedParts(input, store, gains, *photos, blend, num_threads);
  bool any = false;
  for (size_t i = 0; i < photos->size(); ++i) {
    (*photos)[i].moving = masks[i];
    any = any || masks[i] != nullptr;
  }
  return any;
}

Scene MakeScene(const std::vector<Scan>& scans, const std::vector<PhotoView>& photos,
                const ColorizeOptions& options, int num_threads) {
  Scene scene = MakeSamples(scans, photos, options, num_threads);
  scene.atlases = PlanAtlases(scans, photos, scene.surfaces, options, &scene.input);
  scene.has_atlas = std::any_of(scene.atlases.begin(), scene.atlases.end(),
                                [](const MeshAtlas& atlas) { return !atlas.empty(); });
  return scene;
}

// Whether there are samples or texels that lie beside others, as detail needs it.
bool HasNeighbors(const Scene& scene) {
  return scene.has_atlas ||
         std::any_of(scene.grids.begin(), scene.grids.end(),
                     [](const GridOfSamples& grid) { return grid.num_rows > 1; });
}

std::vector<size_t> SumsOf(const std::vector<std::vector<size_t>>& counts) {
  std::vector<size_t> sums;
  for (const std::vector<size_t>& of_photo : counts) {
    sums.push_back(std::accumulate(of_photo.begin(), of_photo.end(), size_t{0}));
  }
  return sums;
}

// From what the photos said to colours of all scans. The gains are those of result->exposure. Takes
// the scene apart.
void Blend(const std::vector<Scan>& scans, const std::vector<PhotoView>& photos,
           const ColorizeOptions& options, int num_threads, Progress* progress, Scene* scene,
           ObservationStore* store, ColorizeResult* result) {
  PhotoPassInput& input = scene->input;
  const std::vector<Eigen::Vector3f>& gains = result->exposure.gains;
  if (options.texture_scale == 1 && !scene->has_atlas && options.debug_path.empty() &&
      !options.keep_occluders) {
    input.occluders.clear();
  }
  progress->Stage("blend");
  const PhotoChoice choice =
      HasNeighbors(*scene) ? ChoosePhotos(input, *store, gains, photos, options.blend, num_threads)
                           : PhotoChoice();
  std::vector<int> numbers(photos.size());
  std::iota(numbers.begin(), numbers.end(), 0);
  for (size_t s = 0; s < scans.size(); ++s) {
    ColoredScan colored;
    GridColorizer colorizer(input, *store, gains, options.blend, options.detail, num_threads);
    colorizer.SetChoice(&choice, numbers);
    colored.samples = colorizer.Colorize(scene->grids[s], scene->surfaces[s].links,
                                         UnseenColors(scans[s], options));
    colored.disagreement = Disagreements(scene->grids[s], input, *store, gains, num_threads);
    colored.triangles = std::move(scene->surfaces[s].triangles);
    AppendTrianglesOverHoles(scans[s], FindSingleHoles(scans[s], scene->surfaces[s].links),
                             &colored.triangles);
    colored.atlas = std::move(scene->atlases[s]);
    result->scans.push_back(std::move(colored));
  }
  CountVertices(scans, result);
  if (!options.debug_path.empty()) {
    WriteDebugImages(
        options.debug_path,
        {scans, photos, input, scene->grids, *store, gains, options.occlusion, options.blend},
        num_threads, progress);
  }

  result->pixels_per_sample = MedianPixelsPerSample(input, *store, photos);
  result->texture_scale = options.texture_scale > 0
                              ? options.texture_scale
                              : ChooseTextureScale(scans, result->pixels_per_sample, options.blend,
                                                   1e6 * options.texture_memory_mb);
  if (result->texture_scale > 1 || scene->has_atlas) {
    *store = ObservationStore(0, 1);
    FreeVectors(&input.samples);
    ColorizeTextures(scans, photos, options, num_threads, &scene->surfaces, &input,
                     choice.empty() ? nullptr : &choice, progress, result);
  }
}

}  // namespace

ColorizeResult ColorizeScans(const std::vector<Scan>& scans,
                             const std::vector<PhotoView>& given_photos,
                             const ColorizeOptions& options, int num_threads, Progress* progress) {
  ColorizeResult result;
  result.photos = given_photos;  // their tones are found here
  std::vector<PhotoView>& photos = result.photos;
  SetResponse(options.exposure, &photos);
  progress->Stage("mesh");
  Scene scene = MakeScene(scans, photos, options, num_threads);
  PhotoPassInput& input = scene.input;

  progress->Stage("photos", static_cast<int>(photos.size()));
  ObservationStore store(NumSlots(input), options.blend.max_views);
  const auto observe = [&](std::vector<std::vector<SharpnessProbe>>* probes) {
    result.seen_of = ObservePhotos(input, photos, options.occlusion, options.blend, num_threads,
                                   progress, &store, probes);
    result.samples_seen = SumsOf(result.seen_of);
  };
  {
    std::vector<std::vector<SharpnessProbe>> probes;
    observe(&probes);
    result.sharpness = CompareSharpness(probes);
  }

  progress->Stage("exposure");
  // Vignetting is taken out of the store, too, where it is found.
  const std::vector<Eigen::Vector3f> no_gains(photos.size(), Eigen::Vector3f::Ones());
  const double before = MeasureDisagreement(store, no_gains).before;
  result.exposure = UnifyExposure(input.samples, options.exposure, num_threads, &photos, &store);
  result.comparison = ComparePhotos(store, result.exposure.gains);
  result.agreement = result.comparison.Agreement();
  LeaveOutForeignPhotos(photos, result.agreement, scene.surfaces, options);
  result.disagreement = MeasureDisagreement(store, result.exposure.gains);
  result.disagreement.before = before;

  const bool masked =
      MaskMovingThings(input, store, result.exposure.gains, options.blend, num_threads, &photos);
  const bool reweighted = WeighBySharpness(result.sharpness, options.blend, &photos);
  bool corrected = false;
  if (options.registration.mode != "none") {
    progress->Stage("registration");
    std::vector<std::vector<uint8_t>> intensities;
    for (const Scan& scan : scans) intensities.push_back(IntensityAsGrey(scan));
    result.registration =
        RegisterPhotos(input, scene.grids, intensities, store, result.exposure.gains,
                       options.registration, num_threads, &photos);
    const std::vector<PhotoRegistration>& found = result.registration.photos;
    corrected = std::any_of(found.begin(), found.end(),
                            [](const PhotoRegistration& photo) { return photo.corrected; });
  }
  if (corrected || reweighted || masked) {
    progress->Stage("photos", static_cast<int>(photos.size()));
    store = ObservationStore(0, 1);  // before the next one takes its room
    store = ObservationStore(NumSlots(input), options.blend.max_views);
    observe(nullptr);
    result.disagreement.after = MeasureDisagreement(store, result.exposure.gains).after;
  }
  Blend(scans, photos, options, num_threads, progress, &scene, &store, &result);
  if (options.keep_occluders) result.occluders = std::move(input.occluders);
  return result;
}

ColorizeResult ColorizeStation(const std::vector<Scan>& station, size_t index,
                               const ColorizeOptions& options, int num_threads, Progress* progress,
                               ColorizeResult* coarse) {
  ColorizeResult result;
  std::vector<PhotoView>& photos = result.photos;
  for (size_t i = 0; i < coarse->photos.size(); ++i) {
    if (coarse->seen_of[i][index] == 0) continue;
    photos.push_back(coarse->photos[i]);
    result.exposure.gains.push_back(coarse->exposure.gains[i]);
  }
  progress->Stage("mesh");
  Scene scene = MakeScene(station, photos, options, num_threads);
  for (OccluderTiles& tiles : coarse->occluders) tiles.set_back = kCoarseTolerance;
  std::swap(scene.input.occluders[0], coarse->occluders[index]);
  scene.input.occluders.swap(coarse->occluders);

  progress->Stage("photos", static_cast<int>(photos.size()));
  ObservationStore store(NumSlots(scene.input), options.blend.max_views);
  result.seen_of = ObservePhotos(scene.input, photos, options.occlusion, options.blend, num_threads,
                                 progress, &store);
  result.samples_seen = SumsOf(result.seen_of);
  Blend(station, photos, options, num_threads, progress, &scene, &store, &result);

  scene.input.occluders.swap(coarse->occluders);
  std::swap(scene.input.occluders[0], coarse->occluders[index]);
  return result;
}

ColorizeResult ColorizeUsable(const std::vector<Scan>& scans, ColorizeOptions options, bool strict,
                              int num_threads, Progress* progress, PhotoList* list) {
  while (true) {
    try {
      return ColorizeScans(scans, list->photos, options, num_threads, progress);
    } catch (const UnusablePhotos& unusable) {
      if (strict) throw;
      std::set<std::string> names;
      for (const PhotoLeftOut& photo : unusable.photos()) names.insert(photo.name);
      const auto is_unusable = [&](const PhotoView& view) { return names.count(view.name) > 0; };
      std::vector<PhotoView>& photos = list->photos;
      photos.erase(std::remove_if(photos.begin(), photos.end(), is_unusable), photos.end());
      if (photos.empty()) throw;
      if (dynamic_cast<const ForeignPhotos*>(&unusable) != nullptr) {
        options.num_left_out_as_foreign += unusable.photos().size();
      }
      list->left_out.insert(list->left_out.end(), unusable.photos().begin(),
                            unusable.photos().end());
    }
  }
}

}  // namespace roomtex
