#include "building/outline.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "building/cell_arrangement.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/json_text.h"
#include "core/random_stream.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr char kOutlineFormat[] = "roomtex outline";
constexpr size_t kMaxCorners = 2000, kMaxPlanes = 50, kMaxBuildings = 20000;
constexpr double kMaxCoordinate = 1e9;

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

bool SegmentsTouch(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c,
                   const Eigen::Vector2d& d) {
  const double abc = Cross(b - a, c - a), abd = Cross(b - a, d - a);
  const double cda = Cross(d - c, a - c), cdb = Cross(d - c, b - c);
  if (abc == 0 && abd == 0) {
    const Eigen::Vector2d along = b - a;
    const double low = std::min(along.dot(c - a), along.dot(d - a));
    const double high = std::max(along.dot(c - a), along.dot(d - a));
    return high >= 0 && low <= along.squaredNorm();
  }
  return abc * abd <= 0 && cda * cdb <= 0;
}

bool CrossesItself(const std::vector<Eigen::Vector2d>& polygon) {
  const size_t n = polygon.size();
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = i + 2; j < n; ++j) {
      if (i == 0 && j == n - 1) continue;
      if (SegmentsTouch(polygon[i], polygon[i + 1], polygon[j], polygon[(j + 1) % n])) return true;
    }
  }
  return false;
}

// Reads values out of the JSON and says where they stand.
class OutlineParser {
 public:
  explicit OutlineParser(const std::string& path) : path_(path) {}

  [[noreturn]] void Fail(const std::string& where, const std::string& finding) const {
    throw InputError(path_, where, finding,
                     "See docs/outline.md for what the file holds, or make it anew with "
                     "roomtex-outline");
  }
  const Json& At(const Json& json, const std::string& key, const std::string& where) const {
    if (!json.is_object() || !json.contains(key)) Fail(where, "lacks \"" + key + "\"");
    return json[key];
  }
  double NumberAt(const Json& json, const std::string& where) const {
    if (!json.is_number()) Fail(where, "must be a number");
    const double value = json.get<double>();
    if (!(std::abs(value) <= kMaxCoordinate)) Fail(where, "is beyond all sizes of buildings");
    return value;
  }
  double Number(const Json& json, const std::string& key, const std::string& where) const {
    return NumberAt(At(json, key, where), Below(where, key));
  }
  template <int kSize>
  Eigen::Matrix<double, kSize, 1> Vector(const Json& json, const std::string& where) const {
    if (!json.is_array() || json.size() != kSize) {
      Fail(where, "must be a list of " + std::to_string(kSize) + " numbers");
    }
    Eigen::Matrix<double, kSize, 1> vector;
    for (int i = 0; i < kSize; ++i) vector[i] = NumberAt(json[static_cast<size_t>(i)], where);
    return vector;
  }
  const Json& List(const Json& json, const std::string& key, const std::string& where,
                   size_t most) const {
    const Json& list = At(json, key, where);
    if (!list.is_array()) Fail(Below(where, key), "must be a list");
    if (list.size() > most) {
      Fail(Below(where, key), "has more than " + std::to_string(most) + " entries");
    }
    return list;
  }

 private:
  static std::string Below(const std::string& where, const std::string& key) {
    return where.empty() ? key : where + " " + key;
  }

  std::string path_;
};

