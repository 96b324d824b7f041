#include "workflow/site_plan.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/text.h"
#include "workflow/html_text.h"

namespace roomtex {
namespace {

// Of the drawing, at most: as wide and as high as the page shows it.
constexpr double kWidth = 1000, kHeight = 620;
constexpr double kMarginShare = 0.04;  // of the rooms' longer side
constexpr double kLongestScale = 0.2;  // of the width
constexpr double kLargestPlan = 1e5;   // metres; beyond it is no plan
// Of the drawing of one room, in its units.
constexpr double kEdge = 14, kFoot = 36, kRoomScale = 100;

Eigen::Vector3d VectorOf(const Json& json) {
  return {json.at(0).get<double>(), json.at(1).get<double>(), json.at(2).get<double>()};
}

// 1, 2 or 5 metres, or ten times as many: as many as are shorter than `longest`.
double ScaleMetres(double longest) {
  double metres = 1;
  for (const double next : {2., 5., 10., 20., 50., 100., 200., 500.}) {
    if (next < longest) metres = next;
  }
  return metres;
}

std::string Pair(const Eigen::Vector2d& x) { return Number(x.x(), 1) + "," + Number(x.y(), 1); }

std::string Text(const Eigen::Vector2d& at, const std::string& text) {
  return "<text x=\"" + Number(at.x(), 1) + "\" y=\"" + Number(at.y(), 1) + "\">" + HtmlText(text) +
         "</text>";
}

// From `left` on, with `units` of the drawing in a metre.
std::string ScaleBar(const Eigen::Vector2d& left, double metres, double units) {
  const Eigen::Vector2d right = left + Eigen::Vector2d(metres * units, 0);
  return "<g class=\"scale\"><path d=\"M" + Pair(left) + " L" + Pair(right) + "\"/>" +
         Text(right + Eigen::Vector2d(36, 0), Number(metres, 0) + " m") + "</g>";
}

std::string PicturePath(const Json& room, const std::string& to_rooms) {
  return UrlPath(to_rooms + room.at("folder").get<std::string>() + "/" +
                 room.at("plan").at("picture").get<std::string>());
}

Eigen::Matrix3d RowsOf(const Json& json) {
  Eigen::Matrix3d rows;
  for (int row = 0; row < 3; ++row) rows.row(row) = VectorOf(json.at(row)).transpose();
  return rows;
}

// A room's plan in that of the site, in metres: q = turn * p + shift.
struct PlacedPlan {
  const Json* room = nullptr;
  std::string picture;
  bool trusted = true;
  Eigen::Vector2d size;
  Eigen::Matrix2d turn;
  Eigen::Vector2d shift;

  Eigen::Vector2d At(double x, double y) const { return turn * Eigen::Vector2d(x, y) + shift; }
  std::vector<Eigen::Vector2d> Corners() const {
    return {At(0, 0), At(size.x(), 0), At(size.x(), size.y()), At(0, size.y())};
  }
};

class SiteDrawing {
 public:
  SiteDrawing(const Json& keys, const std::string& frame, const std::string& to_rooms)
      : keys_(keys), frame_(frame), to_rooms_(to_rooms) {}

  std::string Make() {
    FindPlans();
    if (plans_.size() < 2) return "";
    low_ = high_ = plans_[0].shift;
    for (const PlacedPlan& plan : plans_) {
      for (const Eigen::Vector2d& corner : plan.Corners()) {
        low_ = low_.cwiseMin(corner);
        high_ = high_.cwiseMax(corner);
      }
    }
    const double margin = kMarginShare * (high_ - low_).maxCoeff();
    low_.array() -= margin;
    high_.array() += margin;
    low_.y() -= margin;  // for the scale
    const Eigen::Vector2d size = high_ - low_;
    units_ = std::min(kWidth / size.x(), kHeight / size.y());
    std::string svg = "<svg class=\"plan site\" role=\"img\" viewBox=\"0 0 " +
                      Number(units_ * size.x(), 0) + " " + Number(units_ * size.y(), 0) +
                      "\" aria-label=\"Plan of the rooms that are linked\">";
    for (const PlacedPlan& plan : plans_) svg += Room(plan);
    for (const PlacedPlan& plan : plans_) svg += Name(plan);
    for (const Json& link : keys_["joined"]["links"]) svg += Door(link);
    return svg + Scale() + "</svg>";
  }

 private:
  void FindPlans() {
    for (const Json& joined : keys_["joined"]["rooms"]) {
      if (joined.at("frame") != frame_) continue;
      for (const Json& room : keys_["rooms"]) {
        if (room["name"] == joined.at("name") && room.contains("plan")) AddPlan(room, joined);
      }
    }
  }

  void AddPlan(const Json& room, const Json& joined) {
    const Json& plan = room["plan"];
    const Eigen::Matrix3d plan_from_scan = RowsOf(plan.at("plan_from_scan"));
    Eigen::Matrix3d rotation;
    Eigen::Vector3d translation;
    for (int row = 0; row < 3; ++row) {
      const Json& numbers = joined.at("site_from_room").at(row);
      rotation.row(row) = VectorOf(numbers).transpose();
      translation[row] = numbers.at(3).get<double>();
    }
    // The first one's walls lie along the page.
    if (plans_.empty()) level_from_site_ = plan_from_scan * rotation.transpose();
    const Eigen::Matrix3d level_from_plan =
        level_from_site_ * rotation * plan_from_scan.transpose();
    PlacedPlan placed;
    placed.room = &room;
    placed.picture = PicturePath(room, to_rooms_);
    placed.trusted = joined.at("trusted").get<bool>();
    placed.size = VectorOf(plan.at("size")).head<2>();
    placed.turn = level_from_plan.topLeftCorner<2, 2>();
    placed.shift =
        (level_from_plan * VectorOf(plan.at("low")) + level_from_site_ * translation).head<2>();
    plans_.push_back(placed);
  }

