#include "align/surface/scan_planes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>
#include <optional>

#include <Eigen/Geometry>

#include "align/surface/plane_regions.h"
#include "align/surface/scan_surface.h"
#include "core/frames.h"
#include "core/option_fields.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr double kFragmentShare = 0.1;  // of min_area_m2: what may still join a plane
constexpr double kWaveArea = 0.04;      // m2; samples nearer to each other share the waves
// Of samples beside an edge or another plane: they may be mixed.
constexpr double kEdgeWeight = 0.05;
constexpr double kLeastCell = 0.02, kMostCells = 4000;  // metres; along a plane
constexpr int kNumChunks = 64;  // sums are made per chunk, whatever the number of threads

// A scan with the plane (index into the planes being built, -1 = none) of every sample.
struct LabelledScan {
  std::unique_ptr<ScanSurface> surface;
  std::vector<int> labels;
  std::vector<uint8_t> is_amid;  // nothing else is near: no edge, no other plane
};

// How deep a cell lies in its region: 2 = all cells around belong to it, 1 = none of them belongs
// to another one.
std::vector<uint8_t> FindDepths(const ScanSurface& surface,
                                const std::vector<int>& region_of_cell) {
  std::vector<uint8_t> depths(region_of_cell.size(), 0);
  for (size_t i = 0; i < depths.size(); ++i) {
    const int own = region_of_cell[i];
    if (own < 0) continue;
    depths[i] = 2;
    surface.ForNeighbours(static_cast<int>(i), [&](int other) {
      const int region = region_of_cell[other];
      if (region >= 0 && region != own) depths[i] = 0;
      if (region < 0 && surface.cells()[other].count > 0)
        depths[i] = std::min<uint8_t>(depths[i], 1);
    });
  }
  return depths;
}

// The region of each sample: that of its cell; near the rim of a region the one whose local plane
// suits it best.
void LabelSamples(const std::vector<int>& region_of_cell, double max_noise, int num_threads,
                  LabelledScan* scan) {
  const ScanSurface& surface = *scan->surface;
  const std::vector<SurfaceCell>& cells = surface.cells();
  const std::vector<uint8_t> depths = FindDepths(surface, region_of_cell);
  const int num_samples = surface.NumSamples();
  scan->labels.assign(num_samples, -1);
  scan->is_amid.assign(num_samples, 0);
  ParallelFor(num_threads, 0, kNumChunks, [&](int chunk) {
    const auto begin = static_cast<int64_t>(num_samples) * chunk / kNumChunks;
    const auto end = static_cast<int64_t>(num_samples) * (chunk + 1) / kNumChunks;
    for (int i = static_cast<int>(begin); i < end; ++i) {
      if (surface.IsMissing(i)) continue;
      const Eigen::Vector3d x = surface.Point(i);
      const int own = surface.CellOf(i);
      double best = max_noise;
      const auto consider = [&](int cell) {
        if (region_of_cell[cell] < 0) return;
        const SurfaceCell& c = cells[cell];
        const double deviations =
            std::abs(c.normal.cast<double>().dot(x - c.point)) / std::max(c.noise, 1e-6f);
        if (!(deviations < best)) return;
        best = deviations;
        scan->labels[i] = region_of_cell[cell];
      };
      consider(own);
      if (depths[own] == 0) surface.ForNeighbours(own, consider);
      scan->is_amid[i] = depths[own] == 2;
    }
  });
}

struct Histogram {
  std::array<int, 256> counts{};
  void Add(double bin) { ++counts[static_cast<size_t>(std::clamp(bin, 0.0, 255.0))]; }
  double Quantile(double share) const {
    const double total = std::accumulate(counts.begin(), counts.end(), 0.0);
    double sum = 0;
    for (size_t i = 0; i < counts.size(); ++i) {
      if (sum + counts[i] >= share * total && counts[i] > 0) {
        return static_cast<double>(i) + (share * total - sum) / counts[i];
      }
      sum += counts[i];
    }
    return 255;
  }
};
constexpr double kBinsPerDeviation = 16, kBinsPerOctave = 12, kLeastSpacing = 1e-4;

// A plane while it is fitted to its samples. Coordinates relative to the origin.
struct PlaneInWork {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero(), normal = mean, u = mean, v = mean;
  double waviness = 0;
  double deviations = 1;  // standard deviation of its samples' distances over their noise
  Moments moments;
  Histogram distances, spacings;
  double square = 0;  // of the distances
  int count = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Array2d low = Eigen::Array2d::Constant(1e300), high = Eigen::Array2d::Constant(-1e300);

