#pragma once
// The calibration board (thesis 5.2): which corners it has and where they lie on it.
//
// Frame `board`: metres, origin in the first inner corner, x along a row of corners, y along a
// column, z = 0 on a flat board (calibration_fit.h: one that is not).

#include <string>
#include <vector>

#include <Eigen/Core>

namespace roomtex {

class OptionFields;

enum class BoardType { kCheckerboard, kCharuco };

struct BoardOptions {
  std::string type = "checkerboard";  // or "charuco"
  // "9x6": inner corners per row and column of a checkerboard (where four squares meet); squares
  // per row and column of a ChArUco board, as the programs that print them count.
  std::string size;
  double square = 0.025;  // metres, side of a square; the intrinsics do not depend on it
  double marker = 0;      // metres, side of a ChArUco marker (with its black border)
  std::string dictionary = "DICT_4X4_50";  // of the ChArUco markers, OpenCV's name

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
  static std::vector<std::string> Types() { return {"checkerboard", "charuco"}; }
  static std::vector<std::string> Dictionaries();  // OpenCV's names
};

struct Board {
  BoardType type = BoardType::kCheckerboard;
  int columns = 0, rows = 0;  // inner corners
  double square = 0;          // metres
  double marker = 0;          // metres
  int dictionary = 0;         // cv::aruco::PREDEFINED_DICTIONARY_NAME

  int NumCorners() const { return columns * rows; }
  // id = row * columns + column
  Eigen::Vector2d CornerOnBoard(int id) const {
    return {id % columns * square, id / columns * square};
  }
  // "checkerboard of 9x6 inner corners", "ChArUco board of 10x7 squares"
  std::string Name() const;
};

// options must have no Problems().
Board MakeBoard(const BoardOptions& options);

}  // namespace roomtex
