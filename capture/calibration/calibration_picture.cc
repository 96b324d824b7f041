#include "capture/calibration/calibration_picture.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include "core/text.h"

namespace roomtex {
namespace {

constexpr int kFrame = 1200;  // longer side of the photos' frame in the picture
constexpr int kMargin = 50;
constexpr int kLine = 26;         // height of a line of text
constexpr int kShift = 4;         // binary digits of subpixel positions handed to OpenCV
constexpr size_t kMaxLines = 12;  // photos left out that are listed
const cv::Scalar kInk(40, 40, 40), kGrey(150, 150, 150), kRed(40, 40, 220), kDot(170, 90, 20);

struct Cell {
  int num_corners = 0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();  // of residuals
};

cv::Point Fixed(const Eigen::Vector2d& x) {
  return {static_cast<int>(std::lround(x.x() * (1 << kShift))),
          static_cast<int>(std::lround(x.y() * (1 << kShift)))};
}

class CalibrationDrawing {
 public:
  explicit CalibrationDrawing(const Calibration& calibration)
      : calibration_(calibration),
        scale_(1.0 * kFrame / std::max(calibration.camera.width, calibration.camera.height)),
        width_(static_cast<int>(std::lround(calibration.camera.width * scale_))),
        height_(static_cast<int>(std::lround(calibration.camera.height * scale_))) {
    WriteLines();
    picture_ = cv::Mat(height_ + 2 * kMargin + kLine * static_cast<int>(lines_.size()) + 20,
                       std::max(width_, 900) + 2 * kMargin, CV_8UC3, cv::Scalar::all(255));
  }

  cv::Mat Draw() {
    DrawCells();
    DrawCorners();
    DrawArrows();
    cv::rectangle(picture_, {kMargin, kMargin}, {kMargin + width_, kMargin + height_}, kInk, 1);
    DrawText();
    return picture_;
  }

 private:
  Eigen::Vector2d InPicture(const Eigen::Vector2d& x_in_img) const {
    return x_in_img * scale_ + Eigen::Vector2d(kMargin, kMargin);
  }

  void DrawCells() {
    const Coverage& coverage = calibration_.coverage;
    cells_.assign(coverage.num_corners.size(), {});
    for (const CalibratedPhoto& photo : calibration_.photos) {
      if (!photo.used) continue;
      for (int i = 0; i < photo.x_in_img.cols(); ++i) {
        if (!photo.corner_used[i]) continue;
        const int column =
            CellOf(photo.x_in_img(0, i), calibration_.camera.width, coverage.columns);
        const int row = CellOf(photo.x_in_img(1, i), calibration_.camera.height, coverage.rows);
        Cell& cell = cells_[row * coverage.columns + column];
        ++cell.num_corners;
        cell.sum += photo.residuals.col(i);
      }
    }
    for (int i = 0; i < static_cast<int>(cells_.size()); ++i) {
      // Half of the blue is reached by ten corners.
      const double n = cells_[i].num_corners;
      const double strength = 0.75 * n / (n + 10);
      const cv::Scalar color(255 - 30 * strength, 255 - 110 * strength, 255 - 190 * strength);
      cv::rectangle(picture_, Area(i), color, cv::FILLED);
      cv::rectangle(picture_, Area(i), cv::Scalar::all(225), 1);
    }
  }

  static int CellOf(double x, double size, int count) {
    return std::clamp(static_cast<int>(x / size * count), 0, count - 1);
  }
  // The cell's rectangle in the picture.
  cv::Rect Area(int i) const {
    const Coverage& coverage = calibration_.coverage;
    const auto at = [&](int column, int row) {
      return cv::Point(
          kMargin + static_cast<int>(std::lround(1.0 * width_ * column / coverage.columns)),
          kMargin + static_cast<int>(std::lround(1.0 * height_ * row / coverage.rows)));
    };
    const int column = i % coverage.columns, row = i / coverage.columns;
    return {at(column, row), at(column + 1, row + 1)};
  }

  void DrawCorners() {
    for (const CalibratedPhoto& photo : calibration_.photos) {
      if (photo.x_in_img.cols() == 0) continue;
      for (int i = 0; i < photo.x_in_img.cols(); ++i) {
        const bool good = photo.used && photo.corner_used[i];
        cv::circle(picture_, Fixed(InPicture(photo.x_in_img.col(i))), (good ? 3 : 5) << kShift,
                   good ? kDot : kRed, good ? cv::FILLED : 1, cv::LINE_AA, kShift);
      }
      if (photo.used) continue;
      const Eigen::Vector2d first = InPicture(photo.x_in_img.rowwise().minCoeff());
      Write(photo.name, {static_cast<int>(first.x()), static_cast<int>(first.y()) - 10}, kRed);
    }
  }

