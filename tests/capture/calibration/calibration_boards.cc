#include "tests/capture/calibration/calibration_boards.h"

#include <algorithm>
#include <cmath>

#include <opencv2/aruco.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/output_file.h"
#include "core/parallel.h"
#include "core/photo.h"
#include "core/random_stream.h"

namespace roomtex {
namespace {

constexpr double kStep = 2;     // pixels between tabulated rays
constexpr double kBorder = 10;  // pixels outside the picture that have rays too

// Light of the plane at a place (squares; first inner corner at the origin).
class Pattern {
 public:
  Pattern(const Board& board, const BoardPhotoOptions& options)
      : board_(board),
        stretch_(options.stretch),
        upper_left_is_black_(options.upper_left_is_black) {
    if (board.type != BoardType::kCharuco) return;
    const auto dictionary = cv::aruco::getPredefinedDictionary(board.dictionary);
    num_bits_ = dictionary->markerSize + 2;
    const int num_squares = (board.columns + 1) * (board.rows + 1);
    for (int id = 0; id <= num_squares / 2; ++id) {
      cv::Mat marker;
      cv::aruco::drawMarker(dictionary, id, num_bits_, marker);
      markers_.push_back(marker);
    }
    int id = 0;
    for (int i = 0; i < num_squares; ++i) {
      marker_of_square_.push_back(IsBlack(i % (board.columns + 1), i / (board.columns + 1)) ? -1
                                                                                            : id++);
    }
  }

  double Light(double u, double v) const {
    const double x = u / stretch_ + 1, y = v + 1;  // from the outer corner of the first square
    const double columns = board_.columns + 1, rows = board_.rows + 1;
    if (x < -0.8 || y < -0.8 || x > columns + 0.8 || y > rows + 0.8) {
      return 0.18 + 0.08 * std::sin(0.7 * u + 0.4 * v) + 0.05 * std::sin(2.3 * v);
    }
    if (x < 0 || y < 0 || x >= columns || y >= rows) return kWhite;
    const int column = static_cast<int>(x), row = static_cast<int>(y);
    if (IsBlack(column, row)) return kBlack;
    if (marker_of_square_.empty()) return kWhite;
    const double side = board_.marker / board_.square;
    const double mx = (x - column - 0.5) / side + 0.5, my = (y - row - 0.5) / side + 0.5;
    if (mx < 0 || my < 0 || mx >= 1 || my >= 1) return kWhite;
    const cv::Mat& marker = markers_[marker_of_square_[row * (board_.columns + 1) + column]];
    return marker.at<uint8_t>(static_cast<int>(my * num_bits_), static_cast<int>(mx * num_bits_)) >
                   0
               ? kWhite
               : kBlack;
  }