OutlineBuilding ParseBuilding(const OutlineParser& parser, const Json& json, size_t index) {
  std::string where = "building " + std::to_string(index + 1);
  OutlineBuilding building;
  const Json& name = parser.At(json, "name", where);
  if (!name.is_string() || name.get<std::string>().empty()) {
    parser.Fail(where + " name", "must be a text that is not empty");
  }
  building.name = name.get<std::string>();
  // No XML can hold them, no table shows them.
  if (std::any_of(building.name.begin(), building.name.end(),
                  [](unsigned char c) { return c < ' ' || c == 0x7f; })) {
    parser.Fail(where + " name", "holds a control character");
  }
  where += " (" + Quoted(building.name) + ")";
  building.ground = parser.Number(json, "ground", where);
  const Json& footprint = parser.List(json, "footprint", where, kMaxCorners);
  for (size_t i = 0; i < footprint.size(); ++i) {
    building.footprint.push_back(
        parser.Vector<2>(footprint[i], where + " corner " + std::to_string(i + 1)));
  }
  // GeoJSON's habit; a hand may well draw clockwise.
  if (building.footprint.size() > 1 && building.footprint.front() == building.footprint.back()) {
    building.footprint.pop_back();
  }
  if (PolygonArea(building.footprint) < 0) {
    std::reverse(building.footprint.begin(), building.footprint.end());
  }
  const Json& roof = parser.List(json, "roof", where, kMaxPlanes);
  for (size_t i = 0; i < roof.size(); ++i) {
    const std::string plane_where = where + " roof plane " + std::to_string(i + 1);
    RoofPlane plane;
    plane.point =
        parser.Vector<3>(parser.At(roof[i], "point", plane_where), plane_where + " point");
    plane.slope_deg = parser.Number(roof[i], "slope_deg", plane_where);
    plane.downhill_deg = parser.Number(roof[i], "downhill_deg", plane_where);
    building.roof.push_back(plane);
  }
  const std::vector<std::string> problems = building.Problems();
  if (!problems.empty()) parser.Fail(where, problems[0]);
  return building;
}

