#include "capture/association/associated_views_shift.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <Eigen/LU>
#include <opencv2/imgproc.hpp>

#include "capture/association/associated_views_light.h"
#include "core/decompositions.h"
#include "core/robust_kernel.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr int kTile = 24;         // pixels
constexpr int kMostTiles = 1500;  // with the strongest edges
constexpr int kLeastTiles = 12;
constexpr double kFine = 1.2, kCoarse = 5.0;  // Gaussian sigmas of the band that is compared
constexpr double kDependent = 10;  // pixels of the band that count as one: neighbours are alike
constexpr double kLeastDeviations = 2.5;  // of an edge's contrast, for it to be there at all
constexpr int kFewTiles = 150;            // rooms with so few edges need the doubtful ones, too
// Step of log light over an edge in the patterned photo, over that in the plain one.
constexpr double kContrast = 0.8, kContrastSpread = 0.4;
constexpr float kLeastEdge = 0.005f;  // root mean square of the slope of log light, per pixel

using Motion = Eigen::Vector4d;  // shift x, y; roll and scale in pixels at the corners

// Motion of a place, linear in Motion. Places are about the middle, in half diagonals.
Eigen::Matrix<double, 2, 4> JacobianAt(const Eigen::Vector2d& place) {
  Eigen::Matrix<double, 2, 4> j;
  j << 1, 0, -place.y(), place.x(), 0, 1, place.x(), place.y();
  return j;
}

// What one tile says about the motion at its place: shift, known as well as `information`.
struct TileShift {
  Eigen::Vector2d place = Eigen::Vector2d::Zero(), shift = Eigen::Vector2d::Zero();
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
};

class Level {
 public:
  Level(const cv::Mat1b& plain, const cv::Mat1b& patterned)
      : plain_(BandOf(LogLight(plain), kFine, kCoarse)),
        patterned_(BandOf(LogLight(patterned), kFine, kCoarse)),
        clipped_(plain.size(), uchar{0}) {
    cv::Sobel(plain_, dx_, CV_32F, 1, 0, 1, 0.5, 0, cv::BORDER_REPLICATE);
    cv::Sobel(plain_, dy_, CV_32F, 0, 1, 1, 0.5, 0, cv::BORDER_REPLICATE);
    for (int row = 0; row < plain.rows; ++row) {
      for (int column = 0; column < plain.cols; ++column) {
        clipped_(row, column) =
            IsClipped(plain(row, column)) || IsClipped(patterned(row, column)) ? 255 : 0;
      }
    }
    cv::dilate(clipped_, clipped_, cv::Mat::ones(5, 5, CV_8U));
    ChooseTiles();
  }

  int num_tiles() const { return static_cast<int>(tiles_.size()); }

  // How well the edges fit after a motion: logarithm of how much likelier the tiles are with it.
  double Score(const Motion& motion) const {
    const cv::Mat1f moved = MoveBack(motion);
    double score = 0;
    for (const cv::Rect& tile : tiles_) {
      const Sums sums = SumUp(tile, moved);
      const double product = sums.right[0];
      if (!(product > 0)) continue;
      const double share = product * product / (sums.normal(0, 0) * sums.squares + 1e-12);
      score -= 0.5 * sums.count / kDependent * std::log(std::max(1 - share, 1e-3));
    }
    return score;
  }

  // One linear step from `motion`.
  std::vector<TileShift> FitTiles(Motion motion, double least_deviations) const {
    // OpenCV moves by 32nds of a pixel.
    for (int k = 0; k < 2; ++k) motion[k] = std::round(32 * motion[k]) / 32;
    const cv::Mat1f moved = MoveBack(motion);
    std::vector<TileShift> shifts;
    for (const cv::Rect& tile : tiles_) {
      TileShift shift;
      shift.place = PlaceOf(tile);
      if (!FitTile(tile, moved, least_deviations, &shift)) continue;
      shift.shift += JacobianAt(shift.place) * motion;
      shifts.push_back(shift);
    }
    return shifts;
  }