  void Add(const PlaneInWork& other) {
    moments.sums += other.moments.sums;
    for (size_t i = 0; i < distances.counts.size(); ++i) {
      distances.counts[i] += other.distances.counts[i];
      spacings.counts[i] += other.spacings.counts[i];
    }
    square += other.square;
    count += other.count;
    sum += other.sum;
    low = low.min(other.low);
    high = high.max(other.high);
  }
  double Distance(const Eigen::Vector3d& x) const { return normal.dot(x - mean); }
};

// Fits the planes to the labelled samples and finds what these cover.
class PlaneFitter {
 public:
  PlaneFitter(const std::vector<LabelledScan>& scans, const std::vector<PlaneRegion>& regions,
              const Eigen::Vector3d& origin, const ScanPlaneOptions& options, int num_threads)
      : scans_(scans), origin_(origin), options_(options), num_threads_(num_threads) {
    for (const PlaneRegion& region : regions) {
      PlaneInWork plane;
      plane.mean = region.mean;
      plane.normal = region.normal;
      plane.waviness = region.waviness;
      planes_.push_back(plane);
    }
  }

  std::vector<ScanPlane> Fit() {
    MeasureDeviations();
    for (int round = 0; round < 2; ++round) {
      Refit();
      MeasureDeviations();
    }
    SetAxes();
    return Bound();
  }

 private:
  // For every sample on a plane: visit(scan, sample, x, plane as it is, sums to add to).
  template <typename Visit>
  void Sum(const Visit& visit) {
    for (const LabelledScan& one : scans_) {
      const int num_samples = one.surface->NumSamples();
      // Of the planes of this scan alone: of many rooms a scan shows few.
      std::vector<int> place(planes_.size(), -1), present;
      for (const int label : one.labels) {
        if (label < 0 || place[label] >= 0) continue;
        place[label] = static_cast<int>(present.size());
        present.push_back(label);
      }
      std::vector<std::vector<PlaneInWork>> sums(kNumChunks);
      ParallelFor(num_threads_, 0, kNumChunks, [&](int chunk) {
        sums[chunk].resize(present.size());
        const auto begin = static_cast<int64_t>(num_samples) * chunk / kNumChunks;
        const auto end = static_cast<int64_t>(num_samples) * (chunk + 1) / kNumChunks;
        for (int i = static_cast<int>(begin); i < end; ++i) {
          const int label = one.labels[i];
          if (label < 0) continue;
          visit(one, i, one.surface->Point(i), planes_[label], &sums[chunk][place[label]]);
        }
      });
      for (const std::vector<PlaneInWork>& chunk : sums) {
        for (size_t k = 0; k < chunk.size(); ++k) planes_[present[k]].Add(chunk[k]);
      }
    }
  }

  // Distances over the noise that is expected there: their median gives the deviation.
  void MeasureDeviations() {
    for (PlaneInWork& plane : planes_) plane.distances = {};
    Sum([](const LabelledScan& one, int, const Eigen::Vector3d& x, const PlaneInWork& plane,
           PlaneInWork* sum) {
      const double deviations =
          std::abs(plane.Distance(x)) / one.surface->NoiseAcross(x, plane.normal);
      sum->distances.Add(kBinsPerDeviation * deviations);
    });
    for (PlaneInWork& plane : planes_) {
      plane.deviations =
          std::max(0.3, plane.distances.Quantile(0.5) / kBinsPerDeviation / kMadPerSigma);
    }
  }

  bool IsOutlier(const LabelledScan& one, const Eigen::Vector3d& x,
                 const PlaneInWork& plane) const {
    return std::abs(plane.Distance(x)) >
           options_.max_noise * plane.deviations * one.surface->NoiseAcross(x, plane.normal);
  }

