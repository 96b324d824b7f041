#include "texture/texels/mesh_atlas.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "core/option_fields.h"
#include "core/statistics.h"
#include "texture/texels/grid_image.h"
#include "texture/texels/gutters.h"
#include "texture/texels/mesh_charts.h"
#include "texture/texels/rectangle_packing.h"

namespace roomtex {
namespace {

// Texels around a chart, and the grid that charts begin on: no mixing in the first three mipmaps.
constexpr int kGutter = 8;
constexpr double kMostGutters = 3;  // texels with gutters, of those allowed without
constexpr double kWorthTexels = 8;  // from vertex to vertex, in mode "auto"
// Decimation takes the vertices where the surface is flat: there they lie much farther apart.
constexpr double kWorthDecimated = 2;

int RoundUp(double length) {
  return static_cast<int>(std::ceil(length / kGutter - 1e-9)) * kGutter;
}

double TriangleArea(const std::vector<Eigen::Vector3d>& points, const Triangle& t) {
  return 0.5 * (points[t[1]] - points[t[0]]).cross(points[t[2]] - points[t[0]]).norm();
}

// A chart before it has a place: axes in its plane, along which its rectangle is smallest.
struct FlatChart {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 2, 3> axes = Eigen::Matrix<double, 2, 3>::Zero();
  Eigen::Vector2d low, high;  // metres along the axes, from the centre
};

FlatChart FlattenChart(const std::vector<Eigen::Vector3d>& points,
                       const std::vector<Triangle>& triangles, const std::vector<int>& members,
                       const Eigen::Vector3d& normal) {
  FlatChart chart;
  chart.centre = points[triangles[members[0]][0]];
  const Eigen::Vector3d u = normal.unitOrthogonal(), v = normal.cross(u);
  std::vector<cv::Point2f> flat;
  for (const int t : members) {
    for (const int corner : triangles[t]) {
      const Eigen::Vector3d p = points[corner] - chart.centre;
      flat.emplace_back(static_cast<float>(u.dot(p)), static_cast<float>(v.dot(p)));
    }
  }
  const double angle = cv::minAreaRect(flat).angle * CV_PI / 180;
  // Image rows run against v, so that the chart is seen from its front.
  chart.axes.row(0) = (std::cos(angle) * u + std::sin(angle) * v).transpose();
  chart.axes.row(1) = (std::sin(angle) * u - std::cos(angle) * v).transpose();
  chart.low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  chart.high = -chart.low;
  for (const int t : members) {
    for (const int corner : triangles[t]) {
      const Eigen::Vector2d p = chart.axes * (points[corner] - chart.centre);
      chart.low = chart.low.cwiseMin(p);
      chart.high = chart.high.cwiseMax(p);
    }
  }
  return chart;
}

// Corners of a triangle in its page, and walks over the texels whose centres lie in it.
struct FlatTriangle {
  Eigen::Vector2d corner[3];

  // Calls body(column, row, shares of the corners) for rows in [first, end); shares sum to 1.
  template <typename Body>
  void ForEachTexel(int first, int end, const Body& body) const {
    const Eigen::Vector2d ab = corner[1] - corner[0], ac = corner[2] - corner[0];
    const double area = ab.x() * ac.y() - ab.y() * ac.x();
    if (area == 0 || !std::isfinite(area)) return;
    const Eigen::Vector2d low = corner[0].cwiseMin(corner[1]).cwiseMin(corner[2]);
    const Eigen::Vector2d high = corner[0].cwiseMax(corner[1]).cwiseMax(corner[2]);
    const int row_begin = std::max(first, static_cast<int>(std::ceil(low.y() - 0.5)));
    const int row_end = std::min(end, static_cast<int>(std::floor(high.y() - 0.5)) + 1);
    const int column_begin = std::max(0, static_cast<int>(std::ceil(low.x() - 0.5)));
    const int column_last = static_cast<int>(std::floor(high.x() - 0.5));
    constexpr double kSlack = -1e-9;
    for (int row = row_begin; row < row_end; ++row) {
      const auto [from, to] = Span(row + 0.5 - corner[0].y(), ab, ac, area, 2 * kSlack);
      const int column_end = 1 + static_cast<int>(std::min<double>(column_last, to));
      for (int column = static_cast<int>(std::max<double>(column_begin, from)); column < column_end;
           ++column) {
        const Eigen::Vector2d p = Eigen::Vector2d(column + 0.5, row + 0.5) - corner[0];
        const double b = (p.x() * ac.y() - p.y() * ac.x()) / area;
        const double c = (ab.x() * p.y() - ab.y() * p.x()) / area;
        if (b < kSlack || c < kSlack || b + c > 1 - kSlack) continue;
        body(column, row, Eigen::Vector3d(1 - b - c, b, c));
      }
    }
  }