 private:
  Eigen::Vector2d Middle() const { return {(plain_.cols - 1) / 2.0, (plain_.rows - 1) / 2.0}; }
  double HalfDiagonal() const { return 0.5 * std::hypot(plain_.cols, plain_.rows); }
  Eigen::Vector2d PlaceOf(const cv::Rect& tile) const {
    return (Eigen::Vector2d(tile.x + (tile.width - 1) / 2.0, tile.y + (tile.height - 1) / 2.0) -
            Middle()) /
           HalfDiagonal();
  }

  void ChooseTiles() {
    struct Strength {
      float edge;
      cv::Rect tile;
    };
    std::vector<Strength> all;
    const int border = 8;
    for (int y = border; y + kTile + border <= plain_.rows; y += kTile) {
      for (int x = border; x + kTile + border <= plain_.cols; x += kTile) {
        const cv::Rect tile(x, y, kTile, kTile);
        if (cv::countNonZero(clipped_(tile)) > kTile * kTile / 4) continue;
        const double sx = cv::norm(dx_(tile)), sy = cv::norm(dy_(tile));
        const auto edge = static_cast<float>(std::hypot(sx, sy) / kTile);
        if (edge > kLeastEdge) all.push_back({edge, tile});
      }
    }
    std::stable_sort(all.begin(), all.end(),
                     [](const Strength& a, const Strength& b) { return a.edge > b.edge; });
    if (all.size() > kMostTiles) all.resize(kMostTiles);
    for (const Strength& strength : all) tiles_.push_back(strength.tile);
  }

  // The patterned photo on the plain one's pixels.
  cv::Mat1f MoveBack(const Motion& motion) const {
    const double a = motion[3] / HalfDiagonal(), b = motion[2] / HalfDiagonal();
    const Eigen::Vector2d m = Middle();
    const cv::Matx23d patterned_from_plain(1 + a, -b, motion[0] - a * m.x() + b * m.y(),  //
                                           b, 1 + a, motion[1] - b * m.x() - a * m.y());
    cv::Mat1f moved;
    cv::warpAffine(patterned_, moved, patterned_from_plain, patterned_.size(),
                   cv::INTER_LANCZOS4 | cv::WARP_INVERSE_MAP, cv::BORDER_REPLICATE);
    return moved;
  }

  // Sums over a tile of (plain, -slope) and of the patterned photo.
  struct Sums {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    double squares = 0, count = 0;
  };
  Sums SumUp(const cv::Rect& tile, const cv::Mat1f& moved) const {
    Sums sums;
    for (int y = tile.y; y < tile.y + tile.height; ++y) {
      for (int x = tile.x; x < tile.x + tile.width; ++x) {
        if (clipped_(y, x) != 0) continue;
        const Eigen::Vector3d row(plain_(y, x), -dx_(y, x), -dy_(y, x));
        const double seen = moved(y, x);
        sums.normal += row * row.transpose();
        sums.right += row * seen;
        sums.squares += seen * seen;
        sums.count += 1;
      }
    }
    return sums;
  }

  // patterned(x) = contrast * (plain(x) - shift . slope(x)): least squares. False where the edge
  // does not show in the patterned photo.
  bool FitTile(const cv::Rect& tile, const cv::Mat1f& moved, double least_deviations,
               TileShift* result) const {
    const Sums sums = SumUp(tile, moved);
    Eigen::Matrix3d normal = sums.normal;
    Eigen::Vector3d right = sums.right;
    // A slope that is missing in one direction stays unknown.
    normal.diagonal().array() += 1e-6 * normal.trace() + 1e-12;
    const Eigen::Vector3d free = SolveSymmetric(normal, right);
    const double rest = std::max(sums.squares - right.dot(free), 1e-3 * sums.squares);
    const double variance = rest / std::max(sums.count, 1.0) * kDependent + 1e-9;
    if (free[0] * std::sqrt(normal(0, 0) / variance) < least_deviations) return false;
    // The contrast in the other light is held to kContrast where the tile says little of it.
    const double hold = variance / (kContrastSpread * kContrastSpread);
    normal(0, 0) += hold;
    right[0] += hold * kContrast;
    const Eigen::Vector3d solution = SolveSymmetric(normal, right);
    const double contrast = solution[0];
    if (!(contrast > 0.1 && contrast < 3)) return false;
    result->shift = solution.tail<2>() / contrast;
    if (!(result->shift.norm() < 50)) return false;
    const Eigen::Vector2d mixed = normal.block<2, 1>(1, 0);
    result->information = contrast * contrast / variance *
                          (normal.block<2, 2>(1, 1) - mixed * mixed.transpose() / normal(0, 0));
    return true;
  }

