#pragma once
// ChArUco boards: markers tell which corners are seen (ArUco, Garrido-Jurado et al. 2014), so that
// a part of the board is enough. Used by board_detection only.

#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "capture/calibration/board_detection.h"

namespace roomtex {

// Markers of the dictionary (cv::aruco::PREDEFINED_DICTIONARY_NAME), one per id. factor: of the
// photo's size over that of `gray`.
std::vector<MarkerSighting> FindMarkers(const cv::Mat& gray, int dictionary, double factor);

// Name of another dictionary whose markers the photo shows; "" if none.
std::string FindOtherDictionary(const cv::Mat& image, int dictionary);

// Roughly where the corners of the board lie between two markers that were found; NaN for the
// others.
struct CharucoCorners {
  CharucoLayout layout;            // the one that fits the markers best
  Eigen::Matrix2Xd x_in_img;       // 2 x Board::NumCorners()
  std::vector<double> spacing_px;  // side of a square around each corner
  std::string reason;              // why there are none; "" = there are
};
CharucoCorners LocateCharucoCorners(const Board& board, const std::vector<MarkerSighting>& markers);

// Clockwise from the upper left: the corners of the marker `id` on a board of this layout,
// in metres of the board with its first INNER CORNER at the origin; empty if the board has no such
// marker. Ids count the white squares row by row.
std::vector<Eigen::Vector2d> MarkerOnBoard(const Board& board, const CharucoLayout& layout, int id);

}  // namespace roomtex
