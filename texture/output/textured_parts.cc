#include "texture/output/textured_parts.h"

#include <algorithm>
#include <map>
#include <unordered_map>
#include <utility>

#include "core/frames.h"
#include "texture/output/write_texture.h"
#include "texture/texels/grid_image.h"
#include "texture/texels/gutters.h"

namespace roomtex {
namespace {

constexpr int kOverlap = 16;    // samples on either side of a cut
constexpr int kAlignment = 16;  // samples: places of the cuts, widths of the images

int TexelsPerSample(const Scan& scan, const ColoredScan& colored) {
  return colored.texture.num_columns > 0 ? colored.texture.num_columns / scan.num_columns : 1;
}

// How one direction of a grid is cut.
struct Cuts {
  int quads = 0;    // per part
  int overlap = 0;  // samples before and behind
  int samples = 0;  // of the grid, the repeated first column of a full turn included

  Cuts(int num_samples, int scale, int max_size) : samples(num_samples) {
    if (num_samples * scale <= max_size) {
      quads = num_samples;
      return;
    }
    const int most = std::max(3, max_size / scale);
    const int aligned = most / kAlignment * kAlignment - 2 * kOverlap;
    overlap = aligned >= 4 * kOverlap ? kOverlap : 0;
    if (overlap == 0) {
      quads = most - 2;
      return;
    }
    const int parts = (num_samples + aligned - 1) / aligned;
    const int even = (num_samples + parts - 1) / parts;
    quads = (even + kAlignment - 1) / kAlignment * kAlignment;
  }
  int First(int part) const { return part == 0 && overlap == 0 ? 0 : part * quads - overlap; }
  // Samples of a part's image: the triangles over a missing sample are two quads long.
  int Length(int part) const {
    if (overlap > 0) return quads + 2 * overlap;
    return std::min(quads + 2, samples - part * quads);
  }
};

// Corner columns of a triangle, unrolled: where a full turn closes, column 0 becomes num_columns.
std::array<int, 3> UnrolledColumns(const Triangle& t, int num_columns) {
  std::array<int, 3> columns{t[0] % num_columns, t[1] % num_columns, t[2] % num_columns};
  const int low = std::min({columns[0], columns[1], columns[2]});
  const int high = std::max({columns[0], columns[1], columns[2]});
  if (high - low > 1 && num_columns > 2) {
    for (int& column : columns) column += column == 0 ? num_columns : 0;
  }
  return columns;
}

std::vector<TexturedPart> SplitGrid(const Scan& scan, const ColoredScan& colored, int max_size) {
  const int scale = TexelsPerSample(scan, colored);
  const Cuts across(scan.num_columns + 1, scale, max_size), down(scan.num_rows, scale, max_size);
  struct Growing {
    TexturedPart part;
    std::vector<int> local;  // number of each sample's vertex in the part; -1 = not yet
  };
  std::map<std::pair<int, int>, Growing> growing;  // by row and column of the part
  for (const Triangle& t : colored.triangles) {
    const std::array<int, 3> columns = UnrolledColumns(t, scan.num_columns);
    const std::array<int, 3> rows{t[0] / scan.num_columns, t[1] / scan.num_columns,
                                  t[2] / scan.num_columns};
    const int i = *std::min_element(rows.begin(), rows.end()) / down.quads;
    const int j = *std::min_element(columns.begin(), columns.end()) / across.quads;
    auto& [part, local] = growing[{i, j}];
    const int samples_across = across.Length(j);
    if (part.width == 0) {
      part.first_column = across.First(j) * scale;
      part.first_row = down.First(i) * scale;
      part.width = samples_across * scale;
      part.height = down.Length(i) * scale;
      part.texels_per_sample = scale;
      local.assign(static_cast<size_t>(down.Length(i)) * samples_across, -1);
    }
    for (int k = 0; k < 3; ++k) {
      const int column = columns[k] - across.First(j), row = rows[k] - down.First(i);
      int& number = local[static_cast<size_t>(row) * samples_across + column];
      if (number < 0) {
        number = static_cast<int>(part.vertices.size());
        part.vertices.push_back(t[k]);
        const Eigen::Vector2d centre((column + 0.5) * scale, (row + 0.5) * scale);
        part.uv.push_back(GltfUvFromImg(centre, part.width, part.height).cast<float>());
      }
      part.corners.push_back(static_cast<uint32_t>(number));
    }
  }
  std::vector<TexturedPart> parts;
  for (auto& [key, one] : growing) parts.push_back(std::move(one.part));
  return parts;
}

std::vector<TexturedPart> PartsOfAtlas(const Scan& scan, const ColoredScan& colored) {
  const MeshAtlas& atlas = colored.atlas;
  std::vector<TexturedPart> parts(atlas.num_pages);
  // A vertex stands once for every chart that it belongs to.
  std::unordered_map<uint64_t, uint32_t> number_of;
  for (size_t i = 0; i < colored.triangles.size(); ++i) {
    const int c = atlas.chart_of[i];
    if (c < 0) continue;
    const AtlasChart& chart = atlas.charts[c];
    TexturedPart& part = parts[chart.page];
    for (const int corner : colored.triangles[i]) {
      const uint64_t key = static_cast<uint64_t>(c) << 32 | static_cast<uint32_t>(corner);
      const auto [entry, is_new] =
          number_of.try_emplace(key, static_cast<uint32_t>(part.vertices.size()));
      if (is_new) {
        part.vertices.push_back(corner);
        part.uv.push_back(
            GltfUvFromImg(chart.InPage(scan.points[corner]), atlas.page_size, atlas.page_size)
                .cast<float>());
      }
      part.corners.push_back(entry->second);
    }
  }
  for (int page = 0; page < atlas.num_pages; ++page) {
    parts[page].page = page;
    parts[page].width = atlas.page_size;
    parts[page].height = atlas.page_size;
  }
  return parts;
}

}  // namespace

std::vector<TexturedPart> MakeTexturedParts(const Scan& scan, const ColoredScan& colored,
                                            int max_texture_size) {
  if (scan.organised) return SplitGrid(scan, colored, max_texture_size);
  if (!colored.atlas.empty()) return PartsOfAtlas(scan, colored);
  return {};
}

cv::Mat PartImage(const Scan& scan, const ColoredScan& colored, const TexturedPart& part) {
  if (part.page >= 0) return ImageOfGrid(colored.atlas.pages[part.page]);
  const int scale = TexelsPerSample(scan, colored);
  const ColorGrid& grid = scale > 1 ? colored.texture : colored.samples;
  cv::Mat3b image(part.height, part.width, cv::Vec3b(0, 0, 0));
  cv::Mat1b known(image.size(), uint8_t{0});
  for (int row = 0; row < image.rows; ++row) {
    const int grid_row = part.first_row + row;
    if (grid_row < 0 || grid_row >= grid.num_rows) continue;
    for (int column = 0; column < image.cols; ++column) {
      const int grid_column = (part.first_column + column + grid.num_columns) % grid.num_columns;
      const size_t texel = static_cast<size_t>(grid_row) * grid.num_columns + grid_column;
      const auto& [r, g, b] = grid.rgb[texel];
      // A single missing sample may have got texels of its own.
      const bool missing = scan.IsMissing(scan.Index(grid_column / scale, grid_row / scale));
      if (missing && (scale == 1 || grid.rgb[texel] == Rgb{0, 0, 0})) continue;
      image(row, column) = {b, g, r};
      known(row, column) = 1;
    }
  }
  cv::Mat painted = image;
  PaintGutters(known, std::max(image.rows, image.cols), &painted);
  return painted;
}

}  // namespace roomtex