  cv::Mat1f plain_, patterned_, dx_, dy_;
  cv::Mat1b clipped_;
  std::vector<cv::Rect> tiles_;
};

struct Joined {
  Motion motion = Motion::Zero();
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
};

double Contradiction(const TileShift& tile, const Motion& motion) {
  const Eigen::Vector2d r = tile.shift - JacobianAt(tile.place) * motion;
  return r.dot(tile.information * r);
}

// Robust weighted mean motion.
Joined Join(const std::vector<TileShift>& tiles, const Motion& start, bool shift_only) {
  Joined joined;
  joined.motion = start;
  if (shift_only) joined.motion.tail<2>().setZero();
  // The middle of squared deviations in two dimensions is 1.39 times the variance.
  double spread = 1;
  for (int round = 0; round < 8; ++round) {
    std::vector<double> contradictions;
    for (const TileShift& tile : tiles) {
      contradictions.push_back(Contradiction(tile, joined.motion));
    }
    spread = std::max(Median(contradictions) / 1.39, 0.05);
    Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    for (size_t i = 0; i < tiles.size(); ++i) {
      const double weight = GemanMcClureWeight(contradictions[i] / (4 * spread), 1 / spread);
      const auto j = JacobianAt(tiles[i].place);
      normal += weight * j.transpose() * tiles[i].information * j;
      right += weight * j.transpose() * tiles[i].information * tiles[i].shift;
    }
    // What is bumped against turns sideways and up or down, seldom about the lens' axis.
    const double held = 0.5 + 0.2 * joined.motion.head<2>().norm();
    for (int k = 2; k < 4; ++k) normal(k, k) += shift_only ? 1e12 : 1 / (held * held);
    for (int k = 0; k < 2; ++k) normal(k, k) += 1e-9;
    joined.covariance = normal.inverse();
    joined.motion = joined.covariance * right;
  }
  return joined;
}

CameraShift Describe(const std::vector<TileShift>& tiles, const Motion& motion) {
  CameraShift result;
  Joined joined = Join(tiles, motion, false);
  const auto is_sure = [&](int k) {
    return std::abs(joined.motion[k]) > 5 * std::sqrt(joined.covariance(k, k)) &&
           std::abs(joined.motion[k]) > 0.3;
  };
  if (!is_sure(2) && !is_sure(3)) joined = Join(tiles, motion, true);
  result.found = true;
  result.shift = joined.motion.head<2>();
  result.roll_px = joined.motion[2];
  result.scale_px = joined.motion[3];
  // Squared distance from the middle, in half diagonals, is 1/3 on average over a rectangle.
  result.offset_px =
      std::sqrt(joined.motion.head<2>().squaredNorm() + joined.motion.tail<2>().squaredNorm() / 3);
  const double trace = joined.covariance(0, 0) + joined.covariance(1, 1) +
                       (joined.covariance(2, 2) + joined.covariance(3, 3)) / 3;
  // Twice what the scatter of the tiles says: measured on empty rooms, where a pattern pulls
  // neighbouring tiles the same way.
  result.error_px = 2 * std::sqrt(trace / 2);
  result.num_tiles = static_cast<int>(tiles.size());
  return result;
}

Motion ShiftOnly(const Eigen::Vector2d& shift) { return {shift.x(), shift.y(), 0, 0}; }