 private:
  static constexpr double kWhite = 0.75, kBlack = 0.03;
  bool IsBlack(int column, int row) const {
    return ((column + row) % 2 == 0) == upper_left_is_black_;
  }
  const Board& board_;
  double stretch_;
  bool upper_left_is_black_;
  int num_bits_ = 0;
  std::vector<cv::Mat> markers_;
  std::vector<int> marker_of_square_;
};

// Mean over a pixel by samples no two of which share a row or a column, shifted from pixel to
// pixel: a square grid of samples would move edges that run along the pixels by up to half its
// step, everywhere the same way.
template <typename Light>
double MeanOverPixel(const Light& light_at, int x, int y) {
  constexpr int kSamples = 25;
  const uint64_t bits = MixBits(static_cast<uint64_t>(x), static_cast<uint64_t>(y));
  const double shift_x = static_cast<double>(bits & 0xffff) / 0x10000;
  const double shift_y = static_cast<double>(bits >> 16 & 0xffff) / 0x10000;
  double sum = 0;
  for (int k = 0; k < kSamples; ++k) {
    const double u = (k + shift_x) / kSamples, v = (k * 7 % kSamples + shift_y) / kSamples;
    sum += light_at(x + u, y + v);
  }
  return sum / kSamples;
}

// All corners of the board with half a square around are in the picture.
bool IsInside(const CameraProjection& projection, const Board& board, const Rigid& cam_from_board) {
  for (const double x : {-1.5, board.columns + 0.5}) {
    for (const double y : {-1.5, board.rows + 0.5}) {
      const auto seen = projection.ImgFromCam(
          cam_from_board * Eigen::Vector3d(x * board.square, y * board.square, 0));
      if (!seen || !projection.InImage(*seen)) return false;
    }
  }
  return true;
}

}  // namespace

Board Checkerboard(int columns, int rows) {
  BoardOptions options;
  options.size = std::to_string(columns) + "x" + std::to_string(rows);
  return MakeBoard(options);
}

Camera LensThatCallsFor(CameraModel model, int width, int height) {
  Camera camera;
  camera.camera_id = 1;
  camera.model = model;
  camera.width = width;
  camera.height = height;
  const double f = 0.69 * width, cx = 0.507 * width, cy = 0.489 * height;
  switch (model) {
    case CameraModel::kSimpleRadial:
      camera.params = {f, cx, cy, -0.12};
      break;
    case CameraModel::kRadial:
      camera.params = {f, cx, cy, -0.18, 0.07};
      break;
    case CameraModel::kOpenCv:
      camera.params = {f, 1.003 * f, cx, cy, -0.18, 0.07, 0.0012, -0.0009};
      break;
    default:
      camera.model = CameraModel::kFullOpenCv;
      camera.params = {f, 1.002 * f, cx, cy, -0.25, 0.15, 0.0008, -0.0006, -0.05, 0, 0, 0};
  }
  return camera;
}

std::vector<Rigid> MakeBoardPoses(const Camera& camera, const Board& board,
                                  const BoardSetOptions& options) {
  const CameraProjection projection(camera);
  RandomStream random(MixBits(options.seed, 4711));
  const Eigen::Vector3d middle((board.columns - 1) * board.square / 2,
                               (board.rows - 1) * board.square / 2, 0);
  const Eigen::Vector2d places[] = {{0, 0}, {1, 1}, {-1, -1}, {1, -1}, {-1, 1},
                                    {0, 1}, {1, 0}, {0, -1},  {-1, 0}};
  std::vector<Rigid> poses;
  while (static_cast<int>(poses.size()) < options.num_photos) {
    const double direction = random.Uniform(0, 2 * kPi);
    const double tilt = RadFromDeg(options.max_tilt_deg) * std::sqrt(random.Uniform());
    const double turn = random.Uniform(-0.3, 0.3) + (random.Index(4) == 0 ? kPi / 2 : 0);
    Rigid pose;
    pose.rotation =
        Eigen::AngleAxisd(tilt, Eigen::Vector3d(std::cos(direction), std::sin(direction), 0)) *
        Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ());
    const double wide = (board.columns + 1) * board.square;
    const double distance =
        camera.MeanFocalLength() * wide / (options.size * random.Uniform(0.8, 1.25) * camera.width);
    const Eigen::Vector2d corner(0.5 * camera.width / camera.MeanFocalLength(),
                                 0.5 * camera.height / camera.MeanFocalLength());
    const Eigen::Vector2d place = places[poses.size() % 9].cwiseProduct(corner);
    for (double share = options.reach * random.Uniform(0.9, 1.0); share > -0.05; share -= 0.04) {
      const Eigen::Vector2d at = std::max(share, 0.0) * place;
      const Eigen::Vector3d centre = distance * Eigen::Vector3d(at.x(), at.y(), 1);
      pose.translation = centre - pose.rotation * middle;
      if (options.whole && !IsInside(projection, board, pose)) continue;
      poses.push_back(pose);
      break;
    }
  }
  return poses;
}

double BowedHeight(const Board& board, const Eigen::Vector2d& x_on_board, double bow, int power) {
  const double half = (board.columns - 1) * board.square / 2;
  return bow * (1 - std::pow(x_on_board.x() / half - 1, power));
}

std::vector<BoardPhoto> ObserveBoards(const Camera& camera, const Board& board,
                                      const std::vector<Rigid>& cam_from_board, double noise_px,
                                      uint64_t seed, double bow, int power) {
  const CameraProjection projection(camera);
  std::vector<BoardPhoto> photos;
  for (size_t i = 0; i < cam_from_board.size(); ++i) {
    RandomStream random(MixBits(seed, 99, i));
    BoardPhoto photo;
    photo.name = "photo_" + std::to_string(i);
    photo.width = camera.width;
    photo.height = camera.height;
    photo.x_in_img.resize(2, board.NumCorners());
    for (int id = 0; id < board.NumCorners(); ++id) {
      const Eigen::Vector2d x = board.CornerOnBoard(id);
      const double height = BowedHeight(board, x, bow, power);
      const auto seen =
          projection.ImgFromCam(cam_from_board[i] * Eigen::Vector3d(x.x(), x.y(), -height));
      const Eigen::Vector2d noise(random.Gaussian(), random.Gaussian());
      if (!seen || !projection.InImage(*seen)) continue;
      photo.x_in_img.col(photo.NumCorners()) = *seen + noise_px * noise;
      photo.corner_ids.push_back(id);
    }
    photo.x_in_img.conservativeResize(2, photo.NumCorners());
    photos.push_back(photo);
  }
  return photos;
}