  // How much residuals are enlarged, over the picture's own scale: 1, 2 or 5 times a power of ten,
  // so that a typical arrow of a cell is a third of the cell long.
  double Enlargement() const {
    std::vector<double> lengths;
    for (const Cell& cell : cells_) {
      if (cell.num_corners > 0) lengths.push_back(cell.sum.norm() / cell.num_corners);
    }
    if (lengths.empty()) return 1;
    std::sort(lengths.begin(), lengths.end());
    const double typical = lengths[lengths.size() * 3 / 4];
    const double wanted = width_ / (3.0 * calibration_.coverage.columns) / std::max(typical, 1e-6);
    const double power = std::pow(10, std::floor(std::log10(wanted)));
    for (const double step : {5.0, 2.0}) {
      if (wanted >= step * power) return step * power;
    }
    return power;
  }

  void DrawArrows() {
    const double enlargement = Enlargement();
    for (int i = 0; i < static_cast<int>(cells_.size()); ++i) {
      if (cells_[i].num_corners == 0) continue;
      const cv::Rect area = Area(i);
      const Eigen::Vector2d from = {area.x + area.width / 2.0, area.y + area.height / 2.0};
      const Eigen::Vector2d to = from + cells_[i].sum / cells_[i].num_corners * enlargement;
      const double length = (to - from).norm();
      cv::arrowedLine(picture_, Fixed(from), Fixed(to), kInk, 2, cv::LINE_AA, kShift,
                      length > 0 ? std::min(0.35, 9 / length) : 0.1);
    }
    // A bar for comparison.
    const double pixels = 50 / enlargement;
    const std::string text = fmt::format(
        "arrows: mean residual per cell; bar = {:.2g} px; red rings: corners left out", pixels);
    const int y = kMargin + height_ + 22;
    cv::line(picture_, {kMargin, y}, {kMargin + 50, y}, kInk, 2, cv::LINE_AA);
    Write(text, {kMargin + 62, y + 5}, kInk);
  }

  void WriteLines() {
    const Calibration& c = calibration_;
    lines_.push_back(
        {fmt::format("{}, {} of {} photos, residual {:.3f} px rms, held out {:.3f} px",
                     c.lens.Name(), c.NumUsed(), c.photos.size(), c.rms_px, c.held_out_rms_px),
         kInk});
    lines_.push_back({fmt::format("one standard deviation: focal length {:.3f} %, picture corners "
                                  "{:.3f} px, whole picture {:.3f} px; boards in {} of the cells",
                                  c.focal_sigma_percent, c.corner_sigma_px, c.mean_sigma_px,
                                  Percent(c.coverage.share)),
                      kInk});
    size_t num_left_out = 0;
    for (const CalibratedPhoto& photo : c.photos) {
      if (photo.used || ++num_left_out > kMaxLines) continue;
      lines_.push_back({"left out: " + photo.name + ": " + photo.reason, kRed});
    }
    if (num_left_out > kMaxLines) {
      lines_.push_back(
          {"and " + std::to_string(num_left_out - kMaxLines) + " more photos left out", kRed});
    }
    for (const std::string& reason : c.reasons)
      lines_.push_back({"NOT TO BE TRUSTED: " + reason, kRed});
  }

  void DrawText() {
    int y = kMargin + height_ + 58;
    for (const auto& [text, color] : lines_) {
      Write(text, {kMargin, y}, color);
      y += kLine;
    }
    const Camera& camera = calibration_.camera;
    Write(fmt::format("{} x {}", camera.width, camera.height), {kMargin, kMargin - 12}, kGrey);
  }

  // What does not fit into the width is cut off, with dots.
  void Write(std::string text, const cv::Point& at, const cv::Scalar& color) {
    const double size = 0.5;
    const auto width_of = [&](const std::string& t) {
      return cv::getTextSize(t, cv::FONT_HERSHEY_SIMPLEX, size, 1, nullptr).width;
    };
    if (at.x + width_of(text) > picture_.cols - 10) {
      while (!text.empty() && at.x + width_of(text + " ...") > picture_.cols - 10) text.pop_back();
      text += " ...";
    }
    cv::putText(picture_, text, at, cv::FONT_HERSHEY_SIMPLEX, size, color, 1, cv::LINE_AA);
  }

  struct Line {
    std::string text;
    cv::Scalar color;
  };
  const Calibration& calibration_;
  double scale_;
  int width_, height_;
  std::vector<Cell> cells_;
  std::vector<Line> lines_;
  cv::Mat picture_;
};

}  // namespace

cv::Mat DrawCalibration(const Calibration& calibration) {
  return CalibrationDrawing(calibration).Draw();
}

}  // namespace roomtex
