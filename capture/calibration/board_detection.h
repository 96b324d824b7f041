#pragma once
// Finds the calibration board in photos (thesis 5.2).

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "capture/calibration/board.h"
#include "core/progress.h"

namespace roomtex {

// What one photo shows of the board.
struct BoardPhoto {
  std::string name;  // relative to the folder of the photos
  int width = 0, height = 0;
  std::vector<int> corner_ids;  // Board::CornerOnBoard
  Eigen::Matrix2Xd x_in_img;    // columns: the corners, in the order of corner_ids
  // Pixels that an edge between black and white takes from 10 to 90 %; 0 = not known.
  double edge_width_px = 0;
  std::string reason;  // why the photo cannot be used; empty when it can

  int NumCorners() const { return static_cast<int>(corner_ids.size()); }
};

// How a ChArUco board is laid out. Its programs disagree whether the upper left square is black,
// and a user may give the columns for the rows: the photos tell which.
struct CharucoLayout {
  bool upper_left_is_black = true;
  bool transposed = false;  // the board has Board::rows columns
};

// A checkerboard in one photo: all its inner corners, or none.
struct CheckerboardFinding {
  std::vector<cv::Point2f> corners;  // OpenCV's pixel convention, row by row
  // When the board is not there, another that is: inner corners both ways, {0, 0} = none.
  std::array<int, 2> other_size = {0, 0};
};
CheckerboardFinding FindCheckerboard(const cv::Mat& gray, const Board& board);

// The markers in one photo.
struct MarkerSighting {
  int id = 0;
  std::array<Eigen::Vector2d, 4> x_in_img;  // clockwise from its upper left corner
};

// Moves corners to the saddle of the brightness around them, at the full size of the photo.
// x_in_img: rough positions, good to a few hundredths of the distance to their neighbours;
// spacing_px: that distance; share: of it the window may reach from the corner. Corners that find
// no saddle near by become NaN.
void RefineCorners(const cv::Mat& gray, const std::vector<double>& spacing_px, double share,
                   Eigen::Matrix2Xd* x_in_img);

// Looks for the board in every photo; one BoardPhoto each, in the order of `names`. Photos are
// decoded as they are needed, num_threads at a time; the result does not depend on it. Throws
// InputError when the board is in none of them (and says what is there instead), when most of the
// photos show a board of another size, or when they are not all of the same size.
std::vector<BoardPhoto> FindBoards(const std::string& folder, const std::vector<std::string>& names,
                                   const Board& board, int num_threads, Progress* progress);

}  // namespace roomtex