 private:
  // Columns of the row y below corner[0] that may lie in the triangle: a needle across the page
  // has few in each. Where all three shares are at least `slack`; a column more at both ends.
  std::pair<double, double> Span(double y, const Eigen::Vector2d& ab, const Eigen::Vector2d& ac,
                                 double area, double slack) const {
    const double b_0 = -y * ac.x() / area, b_x = ac.y() / area;
    const double c_0 = y * ab.x() / area, c_x = -ab.y() / area;
    double from = -1, to = 1e9;
    const auto cut = [&](double at_0, double per_column) {
      const double at = (slack - at_0) / per_column + corner[0].x();
      if (per_column > 0) from = std::max(from, at);
      if (per_column < 0) to = std::min(to, at);
    };
    cut(b_0, b_x);
    cut(c_0, c_x);
    cut(1 - b_0 - c_0, -b_x - c_x);
    return {std::min(from, 1e9) - 2, std::max(to, -2.0) + 1};
  }
};

// Triangles of a chart that lie over others of it when they are laid flat (a spiral stair): they
// leave it.
std::vector<int> FindFolds(const std::vector<Eigen::Vector3d>& points,
                           const std::vector<Triangle>& triangles, const std::vector<int>& members,
                           const FlatChart& chart, double texel_size) {
  const Eigen::Vector2d size = (chart.high - chart.low) / texel_size;
  constexpr double kLargest = 4096;  // coarser is enough to find out
  const double step = texel_size * std::max(1.0, size.maxCoeff() / kLargest);
  const int columns = static_cast<int>((chart.high - chart.low).x() / step) + 2;
  const int rows = static_cast<int>((chart.high - chart.low).y() / step) + 2;
  cv::Mat1b taken(rows, columns, uint8_t{0});
  std::vector<int> folds;
  for (const int t : members) {
    FlatTriangle flat;
    for (int k = 0; k < 3; ++k) {
      flat.corner[k] = (chart.axes * (points[triangles[t][k]] - chart.centre) - chart.low) / step;
    }
    constexpr double kInside = 0.02;  // not on the border that neighbours share
    int num_taken = 0, num = 0;
    flat.ForEachTexel(0, rows, [&](int column, int row, const Eigen::Vector3d& shares) {
      if (shares.minCoeff() < kInside) return;
      ++num;
      num_taken += taken(row, column);
    });
    if (num_taken > 0.02 * num) {
      folds.push_back(t);
      continue;
    }
    flat.ForEachTexel(0, rows, [&](int column, int row, const Eigen::Vector3d& shares) {
      if (shares.minCoeff() >= kInside) taken(row, column) = 1;
    });
  }
  return folds;
}

// Members of every chart; triangles without a chart are left out.
std::vector<std::vector<int>> ListMembers(const MeshCharts& charts) {
  std::vector<std::vector<int>> members(charts.normals.size());
  for (size_t t = 0; t < charts.chart_of.size(); ++t) {
    if (charts.chart_of[t] >= 0) members[charts.chart_of[t]].push_back(static_cast<int>(t));
  }
  return members;
}

// A chart with its gutters on a page of texels; larger texels where it would have no room.
struct ChartSize {
  double texel;
  std::array<int, 2> size;  // texels
  double area() const { return static_cast<double>(size[0]) * size[1]; }
};

ChartSize SizeOf(const FlatChart& chart, double texel, int room) {
  const Eigen::Vector2d extent = chart.high - chart.low;
  const double own = std::max(texel, extent.maxCoeff() / room);
  return {own, {RoundUp(extent.x() / own + 2 * kGutter), RoundUp(extent.y() / own + 2 * kGutter)}};
}

// Charts that do not fold: what folds is made into charts of its own. None if they take more than
// max_texels: what folds is looked for among no more than these.
std::vector<FlatChart> MakeFlatCharts(const std::vector<Eigen::Vector3d>& points,
                                      const std::vector<Triangle>& triangles, double texel,
                                      int room, double max_texels, MeshCharts* charts) {
  std::vector<std::vector<int>> members = ListMembers(*charts);
  std::vector<FlatChart> flat;
  double total = 0;
  for (size_t c = 0; c < members.size(); ++c) {
    flat.push_back(FlattenChart(points, triangles, members[c], charts->normals[c]));
    total += SizeOf(flat.back(), texel, room).area();
    if (total > max_texels) return {};
    if (members[c].size() < 3) continue;
    const std::vector<int> folds = FindFolds(points, triangles, members[c], flat.back(), texel);
    if (folds.empty()) continue;
    std::vector<int> kept;
    std::set_difference(members[c].begin(), members[c].end(), folds.begin(), folds.end(),
                        std::back_inserter(kept));
    const auto number = static_cast<int>(members.size());
    for (const int t : folds) charts->chart_of[t] = number;
    members.push_back(folds);
    charts->normals.push_back(charts->normals[c]);
    members[c] = kept;
  }
  return flat;
}

// The power of two (or the largest size allowed) that wastes least on at most four pages.
int ChoosePageSize(double num_texels, int widest, int max_size) {
  int best = max_size;
  double least = std::numeric_limits<double>::infinity();
  for (int size = 64; size <= max_size; size *= 2) {
    const double area = static_cast<double>(size) * size;
    const double pages = std::ceil(1.1 * num_texels / area);
    if (size < widest || pages > 4 || pages * area > least) continue;
    least = pages * area;
    best = size;
  }
  return best;
}

}  // namespace

void AtlasOptions::Declare(OptionFields* fields) {
  fields->Choice(
      "Texture.atlas", &mode, {"auto", "1", "0"},
      "Meshes without a grid: a texture atlas for model.glb beside the vertices' "
      "colours. auto: unless --Texture.scale is 1, where the photos show more than the "
      "vertices can hold (eight texels from one to the next, or two if the mesh has more "
      "than --Mesh.max_triangles and is also written with fewer).");
  fields
      ->Number("Texture.texel_mm", &texel_mm,
               "Millimetres a texel of that atlas; 0 = what a photo's pixel covers on the "
               "surface (median), within the bounds of --Texture.scale auto.")
      .Within(0, 10000)
      .Says("must be 0 (auto) to 10000");
}

std::vector<std::string> AtlasOptions::Problems() const { return ProblemsOf(*this); }

double PixelOnSurface(const SurfaceProbes& probes, const std::vector<PhotoView>& photos) {
  const size_t stride = std::max<size_t>(1, probes.points.size() / 10000);
  std::vector<double> finest;  // per probe
  std::vector<PhotoProjector> projectors(photos.begin(), photos.end());
  for (size_t i = 0; i < probes.points.size(); i += stride) {
    double least = std::numeric_limits<double>::infinity();
    for (const PhotoProjector& photo : projectors) {
      const Eigen::Vector3d to_camera = photo.centre() - probes.points[i];
      if (to_camera.cast<float>().dot(probes.normals[i]) <= 0) continue;
      const Eigen::Vector3d in_cam = photo.cam_from_scan() * probes.points[i];
      const double depth = photo.camera().Depth(in_cam);
      const double size = depth / photo.camera().camera().MeanFocalLength();
      if (!(depth > 0) || size >= least) continue;
      const auto position = photo.camera().ImgFromCam(in_cam);
      if (position && photo.camera().InImage(*position)) least = size;
    }
    if (std::isfinite(least)) finest.push_back(least);
  }
  return Median(&finest);
}

double SurfaceArea(const std::vector<Eigen::Vector3d>& points,
                   const std::vector<Triangle>& triangles) {
  double area = 0;
  for (const Triangle& t : triangles) area += TriangleArea(points, t);
  return area;
}

MeshAtlas LayOutAtlas(const std::vector<Eigen::Vector3d>& points,
                      const std::vector<Triangle>& triangles, double pixel_on_surface,
                      double max_texels, const AtlasOptions& options) {
  MeshAtlas atlas;
  if (options.mode == "0") return atlas;
  const double area = SurfaceArea(points, triangles);
  double texel = options.texel_mm > 0 ? options.texel_mm / 1000 : pixel_on_surface;
  if (!(texel > 0) || !(area > 0) || !std::isfinite(area)) return atlas;
  texel = std::max(texel, std::sqrt(area / max_texels));
  const auto edge_of = [area](size_t count) {
    return std::sqrt(2 * area / static_cast<double>(count));
  };
  const auto left = static_cast<size_t>(options.decimated_to);
  const bool is_worth_it =
      edge_of(triangles.size()) >= kWorthTexels * texel ||
      (left > 0 && left < triangles.size() && edge_of(left) >= kWorthDecimated * texel);
  if (options.mode == "auto" && !is_worth_it) return atlas;

  const int room = options.max_page_size - 3 * kGutter;
  ChartOptions chart_options;
  chart_options.max_extent = room * texel / std::sqrt(2.0);  // a chart may lie askew in its box
  chart_options.smooth_below = kWorthTexels * texel;
  MeshCharts charts = GrowCharts(points, triangles, chart_options);
  const std::vector<FlatChart> flat =
      MakeFlatCharts(points, triangles, texel, room, kMostGutters * max_texels, &charts);
  if (flat.empty()) return atlas;
  std::vector<std::array<int, 2>> sizes;
  std::vector<double> texel_of;
  double total = 0;
  int widest = 0;
  for (const FlatChart& chart : flat) {
    const ChartSize size = SizeOf(chart, texel, room);
    texel_of.push_back(size.texel);
    sizes.push_back(size.size);
    total += size.area();
    widest = std::max({widest, size.size[0], size.size[1]});
  }
  atlas.page_size = ChoosePageSize(total, widest, options.max_page_size);
  const Packing packing = PackRectangles(sizes, atlas.page_size);
  atlas.texel_size = texel;
  atlas.num_pages = packing.num_pages;
  atlas.chart_of = std::move(charts.chart_of);
  for (size_t c = 0; c < flat.size(); ++c) {
    const PackedRectangle& place = packing.places[c];
    AtlasChart chart;
    chart.page = place.page;
    chart.page_from_scan.leftCols<3>() = flat[c].axes / texel_of[c];
    chart.page_from_scan.col(3) = Eigen::Vector2d(place.x + kGutter, place.y + kGutter) -
                                  (flat[c].axes * flat[c].centre + flat[c].low) / texel_of[c];
    atlas.charts.push_back(chart);
  }
  return atlas;
}

AtlasTexels::AtlasTexels(const std::vector<Eigen::Vector3d>& points,
                         const std::vector<Triangle>& triangles, const MeshAtlas& atlas,
                         const std::vector<Rgb>& vertex_colors, int page)
    : points_(points), triangles_(triangles), atlas_(atlas), vertex_colors_(vertex_colors) {
  for (size_t t = 0; t < triangles.size(); ++t) {
    const int chart = atlas.chart_of[t];
    if (chart >= 0 && atlas.charts[chart].page == page) on_page_.push_back(static_cast<int>(t));
  }
}

TexelBlock AtlasTexels::Rows(int first, int end) const {
  const int size = atlas_.page_size;
  const size_t count = static_cast<size_t>(size) * (end - first);
  TexelBlock block;
  block.points.assign(count, Scan::MissingPoint());
  block.normals.assign(count, Eigen::Vector3f::Zero());
  block.links.bits.assign(count, 0);
  block.unseen.assign(count, Rgb{0, 0, 0});
  std::vector<int> chart_at(count, -1);
  for (const int t : on_page_) {
    const int number = atlas_.chart_of[t];
    const AtlasChart& chart = atlas_.charts[number];
    const Triangle& corners = triangles_[t];
    const Eigen::Vector3d &a = points_[corners[0]], &b = points_[corners[1]],
                          &c = points_[corners[2]];
    const Eigen::Vector3f normal = (b - a).cross(c - a).normalized().cast<float>();
    const auto set = [&](int column, int row, const Eigen::Vector3d& shares) {
      const size_t i = static_cast<size_t>(row - first) * size + column;
      if (chart_at[i] >= 0) return;
      chart_at[i] = number;
      block.points[i] = shares[0] * a + shares[1] * b + shares[2] * c;
      block.normals[i] = normal;
      for (int k = 0; k < 3; ++k) {
        double value = 0;
        for (int j = 0; j < 3; ++j) value += shares[j] * vertex_colors_[corners[j]][k];
        block.unseen[i][k] = static_cast<uint8_t>(std::lround(value));
      }
    };
    const FlatTriangle flat{{chart.InPage(a), chart.InPage(b), chart.InPage(c)}};
    flat.ForEachTexel(first, end, set);
    // A sliver between the texels' centres has a colour, too.
    const Eigen::Vector2d middle = (flat.corner[0] + flat.corner[1] + flat.corner[2]) / 3;
    const int column = std::clamp(static_cast<int>(middle.x()), 0, size - 1);
    const int row = static_cast<int>(middle.y());
    if (row >= first && row < end) set(column, row, Eigen::Vector3d::Constant(1.0 / 3));
  }
  for (size_t i = 0; i < count; ++i) {
    if (chart_at[i] < 0) continue;
    const bool right = (i + 1) % size != 0 && chart_at[i + 1] == chart_at[i];
    const bool down = i + size < count && chart_at[i + size] == chart_at[i];
    block.links.bits[i] =
        static_cast<uint8_t>((right ? GridLinks::kRight : 0) | (down ? GridLinks::kDown : 0));
  }
  return block;
}

void FinishPage(const TexelSource& texels, ColorGrid* page, double* num_texels, double* num_seen) {
  constexpr int kRowsAtOnce = 256;
  cv::Mat1b known(page->num_rows, page->num_columns, uint8_t{0});
  for (int first = 0; first < page->num_rows; first += kRowsAtOnce) {
    const int end = std::min(page->num_rows, first + kRowsAtOnce);
    const TexelBlock block = texels.Rows(first, end);
    for (size_t i = 0; i < block.points.size(); ++i) {
      const bool covered = block.points[i].x() == block.points[i].x();
      const size_t texel = static_cast<size_t>(first) * page->num_columns + i;
      known.data[texel] = covered;
      *num_texels += covered;
      *num_seen += page->views[texel] > 0;
    }
  }
  cv::Mat image = ImageOfGrid(*page);
  PaintGutters(known, std::max(known.rows, known.cols), &image);
  auto pixel = image.begin<cv::Vec3b>();
  for (Rgb& rgb : page->rgb) {
    rgb = {(*pixel)[2], (*pixel)[1], (*pixel)[0]};
    ++pixel;
  }
}

}  // namespace roomtex
