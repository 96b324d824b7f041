#include "capture/calibration/board_charuco.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "core/frames.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// Without a fourth marker the four layouts cannot be told apart.
constexpr int kMinMarkers = 4;
// Markers of the right layout miss their places by less than this share of a square, lens
// distortion included; those of a wrong one by about a square.
constexpr double kMaxMiss = 0.35;

// Which marker lies in which square.
struct MarkerTable {
  int columns = 0, rows = 0;                  // squares
  std::vector<int> id_of_square;              // -1 for black ones; row by row
  std::vector<std::array<int, 2>> square_of;  // column and row by id

  MarkerTable(const Board& board, const CharucoLayout& layout)
      : columns(layout.transposed ? board.rows + 1 : board.columns + 1),
        rows(layout.transposed ? board.columns + 1 : board.rows + 1) {
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column) {
        const bool even = (column + row) % 2 == 0;
        const bool white = even != layout.upper_left_is_black;
        id_of_square.push_back(white ? static_cast<int>(square_of.size()) : -1);
        if (white) square_of.push_back({column, row});
      }
    }
  }
};

cv::Point2f ToCv(const Eigen::Vector2d& x) {
  return {static_cast<float>(x.x()), static_cast<float>(x.y())};
}

std::vector<Eigen::Vector2d> CornersOnBoard(const Board& board, const MarkerTable& table, int id) {
  if (id < 0 || id >= static_cast<int>(table.square_of.size())) return {};
  const auto [column, row] = table.square_of[id];
  const Eigen::Vector2d first =
      (Eigen::Vector2d(column, row) - Eigen::Vector2d(0.5, 0.5)) * board.square -
      Eigen::Vector2d(board.marker, board.marker) / 2;
  const double m = board.marker;
  return {first, first + Eigen::Vector2d(m, 0), first + Eigen::Vector2d(m, m),
          first + Eigen::Vector2d(0, m)};
}

struct Fit {
  explicit Fit(const MarkerTable& of) : table(of) {}
  MarkerTable table;
  double miss = std::numeric_limits<double>::infinity();  // median over markers, squares
  std::map<int, const MarkerSighting*> markers;           // those of the board
};

// How well one homography takes the layout to the photo; the miss is measured on the board.
Fit FitLayout(const Board& board, const CharucoLayout& layout,
              const std::vector<MarkerSighting>& markers) {
  Fit fit(MarkerTable(board, layout));
  std::vector<cv::Point2f> on_board, in_img;
  for (const MarkerSighting& marker : markers) {
    const std::vector<Eigen::Vector2d> corners = CornersOnBoard(board, fit.table, marker.id);
    if (corners.empty()) continue;
    fit.markers[marker.id] = &marker;
    for (int k = 0; k < 4; ++k) {
      on_board.push_back(ToCv(corners[k] / board.square));
      in_img.push_back(ToCv(marker.x_in_img[k]));
    }
  }
  if (static_cast<int>(fit.markers.size()) < kMinMarkers) return fit;
  // From the photo to the board; its tolerance lets a strong lens distortion pass.
  const cv::Mat homography = cv::findHomography(in_img, on_board, cv::RANSAC, kMaxMiss);
  if (homography.empty()) return fit;
  std::vector<cv::Point2f> mapped;
  cv::perspectiveTransform(in_img, mapped, homography);
  std::vector<double> misses;
  for (size_t i = 0; i < mapped.size(); ++i) misses.push_back(cv::norm(mapped[i] - on_board[i]));
  fit.miss = Median(&misses);
  return fit;
}

// How many columns of squares the markers are arranged in; 0 if no number fits.
int FindColumns(const Board& board, const std::vector<MarkerSighting>& markers) {
  int largest = 0;
  for (const MarkerSighting& marker : markers) largest = std::max(largest, marker.id);
  double least = kMaxMiss;
  int found = 0;
  Board other = board;
  for (int columns = 3; columns <= std::min(40, 2 * largest + 2); ++columns) {
    other.columns = columns - 1;
    other.rows = 2 * (largest + 1) / columns + 1;  // enough for all markers
    for (const bool black : {true, false}) {
      const double miss = FitLayout(other, {black, false}, markers).miss;
      if (!(miss < least)) continue;
      least = miss;
      found = columns;
    }
  }
  return found;
}

