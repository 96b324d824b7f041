#include "capture/calibration/board_detection.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <utility>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "capture/calibration/board_charuco.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/output_file.h"
#include "core/parallel.h"
#include "core/photo.h"

namespace roomtex {
namespace fs = std::filesystem;
namespace {

// Boards are looked for in photos reduced to this long side first, then in larger ones for boards
// far away; corners are always refined in the photo itself.
constexpr int kLongSides[] = {1400, 2800};
// Window of the refinement: as far from the corner as this share of the distance to the next one.
// Nearer to 0.5 the next corner's edges come in where the board is seen at a slant.
constexpr double kCheckerboardShare = 0.35;
constexpr int kMaxHalfWindow = 15;  // pixels; more pixels of an edge add little but time
// A board of another size is believed from this many corners each way on: fewer appear by chance.
constexpr int kMinOtherCorners = 4;

cv::Size SizeOf(const Board& board) { return {board.columns, board.rows}; }

cv::Mat Reduced(const cv::Mat& gray, int long_side) {
  const int longest = std::max(gray.cols, gray.rows);
  if (longest <= long_side) return gray;
  const double factor = static_cast<double>(long_side) / longest;
  cv::Mat reduced;
  cv::resize(gray, reduced, {}, factor, factor, cv::INTER_AREA);
  return reduced;
}

// Pixels of an edge, the mean over the board's edges.
double EdgeWidth(const cv::Mat& gray, const Board& board, const std::vector<cv::Point2f>& corners) {
  try {
    const double width = cv::estimateChessboardSharpness(gray, SizeOf(board), corners)[0];
    return std::isfinite(width) && width > 0 ? width : 0;
  } catch (const cv::Exception&) {
    return 0;
  }
}

// Distance from each corner to its nearest neighbour in the grid.
std::vector<double> Spacings(const Board& board, const Eigen::Matrix2Xd& x) {
  std::vector<double> spacings;
  for (int id = 0; id < board.NumCorners(); ++id) {
    const int column = id % board.columns, row = id / board.columns;
    double nearest = std::numeric_limits<double>::infinity();
    const auto look_at = [&](int c, int r) {
      if (c < 0 || r < 0 || c >= board.columns || r >= board.rows) return;
      nearest = std::min(nearest, (x.col(id) - x.col(r * board.columns + c)).norm());
    };
    look_at(column - 1, row);
    look_at(column + 1, row);
    look_at(column, row - 1);
    look_at(column, row + 1);
    spacings.push_back(nearest);
  }
  return spacings;
}

// The corners that the refinement kept.
void KeepFinite(const Eigen::Matrix2Xd& x_in_img, BoardPhoto* photo) {
  photo->x_in_img.resize(2, x_in_img.cols());
  for (int id = 0; id < x_in_img.cols(); ++id) {
    if (!x_in_img.col(id).allFinite()) continue;
    photo->x_in_img.col(photo->NumCorners()) = x_in_img.col(id);
    photo->corner_ids.push_back(id);
  }
  photo->x_in_img.conservativeResize(2, photo->NumCorners());
}

struct Found {
  BoardPhoto photo;
  std::array<int, 2> other_size = {0, 0};
  CharucoLayout layout;
};

// A board of this size may be what a photo shows of the named one.
bool IsPartOf(const Board& board, const std::array<int, 2>& size) {
  return std::max(size[0], size[1]) <= std::max(board.columns, board.rows) &&
         std::min(size[0], size[1]) <= std::min(board.columns, board.rows);
}

void DetectCheckerboard(const cv::Mat& gray, const Board& board, Found* found) {
  BoardPhoto& photo = found->photo;
  for (const int long_side : kLongSides) {
    const cv::Mat reduced = Reduced(gray, long_side);
    const CheckerboardFinding finding = FindCheckerboard(reduced, board);
    if (finding.other_size[0] > 0) found->other_size = finding.other_size;
    if (!finding.corners.empty()) {
      const Eigen::Vector2d factor(static_cast<double>(gray.cols) / reduced.cols,
                                   static_cast<double>(gray.rows) / reduced.rows);
      Eigen::Matrix2Xd x_in_img(2, board.NumCorners());
      for (int id = 0; id < board.NumCorners(); ++id) {
        const cv::Point2f& corner = finding.corners[id];
        x_in_img.col(id) = ImgFromOpenCv({corner.x, corner.y}).cwiseProduct(factor);
      }
      RefineCorners(gray, Spacings(board, x_in_img), kCheckerboardShare, &x_in_img);
      KeepFinite(x_in_img, &photo);
      photo.edge_width_px = EdgeWidth(reduced, board, finding.corners) * factor.x();
      found->other_size = {0, 0};
      return;
    }
    if (reduced.cols == gray.cols) break;
  }
  photo.reason = "no " + board.Name() + " was found";
  if (found->other_size[0] > 0) {
    photo.reason += ", but one of " + std::to_string(found->other_size[0]) + "x" +
                    std::to_string(found->other_size[1]);
    if (IsPartOf(board, found->other_size)) photo.reason += ", as if it hangs out of the picture";
  }
}

void DetectCharuco(const cv::Mat& gray, const Board& board, Found* found) {
  BoardPhoto& photo = found->photo;
  const cv::Mat reduced = Reduced(gray, kLongSides[1]);
  const double factor = static_cast<double>(gray.cols) / reduced.cols;
  const std::vector<MarkerSighting> markers = FindMarkers(reduced, board.dictionary, factor);
  const CharucoCorners corners = LocateCharucoCorners(board, markers);
  found->layout = corners.layout;
  if (!corners.reason.empty()) {
    photo.reason = corners.reason;
    return;
  }
  Eigen::Matrix2Xd x_in_img = corners.x_in_img;
  // The window must not reach the markers.
  const double share = 0.9 * (board.square - board.marker) / 2 / board.square;
  RefineCorners(gray, corners.spacing_px, share, &x_in_img);
  KeepFinite(x_in_img, &photo);
}

Found LookAt(const std::string& folder, const std::string& name, const Board& board) {
  Found found;
  found.photo.name = name;
  try {
    const cv::Mat image = ReadPhoto((fs::path(folder) / name).string());
    cv::Mat gray;
    cv::cvtColor(image, gray, cv::COLOR_BGR2GRAY);
    found.photo.width = gray.cols;
    found.photo.height = gray.rows;
    if (board.type == BoardType::kCheckerboard) {
      DetectCheckerboard(gray, board, &found);
    } else {
      DetectCharuco(gray, board, &found);
    }
  } catch (const InputError& error) {
    found.photo.reason = std::string("cannot be read: ") + error.what();
  } catch (const cv::Exception& error) {
    found.photo.reason = "the search for the board failed in OpenCV (" + error.err + ")";
  }
  return found;
}

void CheckSizes(const std::string& folder, const std::vector<std::string>& names,
                const std::vector<std::array<int, 2>>& sizes) {
  std::map<std::array<int, 2>, std::vector<std::string>> by_size;
  for (size_t i = 0; i < names.size(); ++i) {
    if (sizes[i][0] > 0) by_size[sizes[i]].push_back(names[i]);
  }
  if (by_size.size() < 2) return;
  constexpr int kNamed = 5;
  std::string finding = "the photos are not all of one size: ";
  bool turned = false;
  int named = 0;
  for (const auto& [size, with_it] : by_size) {
    turned = turned || (size[0] != size[1] && by_size.count({size[1], size[0]}) > 0);
    if (named++ >= kNamed) continue;
    finding += std::to_string(with_it.size()) + " of " + std::to_string(size[0]) + "x" +
               std::to_string(size[1]) + " (" + with_it[0] + "), ";
  }
  finding.resize(finding.size() - 2);
  if (named > kNamed) finding += " and " + std::to_string(named - kNamed) + " sizes more";
  throw InputError(folder, "", finding,
                   turned
                       ? "A program turned the upright ones; take the files as the camera stored "
                         "them, or calibrate each kind by itself"
                       : "One camera at one zoom and one resolution is calibrated at a time: move "
                         "the others to a folder of their own");
}

// What to say when the board is not in the photos.
[[noreturn]] void FailWithoutBoards(const std::string& folder, const Board& board,
                                    const std::vector<Found>& found) {
  std::map<std::array<int, 2>, int> others;
  std::map<std::string, int> reasons;
  int num_unreadable = 0;
  for (const Found& one : found) {
    if (one.other_size[0] > 0) ++others[one.other_size];
    if (one.photo.width == 0) ++num_unreadable;
    ++reasons[one.photo.reason];
  }
  const std::string count = std::to_string(found.size());
  if (num_unreadable == static_cast<int>(found.size())) {
    throw InputError(
        folder, "",
        "none of its " + count + " photos can be read; the first: " + found[0].photo.reason,
        "Copy them again from the camera");
  }
  if (!others.empty()) {
    const auto most =
        std::max_element(others.begin(), others.end(),
                         [](const auto& a, const auto& b) { return a.second < b.second; });
    const auto [columns, rows] = most->first;
    const std::string size = std::to_string(columns) + "x" + std::to_string(rows);
    const bool counted_squares = board.columns == columns + 1 && board.rows == rows + 1;
    throw InputError(folder, "",
                     "the " + board.Name() + " that --board names is not there; " +
                         std::to_string(most->second) + " of " + count + " photos show one of " +
                         size,
                     "Give --board " + size +
                         (counted_squares ? ": the inner corners are counted, where four squares "
                                            "meet, not the squares"
                                          : ""));
  }
  std::string finding = "the " + board.Name() + " was found in none of the " + count + " photos";
  std::string remedy =
      "Count the inner corners, where four squares meet (a board of 10x7 squares is --board 9x6); "
      "the whole board with a white margin must be in the photo, lit evenly and sharp";
  if (board.type == BoardType::kCharuco) {
    const auto most =
        std::max_element(reasons.begin(), reasons.end(),
                         [](const auto& a, const auto& b) { return a.second < b.second; });
    finding += "; most often: " + most->first;
    remedy = "Check --board (squares), --dictionary and --marker";
    for (const Found& one : found) {
      if (one.photo.width == 0) continue;
      const std::string other = FindOtherDictionary(
          Reduced(ReadPhoto((fs::path(folder) / one.photo.name).string()), kLongSides[0]),
          board.dictionary);
      if (!other.empty()) remedy = "Markers of " + other + " are there: give --dictionary " + other;
      break;
    }
  }
  throw InputError(folder, "", finding, remedy);
}

// A ChArUco board has one layout: photos that seem to show another do not show this board.
void AgreeOnLayout(std::vector<Found>* found) {
  std::map<std::pair<bool, bool>, int> votes;
  const auto key = [](const Found& f) {
    return std::make_pair(f.layout.upper_left_is_black, f.layout.transposed);
  };
  for (const Found& one : *found) {
    if (one.photo.reason.empty()) votes[key(one)] += one.photo.NumCorners();
  }
  const auto most = std::max_element(
      votes.begin(), votes.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  for (Found& one : *found) {
    if (!one.photo.reason.empty() || key(one) == most->first) continue;
    one.photo.reason = "its markers are arranged in another way than in most photos";
    one.photo.corner_ids.clear();
    one.photo.x_in_img.resize(2, 0);
  }
}

}  // namespace

CheckerboardFinding FindCheckerboard(const cv::Mat& gray, const Board& board) {
  CheckerboardFinding finding;
  const cv::Size size = SizeOf(board);
  if (std::min(gray.cols, gray.rows) < 30) return finding;
  // Radon-based; finds boards of exactly this size only. Its positions are refined afterwards, so
  // that it need not enlarge the photo for accuracy.
  const int flags = cv::CALIB_CB_NORMALIZE_IMAGE;
  for (const int more : {0, static_cast<int>(cv::CALIB_CB_EXHAUSTIVE)}) {
    if (cv::findChessboardCornersSB(gray, size, finding.corners, flags | more)) return finding;
  }
  // The older way is content with a part of a larger board: look for that one first.
  cv::Mat meta;
  std::vector<cv::Point2f> ignored;
  if (cv::findChessboardCornersSB(gray, {kMinOtherCorners, kMinOtherCorners}, ignored,
                                  flags | cv::CALIB_CB_EXHAUSTIVE | cv::CALIB_CB_LARGER, meta)) {
    std::array<int, 2> other = {meta.cols, meta.rows};
    if ((board.columns >= board.rows) == (other[0] < other[1])) std::swap(other[0], other[1]);
    const bool smaller = other[0] <= board.columns && other[1] <= board.rows;
    finding.other_size = other;
    if (!smaller) {
      finding.corners.clear();
      return finding;
    }
  }
  finding.corners.clear();
  if (cv::findChessboardCorners(
          gray, size, finding.corners,
          cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK)) {
    finding.other_size = {0, 0};
    return finding;
  }
  finding.corners.clear();
  return finding;
}

void RefineCorners(const cv::Mat& gray, const std::vector<double>& spacing_px, double share,
                   Eigen::Matrix2Xd* x_in_img) {
  const cv::TermCriteria stop(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 100, 1e-4);
  const auto nan = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  for (int i = 0; i < x_in_img->cols(); ++i) {
    if (!x_in_img->col(i).allFinite()) continue;
    const int half =
        std::clamp(static_cast<int>(std::floor(spacing_px[i] * share)), 2, kMaxHalfWindow);
    const Eigen::Vector2d start = OpenCvFromImg(x_in_img->col(i));
    const bool inside = start.x() > half + 1 && start.y() > half + 1 &&
                        start.x() < gray.cols - half - 2 && start.y() < gray.rows - half - 2;
    if (!inside) {
      x_in_img->col(i) = nan;
      continue;
    }
    const cv::Point2f before(static_cast<float>(start.x()), static_cast<float>(start.y()));
    std::vector<cv::Point2f> corner = {before};
    cv::cornerSubPix(gray, corner, {half, half}, {-1, -1}, stop);
    // Where it ends outside the window OpenCV gives the start back.
    x_in_img->col(i) =
        corner[0] == before ? Eigen::Vector2d(nan) : ImgFromOpenCv({corner[0].x, corner[0].y});
  }
}

std::vector<BoardPhoto> FindBoards(const std::string& folder, const std::vector<std::string>& names,
                                   const Board& board, int num_threads, Progress* progress) {
  const int count = static_cast<int>(names.size());
  std::vector<std::array<int, 2>> sizes;
  for (const std::string& name : names) {
    sizes.push_back(ReadPhotoSize((fs::path(folder) / name).string()));
  }
  CheckSizes(folder, names, sizes);
  std::vector<Found> found(names.size());
  ParallelFor(num_threads, 0, count, [&](int i) {
    found[i] = LookAt(folder, names[i], board);
    progress->Tick();
  });
  for (int i = 0; i < count; ++i) sizes[i] = {found[i].photo.width, found[i].photo.height};
  CheckSizes(folder, names, sizes);
  int num_with_board = 0, num_with_other = 0;
  for (const Found& one : found) {
    num_with_board += one.photo.reason.empty();
    num_with_other += one.other_size[0] > 0 && !IsPartOf(board, one.other_size);
  }
  if (num_with_board == 0 || num_with_other > num_with_board) {
    FailWithoutBoards(folder, board, found);
  }
  if (board.type == BoardType::kCharuco) AgreeOnLayout(&found);
  std::vector<BoardPhoto> photos;
  for (Found& one : found) photos.push_back(std::move(one.photo));
  return photos;
}

}  // namespace roomtex