// A number for everything that a hand could change.
std::string SealOf(Json json) {
  json.erase("proposal_seal");
  uint64_t hash = 0;
  for (const char c : json.dump()) hash = MixBits(hash, static_cast<unsigned char>(c));
  char text[20];
  std::snprintf(text, sizeof(text), "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

// Micrometres: what a person can read, and the solid stays the same.
double Rounded(double value) { return std::round(value * 1e6) / 1e6; }

}  // namespace

Eigen::Vector2d RoofPlane::Gradient() const {
  const double rise = std::tan(RadFromDeg(slope_deg)), angle = RadFromDeg(downhill_deg);
  return -rise * Eigen::Vector2d(std::cos(angle), std::sin(angle));
}

RoofPlane RoofPlane::FromGradient(const Eigen::Vector3d& point, const Eigen::Vector2d& gradient) {
  RoofPlane plane;
  plane.point = point;
  plane.slope_deg = DegFromRad(std::atan(gradient.norm()));
  if (gradient.norm() > 0)
    plane.downhill_deg = DegFromRad(std::atan2(-gradient.y(), -gradient.x()));
  return plane;
}

double OutlineBuilding::RoofHeightAt(const Eigen::Vector2d& x) const {
  double height = std::numeric_limits<double>::infinity();
  for (const RoofPlane& plane : roof) height = std::min(height, plane.HeightAt(x));
  return height;
}

std::string OutlineBuilding::RoofShape() const {
  constexpr double kLevelDeg = 0.05;
  if (roof.size() == 1) return std::abs(roof[0].slope_deg) < kLevelDeg ? "flat" : "shed";
  if (roof.size() == 2) {
    const Eigen::Vector2d a = roof[0].Gradient(), b = roof[1].Gradient();
    if (a.dot(b) < -0.99 * a.norm() * b.norm() && a.norm() > 0 && b.norm() > 0) return "gable";
  }
  return "planes";
}

std::vector<std::string> OutlineBuilding::Problems() const {
  std::vector<std::string> problems;
  if (footprint.size() < 3) problems.push_back("the footprint needs at least three corners");
  if (roof.empty()) problems.push_back("the roof needs at least one plane");
  for (const RoofPlane& plane : roof) {
    if (!(std::abs(plane.slope_deg) <= 85)) {
      problems.push_back("a roof plane must not be steeper than 85 degrees");
    }
  }
  if (!problems.empty()) return problems;
  if (CrossesItself(footprint)) problems.push_back("the footprint crosses or touches itself");
  double size = 0;
  for (const Eigen::Vector2d& corner : footprint)
    size = std::max(size, (corner - footprint[0]).norm());
  if (!(PolygonArea(footprint) > 1e-9 * size * size)) {
    problems.push_back("the footprint has no area");
  }
  for (const Eigen::Vector2d& corner : footprint) {
    if (RoofHeightAt(corner) > ground) continue;
    problems.push_back("the roof does not lie above the ground at corner " +
                       Significant(corner.x(), 6) + ", " + Significant(corner.y(), 6));
    break;
  }
  return problems;
}

Outline ParseOutline(const std::string& path, const Json& json,
                     std::vector<std::string>* left_out) {
  const OutlineParser parser(path);
  if (!json.is_object() || !json.contains("format") || json["format"] != kOutlineFormat) {
    parser.Fail("", "is no outline: it lacks \"format\": \"" + std::string(kOutlineFormat) + "\"");
  }
  if (parser.Number(json, "version", "") != 1) parser.Fail("version", "is not 1");
  Outline outline;
  const Json& metric = parser.At(json, "metric", "");
  if (!metric.is_boolean()) parser.Fail("metric", "must be true or false");
  outline.metric = metric.get<bool>();
  const std::string where = "outline_from_input";
  const Json& frame = parser.At(json, where, "");
  outline.outline_from_input.scale = parser.Number(frame, "scale", where);
  if (!(outline.outline_from_input.scale > 0)) parser.Fail(where + " scale", "must be positive");
  const Eigen::Vector4d wxyz =
      parser.Vector<4>(parser.At(frame, "rotation_wxyz", where), where + " rotation_wxyz");
  if (!(std::abs(wxyz.norm() - 1) < 1e-3)) {
    parser.Fail(where + " rotation_wxyz", "must be a quaternion of length 1");
  }
  outline.outline_from_input.rotation = QuaternionFromWxyz(wxyz).normalized();
  outline.outline_from_input.translation =
      parser.Vector<3>(parser.At(frame, "translation", where), where + " translation");
  if (json.contains("geo_origin") && !json["geo_origin"].is_null()) {
    const Json& origin = json["geo_origin"];
    const GeoPosition position{parser.Number(origin, "latitude", "geo_origin"),
                               parser.Number(origin, "longitude", "geo_origin"),
                               parser.Number(origin, "height", "geo_origin")};
    if (!position.Problems().empty()) parser.Fail("geo_origin", position.Problems()[0]);
    outline.geo.emplace(position);
  }
  if (json.contains("alignment") && !json["alignment"].is_null()) {
    const Json& alignment = json["alignment"];
    const auto flag = [&](const char* key) {
      const Json& value = parser.At(alignment, key, "alignment");
      if (!value.is_boolean()) {
        parser.Fail(std::string("alignment ") + key, "must be true or false");
      }
      return value.get<bool>();
    };
    const Json& reason = parser.At(alignment, "reason", "alignment");
    if (!reason.is_string()) parser.Fail("alignment reason", "must be a text");
    outline.alignment = {flag("trusted"), reason.get<std::string>(), flag("north_assumed")};
  }
  const Json& buildings = parser.List(json, "buildings", "", kMaxBuildings);
  std::set<std::string> names;
  for (size_t i = 0; i < buildings.size(); ++i) {
    try {
      OutlineBuilding building = ParseBuilding(parser, buildings[i], i);
      if (!names.insert(building.name).second) {
        parser.Fail("building " + std::to_string(i + 1),
                    "has the name of another one: " + Quoted(building.name));
      }
      outline.buildings.push_back(std::move(building));
    } catch (const InputError& error) {
      if (left_out == nullptr) throw;
      left_out->emplace_back(error.what());
    }
  }
  return outline;
}

Outline ReadOutline(const std::string& path, std::vector<std::string>* left_out) {
  const Json json = ReadJson(path,
                             "Give the outline.json that roomtex-outline wrote, or mend what was "
                             "edited there: a comma, a bracket, a quote");
  return ParseOutline(path, json, left_out);
}

Json OutlineToJson(const Outline& outline) {
  Json json;
  json["format"] = kOutlineFormat;
  json["version"] = 1;
  json["metric"] = outline.metric;
  json["outline_from_input"] = ToJson(outline.outline_from_input);
  json["geo_origin"] = nullptr;
  if (outline.geo) {
    const GeoPosition& origin = outline.geo->origin();
    json["geo_origin"] = {{"latitude", origin.latitude_deg},
                          {"longitude", origin.longitude_deg},
                          {"height", origin.height}};
  }
  if (outline.alignment) {
    json["alignment"] = {{"trusted", outline.alignment->trusted},
                         {"reason", outline.alignment->reason},
                         {"north_assumed", outline.alignment->north_assumed}};
  }
  json["buildings"] = Json::array();
  for (const OutlineBuilding& building : outline.buildings) {
    Json one;
    one["name"] = building.name;
    one["ground"] = Rounded(building.ground);
    one["footprint"] = Json::array();
    for (const Eigen::Vector2d& corner : building.footprint) {
      one["footprint"].push_back({Rounded(corner.x()), Rounded(corner.y())});
    }
    one["roof"] = Json::array();
    for (const RoofPlane& plane : building.roof) {
      one["roof"].push_back(
          {{"point",
            {Rounded(plane.point.x()), Rounded(plane.point.y()), Rounded(plane.point.z())}},
           {"slope_deg", Rounded(plane.slope_deg)},
           {"downhill_deg", Rounded(plane.downhill_deg)}});
    }
    json["buildings"].push_back(one);
  }
  return json;
}

OutlineBuilding AsWritten(OutlineBuilding building) {
  building.ground = Rounded(building.ground);
  for (Eigen::Vector2d& corner : building.footprint) corner = corner.unaryExpr(&Rounded);
  for (RoofPlane& plane : building.roof) {
    plane.point = plane.point.unaryExpr(&Rounded);
    plane.slope_deg = Rounded(plane.slope_deg);
    plane.downhill_deg = Rounded(plane.downhill_deg);
  }
  return building;
}

void MoveBuildings(const Similarity& target_from_outline, std::vector<OutlineBuilding>* buildings) {
  const auto moved = [&](const Eigen::Vector2d& x, double z) {
    return target_from_outline * Eigen::Vector3d(x.x(), x.y(), z);
  };
  const Eigen::Vector3d east = target_from_outline.rotation * Eigen::Vector3d::UnitX();
  const double turn_deg = DegFromRad(std::atan2(east.y(), east.x()));
  for (OutlineBuilding& building : *buildings) {
    const double rise = moved(building.footprint[0], building.ground).z() - building.ground;
    for (RoofPlane& plane : building.roof) {
      plane.point.head<2>() = moved(plane.point.head<2>(), building.ground).head<2>();
      plane.point.z() += rise;
      plane.downhill_deg += turn_deg;
    }
    for (Eigen::Vector2d& corner : building.footprint) {
      corner = moved(corner, building.ground).head<2>();
    }
    building.ground += rise;
  }
}

void PlaceOnEarth(const GeoPosition& origin, const std::string& path, Outline* outline) {
  if (outline->geo) {
    const GeoPosition& own = outline->geo->origin();
    constexpr double kSameDeg = 1e-9, kSameHeight = 1e-4;  // a tenth of a millimetre
    const bool is_same = std::abs(own.latitude_deg - origin.latitude_deg) < kSameDeg &&
                         std::abs(own.longitude_deg - origin.longitude_deg) < kSameDeg &&
                         std::abs(own.height - origin.height) < kSameHeight;
    if (is_same) return;
    throw UsageError("--geo_origin is another place than that of " + path +
                     " (geo_origin): leave it out, or change it there");
  }
  const Similarity input_from_outline = outline->outline_from_input.Inverse();
  if (!outline->metric || std::abs(input_from_outline.scale - 1) > 1e-9) {
    throw UsageError("--geo_origin is for an input in metres: the points that " + path +
                     " was made from were not");
  }
  // Walls and ground turn what is upright by less; a frame that was not is none of the Earth.
  constexpr double kMostTiltDeg = 3;
  const Eigen::Vector3d up = input_from_outline.rotation * Eigen::Vector3d::UnitZ();
  if (up.z() < std::cos(RadFromDeg(kMostTiltDeg))) {
    throw UsageError("--geo_origin says that z was up in the points that " + path +
                     " was made from, but its outline_from_input turns them upright");
  }
  MoveBuildings(input_from_outline, &outline->buildings);
  outline->outline_from_input = Similarity();
  outline->geo.emplace(origin);
}

void WriteOutline(const std::string& path, const Outline& outline, bool proposed) {
  Json json = OutlineToJson(outline);
  if (proposed) json["proposal_seal"] = SealOf(json);
  WriteJson(path, json);
}

bool HoldsSameOutline(const std::string& path, const Outline& outline) {
  const auto essence = [](Outline one) {
    one.alignment.reset();  // of whoever wrote it last
    return OutlineToJson(one);
  };
  return essence(ReadOutline(path)) == essence(outline);
}

bool WasEdited(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return false;
  const Json json = ReadJsonIfAny(path);
  if (!json.is_object() || !json.contains("proposal_seal")) return true;
  return json["proposal_seal"] != SealOf(json);
}

}  // namespace roomtex
