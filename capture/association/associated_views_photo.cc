#include "capture/association/associated_views_photo.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "capture/association/associated_views_light.h"
#include "core/frames.h"
#include "core/photo.h"

namespace roomtex {
namespace {

constexpr int kSmall = 384;       // pixels of the longer side
constexpr int kSketchWidth = 64;  // pixels
constexpr double kLeastAgreement = 0.35, kLeastSignificance = 3.5;
constexpr int kLightTile = 16;           // pixels of the small picture
constexpr double kChangedDetail = 0.05;  // step of log light that noise does not make
constexpr double kLeastChanged = 0.06;   // share of the picture: a pattern, not a passer-by

std::vector<float> Sketch(const cv::Mat1b& small) {
  cv::Mat edges;
  const int height = std::max(8, kSketchWidth * small.rows / small.cols);
  cv::resize(MakeEdgeThumb(small), edges, {kSketchWidth, height}, 0, 0, cv::INTER_AREA);
  cv::GaussianBlur(edges, edges, {}, 0.7);
  std::vector<float> sketch(edges.ptr<float>(), edges.ptr<float>() + 2 * edges.total());
  double squares = 0;
  for (const float value : sketch) squares += static_cast<double>(value) * value;
  const auto scale = static_cast<float>(1 / std::sqrt(std::max(squares, 1e-12)));
  for (float& value : sketch) value *= scale;
  return sketch;
}

double RootMeanSquare(const cv::Mat1f& values, const cv::Mat1b& clipped) {
  double squares = 0, count = 0;
  for (int row = 0; row < values.rows; ++row) {
    for (int column = 0; column < values.cols; ++column) {
      if (clipped(row, column) != 0) continue;
      squares += static_cast<double>(values(row, column)) * values(row, column);
      count += 1;
    }
  }
  return count > 0 ? std::sqrt(squares / count) : 0;
}

// Sum of products where nothing is clipped.
double ProductSum(const cv::Mat1f& a, const cv::Mat1f& b, const cv::Mat1b& clipped) {
  double sum = 0;
  for (int row = 0; row < a.rows; ++row) {
    for (int column = 0; column < a.cols; ++column) {
      if (clipped(row, column) != 0) continue;
      sum += static_cast<double>(a(row, column)) * b(row, column);
    }
  }
  return sum;
}

cv::Mat1b MovedBack(const cv::Mat1b& image, const Eigen::Vector2d& shift) {
  const cv::Matx23d move(1, 0, shift.x(), 0, 1, shift.y());
  cv::Mat1b moved;
  cv::warpAffine(image, moved, move, image.size(), cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                 cv::BORDER_REPLICATE);
  return moved;
}

}  // namespace

PhotoSummary SummarizePhoto(const std::string& name, const std::string& path) {
  PhotoSummary summary;
  summary.name = name;
  summary.path = path;
  try {
    summary.size = ReadPhotoSize(path);
    const int longer = std::max(summary.size[0], summary.size[1]);
    int shrink = 1;
    while (shrink < 8 && longer / (2 * shrink) >= kSmall) shrink *= 2;
    const cv::Mat1b grey = ReadGreyPhoto(path, shrink);
    if (longer <= 0) summary.size = {grey.cols, grey.rows};
    const double scale =
        std::min(1.0, static_cast<double>(kSmall) / std::max(grey.cols, grey.rows));
    cv::resize(grey, summary.small, {}, scale, scale, cv::INTER_AREA);
    if (std::min(summary.small.cols, summary.small.rows) < 32) {
      summary.unreadable = "is too small or too narrow to compare";
      return summary;
    }
    const ExposureData exposure = ReadExposureData(path);
    summary.exposure = exposure.RelativeExposure();
    summary.date_time = exposure.date_time;
    summary.sketch = Sketch(summary.small);
  } catch (const std::exception& error) {
    summary.unreadable = error.what();
  }
  return summary;
}

double SketchLikeness(const PhotoSummary& a, const PhotoSummary& b) {
  if (a.sketch.size() != b.sketch.size()) return 0;
  double sum = 0;
  for (size_t i = 0; i < a.sketch.size(); ++i)
    sum += static_cast<double>(a.sketch[i]) * b.sketch[i];
  return sum;
}

PlaceComparison ComparePlaces(const PhotoSummary& first, const PhotoSummary& second) {
  PlaceComparison result;
  if (first.small.size() != second.small.size()) return result;
  const int max_shift = std::max(6, first.small.cols / 16);
  const CoarseShift coarse =
      FindCoarseShift(MakeEdgeThumb(first.small), MakeEdgeThumb(second.small), max_shift);
  const double scale = static_cast<double>(first.size[0]) / first.small.cols;
  result.shift = scale * coarse.shift;
  result.agreement = coarse.agreement;
  result.same_place =
      coarse.agreement > kLeastAgreement && coarse.significance > kLeastSignificance;
  return result;
}

LightComparison CompareLight(const PhotoSummary& first, const PhotoSummary& second,
                             const Eigen::Vector2d& shift) {
  LightComparison result;
  const cv::Mat1b& a = first.small;
  const double scale = static_cast<double>(first.size[0]) / a.cols;
  const cv::Mat1b b = MovedBack(second.small, shift / scale);
  cv::Mat1b clipped(a.size());
  double light_a = 0, light_b = 0;
  for (int row = 0; row < a.rows; ++row) {
    for (int column = 0; column < a.cols; ++column) {
      const bool useless = IsClipped(a(row, column)) || IsClipped(b(row, column));
      clipped(row, column) = useless ? 255 : 0;
      if (useless) continue;
      light_a += LinearFromSrgbByte()[a(row, column)];
      light_b += LinearFromSrgbByte()[b(row, column)];
    }
  }
  result.brightness_ratio = light_a > 0 ? light_b / light_a : 1;
  if (first.exposure && second.exposure) {
    result.brightness_ratio *= *first.exposure / *second.exposure;
    result.exif_brightness = true;
  }
  const cv::Mat1f light_of_a = LogLight(a), light_of_b = LogLight(b);
  const cv::Mat1f change = BandOf(light_of_b - light_of_a, 0.7, 4);
  const cv::Mat1f detail_of_a = BandOf(light_of_a, 0.7, 4),
                  detail_of_b = BandOf(light_of_b, 0.7, 4);
  double tiles = 0, changed = 0, squares_a = 0, squares_b = 0;
  // Of the change, which is b - a: what came with b, and what went with a.
  double came = 0, went = 0;
  for (int y = 0; y + kLightTile <= a.rows; y += kLightTile) {
    for (int x = 0; x + kLightTile <= a.cols; x += kLightTile) {
      const cv::Rect tile(x, y, kLightTile, kLightTile);
      if (cv::countNonZero(clipped(tile)) > kLightTile * kLightTile / 2) continue;
      tiles += 1;
      const double in_a = RootMeanSquare(detail_of_a(tile), clipped(tile));
      const double in_b = RootMeanSquare(detail_of_b(tile), clipped(tile));
      const double differs = RootMeanSquare(change(tile), clipped(tile));
      // A little motion changes what has edges: as much detail must come or go.
      if (differs < kChangedDetail || differs < 0.5 * std::max(in_a, in_b)) continue;
      changed += 1;
      squares_a += in_a * in_a;
      squares_b += in_b * in_b;
      came += ProductSum(change(tile), detail_of_b(tile), clipped(tile));
      went -= ProductSum(change(tile), detail_of_a(tile), clipped(tile));
    }
  }
  result.changed_share = tiles > 0 ? changed / tiles : 0;
  result.same_light = result.changed_share < kLeastChanged;
  if (came + went > 0) result.two_sided = std::max(0.0, std::min(came, went) / (came + went));
  if (changed > 0) result.detail_ratio = std::sqrt(squares_b / std::max(squares_a, 1e-12));
  return result;
}

std::optional<KeypointShift> FindKeypointShift(const std::vector<Eigen::Vector2d>& first,
                                               const std::vector<Eigen::Vector2d>& second,
                                               const Eigen::Vector2d& start) {
  constexpr double kReach = 4, kBin = 0.25, kTogether = 0.75;
  constexpr int kBins = static_cast<int>(2 * kReach / kBin);
  std::map<std::pair<int, int>, std::vector<int>> cells;  // of kReach pixels
  const auto cell_of = [](double x) { return static_cast<int>(std::floor(x / kReach)); };
  for (size_t j = 0; j < second.size(); ++j) {
    cells[{cell_of(second[j].x()), cell_of(second[j].y())}].push_back(static_cast<int>(j));
  }
  std::vector<Eigen::Vector2d> steps;
  for (const Eigen::Vector2d& x : first) {
    const Eigen::Vector2d at = x + start;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const auto cell = cells.find({cell_of(at.x()) + dx, cell_of(at.y()) + dy});
        if (cell == cells.end()) continue;
        for (const int j : cell->second) {
          const Eigen::Vector2d step = second[j] - at;
          if (step.lpNorm<Eigen::Infinity>() < kReach) steps.push_back(step);
        }
      }
    }
  }
  // The fullest place: a bin and its neighbours.
  cv::Mat1f counts(kBins, kBins, 0.0f), sums;
  for (const Eigen::Vector2d& step : steps) {
    counts(static_cast<int>((step.y() + kReach) / kBin),
           static_cast<int>((step.x() + kReach) / kBin)) += 1;
  }
  cv::boxFilter(counts, sums, -1, {5, 5}, {-1, -1}, false, cv::BORDER_CONSTANT);
  cv::Point best;
  cv::minMaxLoc(sums, nullptr, nullptr, nullptr, &best);
  Eigen::Vector2d shift((best.x + 0.5) * kBin - kReach, (best.y + 0.5) * kBin - kReach);
  const double area = kPi * kTogether * kTogether, all = 4 * kReach * kReach;
  double together = 0, squares = 0;
  for (int round = 0; round < 5; ++round) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    together = squares = 0;
    for (const Eigen::Vector2d& step : steps) {
      if ((step - shift).norm() > kTogether) continue;
      sum += step;
      squares += (step - shift).squaredNorm();
      together += 1;
    }
    if (together < 8) return std::nullopt;
    shift = sum / together;
  }
  const double chance = (static_cast<double>(steps.size()) - together) * area / (all - area);
  const double beyond = together - chance;
  if (beyond < 8 || beyond < 5 * std::sqrt(chance + 1)) return std::nullopt;
  return KeypointShift{start + shift, std::sqrt(squares / 2 / together) / std::sqrt(beyond),
                       static_cast<int>(beyond)};
}

}  // namespace roomtex