BoardRenderer::BoardRenderer(const Camera& camera) : camera_(camera) {
  const CameraProjection projection(camera);
  columns_ = static_cast<int>((camera.width + 2 * kBorder) / kStep) + 2;
  rows_ = static_cast<int>((camera.height + 2 * kBorder) / kStep) + 2;
  rays_.resize(static_cast<size_t>(columns_) * rows_);
  for (int r = 0; r < rows_; ++r) {
    for (int c = 0; c < columns_; ++c) {
      const auto ray = projection.CamFromImg({c * kStep - kBorder, r * kStep - kBorder});
      rays_[static_cast<size_t>(r) * columns_ + c] = ray ? *ray : Eigen::Vector2d(1e3, 1e3);
    }
  }
}

Eigen::Vector2d BoardRenderer::RayAt(double x, double y) const {
  const double c = (x + kBorder) / kStep, r = (y + kBorder) / kStep;
  const int column = static_cast<int>(c), row = static_cast<int>(r);
  const double a = c - column, b = r - row;
  const Eigen::Vector2d* const upper = &rays_[static_cast<size_t>(row) * columns_ + column];
  const Eigen::Vector2d* const lower = upper + columns_;
  return (1 - b) * ((1 - a) * upper[0] + a * upper[1]) + b * ((1 - a) * lower[0] + a * lower[1]);
}

cv::Mat BoardRenderer::Render(const Board& board, const Rigid& cam_from_board,
                              const BoardPhotoOptions& options) const {
  const Pattern pattern(board, options);
  Eigen::Matrix3d ray_from_board;
  ray_from_board << cam_from_board.rotation.toRotationMatrix().leftCols<2>() * board.square,
      cam_from_board.translation;
  const Eigen::Matrix3d board_from_ray = ray_from_board.inverse();
  const Rigid board_from_cam = cam_from_board.Inverse();
  const auto light_at = [&](double x, double y) {
    const Eigen::Vector3d ray = RayAt(x, y).homogeneous();
    const Eigen::Vector3d at = board_from_ray * ray;
    if (options.bow == 0) return pattern.Light(at.x() / at.z(), at.y() / at.z());
    // Where the ray meets the bowed board: from the plane on, as often as its height changes.
    const Eigen::Vector3d from = board_from_cam * Eigen::Vector3d::Zero();
    const Eigen::Vector3d along = board_from_cam.rotation * ray;
    Eigen::Vector2d place = board.square * at.hnormalized();
    for (int round = 0; round < 5; ++round) {
      const double height = -BowedHeight(board, place, options.bow);
      place = (from + (height - from.z()) / along.z() * along).head<2>();
    }
    return pattern.Light(place.x() / board.square, place.y() / board.square);
  };
  const int width = camera_.width, height = camera_.height;
  cv::Mat at_corners(height + 1, width + 1, CV_32F);  // of the pixels
  for (int y = 0; y <= height; ++y) {
    for (int x = 0; x <= width; ++x) {
      at_corners.at<float>(y, x) = static_cast<float>(light_at(x, y));
    }
  }
  cv::Mat light(height, width, CV_32F);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto [low, high] =
          std::minmax({at_corners.at<float>(y, x), at_corners.at<float>(y, x + 1),
                       at_corners.at<float>(y + 1, x), at_corners.at<float>(y + 1, x + 1)});
      light.at<float>(y, x) =
          high - low < 0.02f ? (low + high) / 2 : static_cast<float>(MeanOverPixel(light_at, x, y));
    }
  }
  if (options.blur_px > 0) cv::GaussianBlur(light, light, {}, options.blur_px);
  RandomStream random(MixBits(options.seed, 31));
  cv::Mat photo(light.size(), CV_8U);
  for (int y = 0; y < light.rows; ++y) {
    for (int x = 0; x < light.cols; ++x) {
      const double grey =
          255 * SrgbFromLinear(light.at<float>(y, x)) + options.noise * random.Gaussian();
      photo.at<uint8_t>(y, x) = static_cast<uint8_t>(std::clamp(std::lround(grey), 0l, 255l));
    }
  }
  return photo;
}

std::vector<std::string> WriteBoardPhotos(const std::string& folder, const Camera& camera,
                                          const Board& board, const std::vector<Rigid>& poses,
                                          const BoardPhotoOptions& options) {
  MakeFolder(folder);
  const BoardRenderer renderer(camera);
  std::vector<std::string> names(poses.size());
  ParallelFor(-1, 0, static_cast<int>(poses.size()), [&](int i) {
    char name[40];
    std::snprintf(name, sizeof(name), "board_%03d.png", i);
    BoardPhotoOptions own = options;
    own.seed = MixBits(options.seed, static_cast<uint64_t>(i));
    cv::imwrite(folder + "/" + name, renderer.Render(board, poses[i], own));
    names[i] = name;
  });
  return names;
}

}  // namespace roomtex