// The best fitting shift near `start`: the linear steps must begin within a pixel or two.
Eigen::Vector2d BestStart(const Level& level, const Eigen::Vector2d& start) {
  constexpr int kReach = 4;  // pixels
  Eigen::Vector2d best = start;
  double best_score = level.Score(ShiftOnly(start));
  for (int y = -kReach; y <= kReach; ++y) {
    for (int x = -kReach; x <= kReach; ++x) {
      const Eigen::Vector2d shift = start + Eigen::Vector2d(x, y);
      const double score = level.Score(ShiftOnly(shift));
      if (score > best_score) {
        best_score = score;
        best = shift;
      }
    }
  }
  return best;
}

// Both photos smaller and smaller; the last one has full size.
struct Pyramid {
  std::vector<int> shrinks;
  std::vector<Level> levels;
};
Pyramid MakePyramid(const cv::Mat1b& plain, const cv::Mat1b& patterned) {
  Pyramid pyramid;
  for (const int shrink : {4, 2, 1}) {
    if (shrink > 1 && std::min(plain.cols, plain.rows) / shrink < 150) continue;
    cv::Mat1b a = plain, b = patterned;
    if (shrink > 1) {
      cv::resize(plain, a, {}, 1.0 / shrink, 1.0 / shrink, cv::INTER_AREA);
      cv::resize(patterned, b, {}, 1.0 / shrink, 1.0 / shrink, cv::INTER_AREA);
    }
    pyramid.shrinks.push_back(shrink);
    pyramid.levels.emplace_back(a, b);
  }
  return pyramid;
}

// Coarse to fine, linear steps. Not found where too few edges show in both.
CameraShift Climb(const Pyramid& pyramid, const Eigen::Vector2d& start, double least_deviations) {
  Motion motion = ShiftOnly(start);
  std::vector<TileShift> tiles;
  int least_steps = 3;  // the first two of them without roll and scale
  for (size_t i = 0; i < pyramid.levels.size(); ++i) {
    motion /= pyramid.shrinks[i];
    for (int step = 0; step < 8; ++step) {
      std::vector<TileShift> fitted = pyramid.levels[i].FitTiles(motion, least_deviations);
      if (static_cast<int>(fitted.size()) < kLeastTiles) {
        if (pyramid.shrinks[i] == 1) return {};
        break;
      }
      tiles = std::move(fitted);
      const Motion next = Join(tiles, motion, step + 1 < least_steps).motion;
      const double change = (next - motion).norm();
      motion = next;
      if (change < 0.01 && step + 1 >= least_steps) break;
    }
    motion *= pyramid.shrinks[i];
    if (!tiles.empty()) least_steps = 1;
  }
  return Describe(tiles, motion);
}

}  // namespace

CameraShift FindCameraShift(const cv::Mat1b& plain, const cv::Mat1b& patterned,
                            const Eigen::Vector2d& start) {
  const Pyramid pyramid = MakePyramid(plain, patterned);
  const Level& full = pyramid.levels.back();
  const double unmoved = full.Score(Motion::Zero());
  CameraShift result;
  const auto attempt = [&](const Eigen::Vector2d& from, double least_deviations) {
    CameraShift found = Climb(pyramid, from, least_deviations);
    if (!found.found) return;
    Motion motion = ShiftOnly(found.shift);
    motion.tail<2>() << found.roll_px, found.scale_px;
    found.advantage = full.Score(motion) - unmoved;
    if (!result.found || found.advantage > result.advantage) result = found;
  };
  const int shrink = pyramid.shrinks[0];
  const Eigen::Vector2d zero = Eigen::Vector2d::Zero();
  const Eigen::Vector2d best = shrink * BestStart(pyramid.levels[0], start / shrink);
  // Most cameras did not move: that is always tried, and the photos decide.
  attempt(zero, kLeastDeviations);
  if (best.norm() > 1.5 * shrink || !result.found) attempt(best, kLeastDeviations);
  if (!result.found || result.num_tiles < kFewTiles) {
    attempt(zero, -1e9);
    if (best.norm() > 1.5 * shrink) attempt(best, -1e9);
  }
  return result;
}

}  // namespace roomtex