  void Refit() {
    for (PlaneInWork& plane : planes_) plane.moments = Moments();
    Sum([this](const LabelledScan& one, int i, const Eigen::Vector3d& x, const PlaneInWork& plane,
               PlaneInWork* sum) {
      if (IsOutlier(one, x, plane)) return;
      const ScanSurface& surface = *one.surface;
      const double noise = surface.NoiseAcross(x, plane.normal);
      // Waves are the same for all samples of one place: there many count little more than few.
      const double footprint = surface.Footprint(i, x, plane.normal);
      const double share = footprint > 0 ? std::max(1.0, kWaveArea / footprint) : 1;
      double weight = 1 / (noise * noise + plane.waviness * plane.waviness * share);
      if (!one.is_amid[i]) weight *= kEdgeWeight;
      sum->moments.Add(x, weight);
    });
    for (PlaneInWork& plane : planes_) {
      if (!(plane.moments.weight() > 0)) continue;
      const PlaneFit fit = FitPlane(plane.moments);
      if (!fit.normal.allFinite()) continue;
      plane.normal = fit.normal.dot(plane.normal) < 0 ? Eigen::Vector3d(-fit.normal) : fit.normal;
      plane.mean = fit.mean;
    }
  }

  // u is level where the plane is not.
  void SetAxes() {
    const Eigen::Vector3d up = scans_[0].surface->scan().up;
    for (PlaneInWork& plane : planes_) {
      Eigen::Vector3d level = up.cross(plane.normal);
      if (level.norm() < 0.02) level = plane.normal.unitOrthogonal();
      plane.u = level.normalized();
      plane.v = plane.normal.cross(plane.u);
    }
  }

  std::vector<ScanPlane> Bound() {
    Sum([this](const LabelledScan& one, int i, const Eigen::Vector3d& x, const PlaneInWork& plane,
               PlaneInWork* sum) {
      if (IsOutlier(one, x, plane)) return;
      const double distance = plane.Distance(x);
      sum->square += distance * distance;
      sum->sum += x;
      ++sum->count;
      const Eigen::Vector3d offset = x - plane.mean;
      const Eigen::Array2d place(plane.u.dot(offset), plane.v.dot(offset));
      sum->low = sum->low.min(place);
      sum->high = sum->high.max(place);
      const double spacing = one.surface->Spacing(i, x, plane.normal);
      sum->spacings.Add(kBinsPerOctave * std::log2(spacing / kLeastSpacing));
    });
    std::vector<ScanPlane> result;
    for (PlaneInWork& plane : planes_) result.push_back(Place(plane));
    std::vector<std::vector<Eigen::ArrayXXf>> areas;
    for (const LabelledScan& one : scans_) areas.push_back(Cover(one, &result));
    for (size_t k = 0; k < result.size(); ++k) {
      ScanPlane& plane = result[k];
      plane.area_m2 = TotalArea(areas, k, plane.cell_size);
      // Points without triangles do not say how much surface they stand for.
      if (plane.area_m2 == 0) {
        plane.area_m2 = plane.covered.cast<double>().sum() * plane.cell_size * plane.cell_size;
      }
    }
    return result;
  }

  ScanPlane Place(const PlaneInWork& plane) const {
    ScanPlane result;
    if (plane.count == 0) return result;
    const Eigen::Vector3d gravity = plane.sum / plane.count;
    const Eigen::Vector3d foot = gravity - plane.Distance(gravity) * plane.normal;
    result.point = foot + origin_;
    result.normal = plane.normal;
    result.u = plane.u;
    result.v = plane.v;
    result.rms = std::sqrt(plane.square / plane.count);
    result.num_samples = plane.count;
    // Cells so large that sparse samples leave no holes.
    const double spacing =
        kLeastSpacing * std::exp2(plane.spacings.Quantile(0.95) / kBinsPerOctave);
    const double longest = (plane.high - plane.low).maxCoeff();
    result.cell_size = std::max({kLeastCell, 1.25 * spacing, longest / kMostCells});
    const Eigen::Array2d shift(plane.u.dot(foot - plane.mean), plane.v.dot(foot - plane.mean));
    result.min_cell = ((plane.low - shift) / result.cell_size).floor().cast<int>().matrix();
    const Eigen::Array2i last = ((plane.high - shift) / result.cell_size).floor().cast<int>();
    result.covered.setZero(last[0] - result.min_cell[0] + 1, last[1] - result.min_cell[1] + 1);
    return result;
  }

  // A sample that is missing, or an outlier, amid those of a plane: no hole.
  struct Gap {
    int label;
    Eigen::Vector3d x;
  };
  static std::optional<Gap> FindGap(const LabelledScan& one, int sample) {
    Gap gap{-1, Eigen::Vector3d::Zero()};
    int count = 0, others = 0;
    one.surface->ForAround(sample, [&](int other) {
      const int label = one.labels[other];
      if (label < 0) return;
      if (gap.label < 0) gap.label = label;
      if (label != gap.label) {
        ++others;
        return;
      }
      gap.x += one.surface->Point(other);
      ++count;
    });
    if (count < 4 || others > 0) return std::nullopt;
    gap.x /= count;
    return gap;
  }

