#include "workflow/room_plan.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgcodecs.hpp>

#include "core/frames.h"
#include "core/text.h"
#include "workflow/html_text.h"

namespace roomtex {
namespace {

constexpr double kLeastPixel = 0.03;    // metres
constexpr double kMaxPixels = 4e6;      // of the picture: coarser pixels in a larger room
constexpr double kCeiling = 0.3;        // metres below it that are left out
constexpr double kTall = 0.4;           // metres from which on something stands there
constexpr double kMargin = 0.35;        // metres around the room
constexpr double kUnitsPerMetre = 100;  // of the drawing
constexpr double kWedge = 0.42;         // metres
// Metres beyond the room up to which the plan reaches for what stands there, as photos into a scan
// of a part of a room; one that is lost farther away does not make the room small.
constexpr double kPlanReach = 4;

// What the samples over one pixel of the plan say.
struct Column {
  int num_points = 0, num_unseen = 0, num_thin = 0, num_compared = 0;
  double disagreement = 0;
  float low = 1e9f, high = -1e9f;
};

// Blue, green, red of a share from good to bad.
cv::Vec3b Between(const cv::Vec3b& good, const cv::Vec3b& bad, double share) {
  const double s = std::clamp(share, 0.0, 1.0);
  cv::Vec3b color;
  for (int i = 0; i < 3; ++i) color[i] = cv::saturate_cast<uint8_t>((1 - s) * good[i] + s * bad[i]);
  return color;
}

const cv::Vec3b kSeen(0xb5, 0x78, 0x3b), kThin(0x2a, 0xa8, 0xe6), kUnseen(0x35, 0x35, 0xc9);
const cv::Vec3b kUnknown(0x99, 0x99, 0x99);

cv::Vec4b ColorOf(const Column& column, PlanShows shows) {
  cv::Vec3b color = kUnknown;
  if (shows == PlanShows::kCoverage) {
    color = 2 * column.num_unseen > column.num_points                       ? kUnseen
            : 2 * (column.num_unseen + column.num_thin) > column.num_points ? kThin
                                                                            : kSeen;
  } else if (column.num_compared > 0) {
    color = Between(kSeen, kUnseen, column.disagreement / column.num_compared / kWorstDisagreement);
  }
  const bool stands = column.high - column.low > kTall;
  return {color[0], color[1], color[2], static_cast<uint8_t>(stands ? 255 : 90)};
}

class Drawing {
 public:
  explicit Drawing(const PlanFrame& frame) : room_(frame.Size().head<2>()), high_(room_) {}

  void MakeRoomFor(const Eigen::Vector2d& x) {
    const Eigen::Vector2d nearest = x.cwiseMax(0).cwiseMin(room_);
    if (!((x - nearest).norm() <= kPlanReach)) return;
    low_ = low_.cwiseMin(x);
    high_ = high_.cwiseMax(x);
  }

  // Drawn with y up.
  std::string At(const Eigen::Vector2d& x) const {
    return Number(kUnitsPerMetre * (x.x() - low_.x() + kMargin), 1) + "," +
           Number(kUnitsPerMetre * (high_.y() - x.y() + kMargin), 1);
  }
  double Width() const { return kUnitsPerMetre * (high_.x() - low_.x() + 2 * kMargin); }
  double Height() const { return kUnitsPerMetre * (high_.y() - low_.y() + 2 * kMargin + 0.3); }

  // The picture of the room.
  std::string Picture(const std::string& png) const {
    return "<image " + Coordinates(At({0, room_.y()}), "x", "y") + " width=\"" +
           Number(kUnitsPerMetre * room_.x(), 1) + "\" height=\"" +
           Number(kUnitsPerMetre * room_.y(), 1) +
           "\" preserveAspectRatio=\"none\" href=\"data:image/png;base64," +
           Base64(png.data(), png.size()) + "\"/>";
  }

  std::string Wedge(const PlanCamera& camera, int number) const {
    const Eigen::Vector2d centre = camera.centre.head<2>();
    const double azimuth = std::atan2(camera.forward.y(), camera.forward.x());
    const auto arm = [&](double turn) {
      return Eigen::Vector2d(
          centre + kWedge * Eigen::Vector2d(std::cos(azimuth + turn), std::sin(azimuth + turn)));
    };
    const Eigen::Vector2d label = arm(0);
    return "<g class=\"camera\"><title>" + HtmlText(camera.name) + "</title><path d=\"M" +
           At(centre) + " L" + At(arm(camera.half_view)) + " L" + At(arm(-camera.half_view)) +
           " Z\"/>" + Circle(centre, 5) + Text(label, std::to_string(number)) + "</g>";
  }
  std::string Arrow(const ViewingPlace& place, int number) const {
    const Eigen::Vector2d centre = place.centre.head<2>();
    const Eigen::Vector2d tip = centre + 0.55 * place.forward.head<2>().normalized();
    return "<g class=\"place\"><path marker-end=\"url(#tip)\" d=\"M" + At(centre) + " L" + At(tip) +
           "\"/>" + Circle(centre, 13) +
           Text(centre, std::string(1, static_cast<char>('A' + number))) + "</g>";
  }
  // One metre.
  std::string Scale() const {
    const Eigen::Vector2d left = low_ - Eigen::Vector2d(0, kMargin + 0.08);
    const Eigen::Vector2d right = left + Eigen::Vector2d(1, 0);
    return "<g class=\"scale\"><path d=\"M" + At(left) + " L" + At(right) + "\"/>" +
           Text(right + Eigen::Vector2d(0.22, 0), "1 m") + "</g>";
  }