  // Drawn with y up.
  Eigen::Vector2d OnPage(const Eigen::Vector2d& x) const {
    return units_ * Eigen::Vector2d(x.x() - low_.x(), high_.y() - x.y());
  }

  std::string Room(const PlacedPlan& plan) const {
    // Of the picture, whose y goes down from the far edge of the plan.
    const Eigen::Vector2d origin = OnPage(plan.At(0, plan.size.y()));
    const Eigen::Matrix2d turn = units_ * Eigen::Vector2d(1, -1).asDiagonal() * plan.turn *
                                 Eigen::Vector2d(1, -1).asDiagonal();
    std::string matrix;
    for (const double value : {turn(0, 0), turn(1, 0), turn(0, 1), turn(1, 1)}) {
      matrix += Number(value, 5) + " ";
    }
    std::string outline;
    for (const Eigen::Vector2d& corner : plan.Corners()) {
      outline += (outline.empty() ? "M" : " L") + Pair(OnPage(corner));
    }
    return "<image transform=\"matrix(" + matrix + Number(origin.x(), 2) + " " +
           Number(origin.y(), 2) + ")\" width=\"" + Number(plan.size.x(), 3) + "\" height=\"" +
           Number(plan.size.y(), 3) + "\" preserveAspectRatio=\"none\" href=\"" +
           HtmlText(plan.picture) + "\"/><path class=\"room" + (plan.trusted ? "" : " doubted") +
           "\" d=\"" + outline + " Z\"/>";
  }

  std::string Name(const PlacedPlan& plan) const {
    const Eigen::Vector2d middle = 0.5 * plan.size;
    return "<g class=\"name\">" +
           Text(OnPage(plan.At(middle.x(), middle.y())), (*plan.room)["name"]) + "</g>";
  }

  std::string Door(const Json& link) const {
    const bool is_here = std::any_of(plans_.begin(), plans_.end(), [&](const PlacedPlan& plan) {
      return (*plan.room)["name"] == link.at("first");
    });
    if (!is_here) return "";
    const Eigen::Vector2d at = OnPage((level_from_site_ * VectorOf(link.at("place"))).head<2>());
    return "<circle class=\"door" + std::string(link.at("trusted").get<bool>() ? "" : " doubted") +
           "\" cx=\"" + Number(at.x(), 1) + "\" cy=\"" + Number(at.y(), 1) + "\" r=\"9\"><title>" +
           HtmlText(link.at("first")) + " \u2013 " + HtmlText(link.at("second")) +
           "</title></circle>";
  }

  std::string Scale() const {
    return ScaleBar(OnPage(low_) + Eigen::Vector2d(20, -16),
                    ScaleMetres(kLongestScale * (high_.x() - low_.x())), units_);
  }

  const Json& keys_;
  std::string frame_, to_rooms_;
  std::vector<PlacedPlan> plans_;
  Eigen::Matrix3d level_from_site_ = Eigen::Matrix3d::Identity();
  Eigen::Vector2d low_, high_;
  double units_ = 1;  // of the drawing in a metre
};

}  // namespace

std::string DrawSitePlan(const Json& keys, const std::string& frame, const std::string& to_rooms) {
  try {
    return SiteDrawing(keys, frame, to_rooms).Make();
  } catch (const Json::exception&) {
    return "";  // a report of another version
  }
}

std::optional<Eigen::Vector2d> PlanSize(const Json& room) {
  try {
    const Eigen::Vector2d size = VectorOf(room.at("plan").at("size")).head<2>();
    const bool is_plan = size.minCoeff() > 0 && size.maxCoeff() < kLargestPlan;
    if (!is_plan || !room.at("plan").at("picture").is_string()) return std::nullopt;
    return size;
  } catch (const Json::exception&) {
    return std::nullopt;  // a report of another version, or of a room that is not so far
  }
}

std::string DrawRoomPlan(const Json& room, double units, const std::string& to_rooms) {
  const Eigen::Vector2d plan = units * PlanSize(room).value();
  const double metres = ScaleMetres(kRoomScale / units);
  const double width = std::max(plan.x(), metres * units + 64) + 2 * kEdge;
  const double height = plan.y() + kEdge + kFoot;
  const std::string place = " width=\"" + Number(plan.x(), 1) + "\" height=\"" +
                            Number(plan.y(), 1) + "\" x=\"" + Number(0.5 * (width - plan.x()), 1) +
                            "\" y=\"" + Number(kEdge, 1) + "\"";
  return "<svg class=\"plan site alone\" role=\"img\" width=\"" + Number(width, 0) +
         "\" height=\"" + Number(height, 0) + "\" viewBox=\"0 0 " + Number(width, 0) + " " +
         Number(height, 0) + "\" aria-label=\"Plan of " + HtmlText(room["name"]) + "\"><image" +
         place + " preserveAspectRatio=\"none\" href=\"" + HtmlText(PicturePath(room, to_rooms)) +
         "\"/><rect class=\"room\"" + place + "/>" +
         ScaleBar({kEdge, height - 0.5 * kFoot}, metres, units) + "</svg>";
}

}  // namespace roomtex