  // What the samples of one scan cover: marks the cells, gives the area in each, per plane; empty
  // for a plane of which the scan shows nothing.
  std::vector<Eigen::ArrayXXf> Cover(const LabelledScan& one, std::vector<ScanPlane>* planes) {
    std::vector<Eigen::ArrayXXf> areas(planes->size());
    const auto cover = [&](int i, int label, const Eigen::Vector3d& x) {
      ScanPlane& plane = (*planes)[label];
      const Eigen::Vector3d offset = x + (origin_ - plane.point);
      const Eigen::Array2d place(plane.u.dot(offset), plane.v.dot(offset));
      const Eigen::Array2i last(plane.covered.rows() - 1, plane.covered.cols() - 1);
      const Eigen::Array2i cell =
          ((place / plane.cell_size).floor().cast<int>() - plane.min_cell.array()).max(0).min(last);
      plane.covered(cell[0], cell[1]) = 1;
      const Eigen::Vector3d foot = x - planes_[label].Distance(x) * plane.normal;
      if (areas[label].size() == 0) areas[label].setZero(last[0] + 1, last[1] + 1);
      areas[label](cell[0], cell[1]) +=
          static_cast<float>(one.surface->Footprint(i, foot, plane.normal));
    };
    for (int i = 0; i < one.surface->NumSamples(); ++i) {
      const int label = one.labels[i];
      if (label >= 0) {
        const Eigen::Vector3d x = one.surface->Point(i);
        if (!IsOutlier(one, x, planes_[label])) cover(i, label, x);
      } else if (const auto gap = FindGap(one, i)) {
        cover(i, gap->label, gap->x);
      }
    }
    return areas;
  }

  // What several scans see counts once: in every cell that of the scan which covers its
  // surroundings best.
  static double TotalArea(const std::vector<std::vector<Eigen::ArrayXXf>>& areas, size_t plane,
                          double cell_size) {
    if (areas.size() == 1) return areas[0][plane].cast<double>().sum();
    std::vector<const Eigen::ArrayXXf*> seen;
    for (const auto& of_scan : areas) {
      if (of_scan[plane].size() > 0) seen.push_back(&of_scan[plane]);
    }
    if (seen.empty()) return 0;
    const Eigen::Index rows = seen[0]->rows(), columns = seen[0]->cols();
    const auto full = static_cast<float>(0.8 * 9 * cell_size * cell_size);
    double total = 0;
    for (Eigen::Index i = 0; i < rows; ++i) {
      for (Eigen::Index k = 0; k < columns; ++k) {
        const Eigen::Index top = std::max<Eigen::Index>(i - 1, 0);
        const Eigen::Index left = std::max<Eigen::Index>(k - 1, 0);
        float best = 0, area = 0;
        for (const Eigen::ArrayXXf* of_scan : seen) {
          const float around =
              of_scan
                  ->block(top, left, std::min(i + 2, rows) - top, std::min(k + 2, columns) - left)
                  .sum();
          if (std::min(around, full) <= best) continue;
          best = std::min(around, full);
          area = (*of_scan)(i, k);
        }
        total += area;
      }
    }
    return total;
  }

  const std::vector<LabelledScan>& scans_;
  const Eigen::Vector3d origin_;
  const ScanPlaneOptions& options_;
  const int num_threads_;
  std::vector<PlaneInWork> planes_;
};

bool Precedes(const ScanPlane& a, const ScanPlane& b) {
  if (a.area_m2 != b.area_m2) return a.area_m2 > b.area_m2;
  return std::lexicographical_compare(a.point.data(), a.point.data() + 3, b.point.data(),
                                      b.point.data() + 3);
}

}  // namespace

bool ScanPlane::Covers(const Eigen::Vector3d& x_in_scan) const {
  if (!(cell_size > 0)) return false;
  const Eigen::Vector3d offset = x_in_scan - point;
  const double row = std::floor(u.dot(offset) / cell_size) - min_cell[0];
  const double column = std::floor(v.dot(offset) / cell_size) - min_cell[1];
  const auto rows = static_cast<double>(covered.rows());
  const auto columns = static_cast<double>(covered.cols());
  if (!(row >= -1 && row <= rows && column >= -1 && column <= columns)) return false;
  for (double i = std::max(row - 1, 0.0); i <= std::min(row + 1, rows - 1); ++i) {
    for (double k = std::max(column - 1, 0.0); k <= std::min(column + 1, columns - 1); ++k) {
      if (covered(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) != 0) return true;
    }
  }
  return false;
}