 private:
  static std::string Coordinates(const std::string& at, const char* x, const char* y) {
    const size_t comma = at.find(',');
    return std::string(x) + "=\"" + at.substr(0, comma) + "\" " + y + "=\"" + at.substr(comma + 1) +
           "\"";
  }
  std::string Circle(const Eigen::Vector2d& centre, double radius) const {
    return "<circle " + Coordinates(At(centre), "cx", "cy") + " r=\"" + Number(radius, 0) + "\"/>";
  }
  std::string Text(const Eigen::Vector2d& at, const std::string& text) const {
    return "<text " + Coordinates(At(at), "x", "y") + ">" + HtmlText(text) + "</text>";
  }

  Eigen::Vector2d room_;              // its size, metres; its low corner is 0, 0
  Eigen::Vector2d low_{0, 0}, high_;  // of the drawing, without margins
};

}  // namespace

std::string PlanPicture(const std::vector<EvidencePoint>& points, const PlanFrame& frame,
                        PlanShows shows) {
  const double width = frame.Size().x(), depth = frame.Size().y();
  const double pixel = std::max(kLeastPixel, std::sqrt(width * depth / kMaxPixels));
  const int columns = std::max(1, static_cast<int>(width / pixel));
  const int rows = std::max(1, static_cast<int>(depth / pixel));
  std::vector<Column> grid(static_cast<size_t>(columns) * static_cast<size_t>(rows));
  for (const EvidencePoint& point : points) {
    const Eigen::Vector3d x = frame.InPlan(point.x_in_scan);
    if (x.minCoeff() < 0 || x.x() >= width || x.y() >= depth ||
        x.z() >= frame.Size().z() - kCeiling) {
      continue;
    }
    const int column = std::min(static_cast<int>(x.x() / pixel), columns - 1);
    const int row = rows - 1 - std::min(static_cast<int>(x.y() / pixel), rows - 1);
    Column& there =
        grid[static_cast<size_t>(row) * static_cast<size_t>(columns) + static_cast<size_t>(column)];
    ++there.num_points;
    there.num_unseen += point.views == 0;
    there.num_thin += point.views == 1;
    there.low = std::min(there.low, static_cast<float>(x.z()));
    there.high = std::max(there.high, static_cast<float>(x.z()));
    if (std::isnan(point.disagreement)) continue;
    ++there.num_compared;
    there.disagreement += point.disagreement;
  }
  cv::Mat4b picture(rows, columns, cv::Vec4b(0, 0, 0, 0));
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const Column& there = grid[static_cast<size_t>(row) * static_cast<size_t>(columns) +
                                 static_cast<size_t>(column)];
      if (there.num_points > 0) picture(row, column) = ColorOf(there, shows);
    }
  }
  std::vector<uint8_t> bytes;
  cv::imencode(".png", picture, bytes);
  return {bytes.begin(), bytes.end()};
}

std::string DrawPlan(const std::vector<EvidencePoint>& points, const PlanFrame& frame,
                     const std::vector<PlanCamera>& cameras,
                     const std::vector<ViewingPlace>& places, PlanShows shows) {
  Drawing drawing(frame);
  for (const PlanCamera& camera : cameras) {
    const Eigen::Vector2d centre = camera.centre.head<2>();
    drawing.MakeRoomFor(centre);
    drawing.MakeRoomFor(centre + kWedge * camera.forward.head<2>());
  }
  for (const ViewingPlace& place : places) drawing.MakeRoomFor(place.centre.head<2>());
  std::string svg = "<svg class=\"plan\" role=\"img\" viewBox=\"0 0 " + Number(drawing.Width(), 0) +
                    " " + Number(drawing.Height(), 0) + "\" aria-label=\"Plan of the room\">";
  svg +=
      "<defs><marker id=\"tip\" markerWidth=\"5\" markerHeight=\"5\" refX=\"2\" refY=\"2.5\" "
      "orient=\"auto\"><path class=\"tip\" d=\"M0,0 L5,2.5 L0,5 Z\"/></marker></defs>";
  svg += drawing.Picture(PlanPicture(points, frame, shows));
  for (size_t i = 0; i < cameras.size(); ++i) {
    svg += drawing.Wedge(cameras[i], static_cast<int>(i) + 1);
  }
  for (size_t i = 0; i < places.size(); ++i) svg += drawing.Arrow(places[i], static_cast<int>(i));
  return svg + drawing.Scale() + "</svg>";
}

}  // namespace roomtex