// The photo's position of an inner corner from the two markers beside it; none if one is missing.
bool PlaceCorner(const Board& board, const Fit& fit, int column, int row, Eigen::Vector2d* x_in_img,
                 double* spacing_px) {
  std::vector<cv::Point2f> on_board, in_img;
  for (const auto& [dc, dr] : {std::pair{0, 0}, {1, 0}, {0, 1}, {1, 1}}) {
    const int square = (row + dr) * fit.table.columns + column + dc;
    const auto marker = fit.markers.find(fit.table.id_of_square[square]);
    if (marker == fit.markers.end()) continue;
    const std::vector<Eigen::Vector2d> corners = CornersOnBoard(board, fit.table, marker->first);
    for (int k = 0; k < 4; ++k) {
      on_board.push_back(ToCv(corners[k] / board.square));
      in_img.push_back(ToCv(marker->second->x_in_img[k]));
    }
  }
  if (in_img.size() < 8) return false;
  const cv::Mat homography = cv::findHomography(on_board, in_img);
  if (homography.empty()) return false;
  const float c = static_cast<float>(column), r = static_cast<float>(row);
  std::vector<cv::Point2f> cross = {
      {c, r}, {c - 0.5f, r}, {c + 0.5f, r}, {c, r - 0.5f}, {c, r + 0.5f}};
  std::vector<cv::Point2f> mapped;
  cv::perspectiveTransform(cross, mapped, homography);
  *x_in_img = {mapped[0].x, mapped[0].y};
  *spacing_px = std::min(cv::norm(mapped[1] - mapped[2]), cv::norm(mapped[3] - mapped[4]));
  return x_in_img->allFinite() && *spacing_px > 0;
}

}  // namespace

std::vector<MarkerSighting> FindMarkers(const cv::Mat& gray, int dictionary, double factor) {
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  auto parameters = cv::aruco::DetectorParameters::create();
  // Markers may be small where the board is far away; a window per size of board costs time only.
  parameters->minMarkerPerimeterRate = 0.01;
  parameters->adaptiveThreshWinSizeMax = 53;
  cv::aruco::detectMarkers(gray, cv::aruco::getPredefinedDictionary(dictionary), corners, ids,
                           parameters);
  std::map<int, int> count;
  for (const int id : ids) ++count[id];
  std::vector<MarkerSighting> markers;
  for (size_t i = 0; i < ids.size(); ++i) {
    if (count[ids[i]] > 1) continue;  // one of them is none of the board
    MarkerSighting marker;
    marker.id = ids[i];
    for (int k = 0; k < 4; ++k) {
      marker.x_in_img[k] = factor * ImgFromOpenCv({corners[i][k].x, corners[i][k].y});
    }
    markers.push_back(marker);
  }
  return markers;
}

std::string FindOtherDictionary(const cv::Mat& image, int dictionary) {
  const std::vector<std::string> names = BoardOptions::Dictionaries();
  std::string best;
  size_t most = kMinMarkers - 1;
  for (int i = 0; i < static_cast<int>(names.size()); ++i) {
    if (i == dictionary) continue;
    const size_t count = FindMarkers(image, i, 1).size();
    if (count <= most) continue;
    most = count;
    best = names[i];
  }
  return best;
}

std::vector<Eigen::Vector2d> MarkerOnBoard(const Board& board, const CharucoLayout& layout,
                                           int id) {
  return CornersOnBoard(board, MarkerTable(board, layout), id);
}

CharucoCorners LocateCharucoCorners(const Board& board,
                                    const std::vector<MarkerSighting>& markers) {
  CharucoCorners result;
  result.x_in_img =
      Eigen::Matrix2Xd::Constant(2, board.NumCorners(), std::numeric_limits<double>::quiet_NaN());
  result.spacing_px.assign(board.NumCorners(), 0);
  if (static_cast<int>(markers.size()) < kMinMarkers) {
    result.reason = markers.empty()
                        ? "no markers were found"
                        : "only " + std::to_string(markers.size()) + " markers were found, " +
                              std::to_string(kMinMarkers) + " are needed";
    return result;
  }
  Fit best(MarkerTable(board, {}));
  for (const bool black : {true, false}) {
    for (const bool transposed : {false, true}) {
      const CharucoLayout layout{black, transposed};
      const Fit fit = FitLayout(board, layout, markers);
      if (!(fit.miss < best.miss)) continue;
      best = fit;
      result.layout = layout;
    }
  }
  if (!(best.miss < kMaxMiss)) {
    int largest = 0;
    for (const MarkerSighting& marker : markers) largest = std::max(largest, marker.id);
    result.reason = std::to_string(markers.size()) + " markers with ids up to " +
                    std::to_string(largest) + " were found, but they are not arranged as on a " +
                    board.Name();
    const int columns = FindColumns(board, markers);
    if (columns > 0) {
      result.reason += ", but as on one of " + std::to_string(columns) + " columns";
    }
    return result;
  }
  int count = 0;
  for (int row = 0; row + 1 < best.table.rows; ++row) {
    for (int column = 0; column + 1 < best.table.columns; ++column) {
      // Corners keep the ids of the board as it was named. A transposed one becomes its mirror
      // image: for the camera a plane with exchanged axes is the same plane seen from behind.
      const int id =
          result.layout.transposed ? column * board.columns + row : row * board.columns + column;
      Eigen::Vector2d x_in_img;
      if (!PlaceCorner(board, best, column, row, &x_in_img, &result.spacing_px[id])) {
        continue;
      }
      result.x_in_img.col(id) = x_in_img;
      ++count;
    }
  }
  if (count < 6)
    result.reason =
        "only " + std::to_string(count) + " corners lie between markers that were found";
  return result;
}

}  // namespace roomtex