void ScanPlaneOptions::Declare(OptionFields* fields) {
  fields
      ->Number("Plane.min_area_m2", &min_area_m2,
               "Square metres; smaller planes of the scan are left out.")
      .Positive();
  fields
      ->Number("Plane.max_distance", &max_distance,
               "Metres; how far a surface, its noise averaged out, may lie from its plane "
               "(wavy walls, bent scans); larger = more tolerant.")
      .Positive();
  fields
      ->Number("Plane.max_angle_deg", &max_angle_deg,
               "Degrees between a surface's local normal and its plane's; a surface whose ends "
               "turn by 0.6 of this is no plane; larger = more tolerant.")
      .Above(0)
      .AtMost(30);
  fields
      ->Number("Plane.min_step", &min_step,
               "Metres; parallel surfaces nearer to each other than this are one plane; "
               "larger = fewer planes.")
      .NotNegative();
  fields
      ->Number("Plane.max_noise", &max_noise,
               "Standard deviations of the scan's own noise up to which a sample belongs to "
               "a plane; larger = more samples.")
      .AtLeast(1);
  fields
      ->Number("Plane.min_window", &min_window,
               "Metres; smallest window for a local normal (it grows with the noise).")
      .Positive();
  fields
      ->Number("Plane.max_incidence_deg", &max_incidence_deg,
               "Degrees from the surface's normal; surfaces that the scanner saw at a "
               "flatter angle are left out; 90 = none.")
      .Above(0)
      .AtMost(90);
}

std::vector<std::string> ScanPlaneOptions::Problems() const { return ProblemsOf(*this); }

std::vector<ScanPlane> FindScanPlanes(const std::vector<Scan>& scans,
                                      const ScanPlaneOptions& options, int num_threads) {
  if (scans.empty()) return {};
  const Bounds bounds = FindBounds(scans[0]);
  const bool has_samples = bounds.min.x() <= bounds.max.x();
  const Eigen::Vector3d origin =
      has_samples ? Eigen::Vector3d((bounds.min + bounds.max) / 2) : scans[0].Station();
  std::vector<LabelledScan> labelled;
  std::vector<PlaneRegion> regions;
  std::vector<RegionStep> steps;
  for (const Scan& scan : scans) {
    LabelledScan one;
    one.surface = std::make_unique<ScanSurface>(scan, origin, options, num_threads);
    GrownRegions grown = GrowRegions(*one.surface, options, kFragmentShare * options.min_area_m2);
    const int first = static_cast<int>(regions.size());
    for (PlaneRegion& region : grown.regions) {
      region.scan = static_cast<int>(labelled.size());
      regions.push_back(std::move(region));
    }
    for (RegionStep& step : grown.steps) {
      steps.push_back({step.a + first, step.b + first, step.height, step.sigma});
    }
    LabelSamples(grown.region_of_cell, options.max_noise, num_threads, &one);
    for (int& label : one.labels) label = label < 0 ? -1 : label + first;
    one.surface->ForgetCells();
    labelled.push_back(std::move(one));
  }
  JoinedRegions joined = JoinRegions(std::move(regions), steps, options);
  // The footprints give the area more exactly later: keep what is nearly large enough.
  while (!joined.regions.empty() && joined.regions.back().area < 0.7 * options.min_area_m2) {
    joined.regions.pop_back();
  }
  const int num_planes = static_cast<int>(joined.regions.size());
  for (LabelledScan& one : labelled) {
    for (int& label : one.labels) {
      if (label >= 0) label = joined.joined_of_region[label];
      if (label >= num_planes) label = -1;
    }
  }
  PlaneFitter fitter(labelled, joined.regions, origin, options, num_threads);
  std::vector<ScanPlane> planes;
  for (ScanPlane& plane : fitter.Fit()) {
    if (plane.area_m2 >= options.min_area_m2) planes.push_back(std::move(plane));
  }
  std::sort(planes.begin(), planes.end(), Precedes);
  return planes;
}

}  // namespace roomtex
