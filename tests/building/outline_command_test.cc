#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include <gtest/gtest.h>
#include <pugixml.hpp>

#include "building/building_output.h"
#include "building/building_solid.h"
#include "building/cell_arrangement.h"
#include "building/outline_cloud.h"
#include "building/outline_proposal.h"
#include "core/error.h"
#include "core/output_file.h"
#include "tests/building/simulated_street.h"
#include "tests/support/option_check.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"
#ifdef ROOMTEX_PAGES
#include "core/local_server.h"
#endif

namespace roomtex {
namespace {

Json ReadJson(const std::string& path) { return Json::parse(ReadBytes(path)); }

double TrueVolume(const Outline& outline) {
  double volume = 0;
  for (const OutlineBuilding& building : outline.buildings) {
    volume += ExtrudeBuilding(building).Volume();
  }
  return volume;
}

// Six times the volume below a face, seen from any point.
double SixVolumes(const std::vector<Eigen::Vector3d>& ring, const Eigen::Vector3d& from) {
  double sum = 0;
  for (size_t i = 1; i + 1 < ring.size(); ++i) {
    sum += (ring[0] - from).dot((ring[i] - from).cross(ring[i + 1] - from));
  }
  return sum;
}

// The numbers of a gml:posList.
std::vector<Eigen::Vector3d> PositionsOf(const pugi::xml_node& polygon) {
  const pugi::xml_node ring = polygon.child("gml:exterior").child("gml:LinearRing");
  std::istringstream numbers(ring.child("gml:posList").text().get());
  std::vector<Eigen::Vector3d> positions;
  for (Eigen::Vector3d x; numbers >> x.x() >> x.y() >> x.z();) positions.push_back(x);
  return positions;
}

// Easting, northing and height of the corners of a building's floor.
std::vector<Eigen::Vector3d> FloorOf(const Json& city, const std::string& building) {
  const Json& solid = city["CityObjects"]["building_" + building]["geometry"][0];
  const Json& kinds = solid["semantics"]["values"][0];
  std::vector<Eigen::Vector3d> floor;
  for (size_t face = 0; face < kinds.size(); ++face) {
    const Json& surface = solid["semantics"]["surfaces"][kinds[face].get<size_t>()];
    if (surface["type"] != "GroundSurface") continue;
    for (const Json& index : solid["boundaries"][0][face][0]) {
      Eigen::Vector3d x;
      for (size_t i = 0; i < 3; ++i) {
        x[static_cast<int>(i)] = city["vertices"][index.get<size_t>()][i].get<double>() *
                                     city["transform"]["scale"][i].get<double>() +
                                 city["transform"]["translate"][i].get<double>();
      }
      floor.push_back(x);
    }
  }
  return floor;
}
std::vector<Eigen::Vector3d> FloorOf(const pugi::xml_document& gml, const std::string& building) {
  const pugi::xml_node floor =
      gml.select_node(("//bldg:Building[gml:name='" + building + "']//bldg:GroundSurface").c_str())
          .node();
  std::vector<Eigen::Vector3d> positions = PositionsOf(floor.select_node(".//gml:Polygon").node());
  if (!positions.empty()) positions.pop_back();  // a ring ends where it began
  return positions;
}

TEST(OutlineCommand, WritesTheStreetInEveryFormat) {
  const TempFolder folder;
  const SimulatedStreet street = MakeStreet({});
  WriteSparseModel(street.model, folder / "model");
  std::string models;
  for (const char* name : {"b.glb", "b.obj", "b.city.json", "b.gml", "b.geojson"}) {
    models += " --model_path " + (folder / name);
  }
  const std::string line = "roomtex-outline --input_path " + (folder / "model") +
                           " --scale 1 --output_path " + (folder / "outline.json") +
                           " --report_path " + (folder / "report.json") + models;
  const CommandResult result = RunCommandLine(line);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("gable"), std::string::npos);
  const Outline outline = ReadOutline(folder / "outline.json");
  ASSERT_EQ(outline.buildings.size(), 4u);
  const double volume = TrueVolume(outline);
  EXPECT_NEAR(volume, TrueVolume(street.truth), 0.01 * volume);
  const Json report = ReadJson(folder / "report.json");
  EXPECT_EQ(report["trusted"], true);
  EXPECT_EQ(report["num_buildings"], 4);
  EXPECT_EQ(report["buildings"][3]["corners"].size(), 6u);
  EXPECT_LT(report["up"]["spread_deg"], 2);

  // CityJSON: whole numbers, closed shells, rings that look outwards.
  const Json city = ReadJson(folder / "b.city.json");
  EXPECT_EQ(city["type"], "CityJSON");
  EXPECT_EQ(city["version"], "2.0");
  const auto vertex = [&](const Json& index) {
    Eigen::Vector3d x;
    for (size_t i = 0; i < 3; ++i) {
      EXPECT_TRUE(city["vertices"][index.get<size_t>()][i].is_number_integer());
      x[static_cast<int>(i)] = city["vertices"][index.get<size_t>()][i].get<double>() *
                                   city["transform"]["scale"][i].get<double>() +
                               city["transform"]["translate"][i].get<double>();
    }
    return x;
  };
  double city_volume = 0;
  for (const auto& [name, object] : city["CityObjects"].items()) {
    const Json& solid = object["geometry"][0];
    EXPECT_EQ(solid["type"], "Solid");
    EXPECT_EQ(solid["lod"], "2");
    EXPECT_EQ(solid["semantics"]["values"][0].size(), solid["boundaries"][0].size());
    std::set<std::pair<int, int>> edges;
    for (const Json& face : solid["boundaries"][0]) {
      std::vector<Eigen::Vector3d> ring;
      for (size_t i = 0; i < face[0].size(); ++i) {
        ring.push_back(vertex(face[0][i]));
        EXPECT_TRUE(edges.emplace(face[0][i], face[0][(i + 1) % face[0].size()]).second);
      }
      city_volume += SixVolumes(ring, {20, 0, 0}) / 6;
    }
    for (const auto& [a, b] : edges) EXPECT_EQ(edges.count({b, a}), 1u) << name;
  }
  EXPECT_NEAR(city_volume, volume, 0.01 * volume);

  // CityGML: every surface of a solid is there, rings are closed.
  pugi::xml_document gml;
  ASSERT_TRUE(gml.load_file((folder / "b.gml").c_str()));
  std::set<std::string> ids;
  double gml_volume = 0;
  for (const auto& found : gml.select_nodes("//gml:Polygon")) {
    ids.insert(found.node().attribute("gml:id").value());
    const std::vector<Eigen::Vector3d> ring = PositionsOf(found.node());
    ASSERT_GE(ring.size(), 4u);
    EXPECT_EQ(ring.front(), ring.back());
    gml_volume += SixVolumes(ring, {20, 0, 0}) / 6;
  }
  EXPECT_NEAR(gml_volume, volume, 0.001 * volume);
  const auto members = gml.select_nodes("//gml:surfaceMember[@xlink:href]");
  EXPECT_EQ(members.size(), ids.size());
  for (const auto& member : members) {
    EXPECT_EQ(ids.count(std::string(member.node().attribute("xlink:href").value()).substr(1)), 1u);
  }
  EXPECT_EQ(gml.select_nodes("//bldg:GroundSurface").size(), 4u);

  // OBJ: in the frame of the model, read by our own reader.
  ScanReaderOptions reader;
  const Scan mesh = ReadScan(folder / "b.obj", reader);
  double obj_volume = 0;
  for (const Triangle& t : mesh.triangles) {
    obj_volume +=
        SixVolumes({mesh.points[static_cast<size_t>(t[0])], mesh.points[static_cast<size_t>(t[1])],
                    mesh.points[static_cast<size_t>(t[2])]},
                   {20, 0, 0}) /
        6;
  }
  EXPECT_NEAR(obj_volume, volume, 0.001 * volume);
  EXPECT_GT(mesh.up.z(), 0.999);
  EXPECT_EQ(ReadBytes(folder / "b.glb").substr(0, 4), "glTF");
  // No place on the Earth: said.
  EXPECT_TRUE(ReadJson(folder / "b.geojson").contains("note"));

  // The same again: an unchanged proposal is replaced by the same one ...
  const std::string before = ReadBytes(folder / "outline.json");
  EXPECT_EQ(RunCommandLine(line).exit_code, 0);
  EXPECT_EQ(ReadBytes(folder / "outline.json"), before);
  // ... but what a hand has changed is not.
  Json edited = ReadJson(folder / "outline.json");
  edited["buildings"][0]["footprint"][0][0] = -1.5;
  WriteBytes(folder / "outline.json", edited.dump(1));
  const CommandResult refused = RunCommandLine(line);
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_NE(refused.err.find("was edited"), std::string::npos) << refused.err;
  EXPECT_EQ(ReadBytes(folder / "outline.json"), edited.dump(1));

  // It is extruded as it stands, with the points and without; the wall that was moved off them is
  // noticed.
  const CommandResult judged =
      RunCommandLine("roomtex-outline --input_path " + (folder / "model") +
                     " --scale 1 --outline_path " + (folder / "outline.json") + " --output_path " +
                     (folder / "judged.json") + " --report_path " + (folder / "report.json"));
  EXPECT_EQ(ReadBytes(folder / "outline.json"), edited.dump(1)) << judged.err;
  const Json again = ReadJson(folder / "report.json");
  EXPECT_EQ(again["buildings"][0]["corners"][0]["x"], -1.5);
  for (int time = 0; time < 2; ++time) {
    const CommandResult alone = RunCommandLine(
        "roomtex-outline --outline_path " + (folder / "outline.json") + " --output_path " +
        (folder / "copy.json") + " --model_path " + (folder / "alone.city.json"));
    EXPECT_EQ(alone.exit_code, 0) << alone.err;
  }
  EXPECT_EQ(OutlineToJson(ReadOutline(folder / "copy.json")),
            OutlineToJson(ReadOutline(folder / "outline.json")));
  EXPECT_TRUE(std::filesystem::exists(folder / "alone.city.json"));
}

TEST(OutlineCommand, PutsBuildingsOnTheEarth) {
  const TempFolder folder;
  const SimulatedStreet street = MakeStreet({});
  WriteSparseModel(street.model, folder / "model");
  const std::string common = " --output_path " + (folder / "outline.json") + " --model_path " +
                             (folder / "b.geojson") + " --model_path " + (folder / "b.city.json") +
                             " --model_path " + (folder / "b.gml");
  const auto check = [&] {
    const GeoFrame frame({48.1, 11.6, 560});
    const Json features = ReadJson(folder / "b.geojson");
    EXPECT_FALSE(features.contains("note"));
    ASSERT_EQ(features["features"].size(), 4u);
    const Json& house = features["features"][0];
    EXPECT_NEAR(house["properties"]["ridge_height"].get<double>(), 566, 0.05);
    const Json& ring = house["geometry"]["coordinates"][0];
    ASSERT_EQ(ring.size(), 5u);
    EXPECT_EQ(ring[0], ring[4]);
    std::vector<Eigen::Vector2d> polygon;
    for (size_t i = 0; i < 4; ++i) {
      const Eigen::Vector3d x =
          frame.EnuFromGeo({ring[i][1].get<double>(), ring[i][0].get<double>(), 560});
      polygon.emplace_back(x.head<2>());
      double nearest = 100;
      for (const Eigen::Vector2d& corner : street.truth.buildings[0].footprint) {
        nearest = std::min(nearest, (x.head<2>() - corner).norm());
      }
      EXPECT_LT(nearest, 0.1);
    }
    EXPECT_GT(PolygonArea(polygon), 0);  // RFC 7946: counter-clockwise
    const Json city = ReadJson(folder / "b.city.json");
    EXPECT_EQ(city["metadata"]["referenceSystem"], "https://www.opengis.net/def/crs/EPSG/0/32632");
    pugi::xml_document gml;
    ASSERT_TRUE(gml.load_file((folder / "b.gml").c_str()));
    EXPECT_STREQ(gml.select_node("//gml:Envelope").node().attribute("srsName").value(),
                 "urn:ogc:def:crs:EPSG::32632");
    // Turned back from the map, the floor lies where the footprint of GeoJSON does, which is at the
    // house: a millimetre is the unit of CityJSON.
    const std::string name = house["properties"]["name"].get<std::string>();
    const double ground = house["properties"]["ground_height"].get<double>();
    EXPECT_NEAR(ground, 560 + street.truth.buildings[0].ground, 0.1);
    for (const auto& floor : {FloorOf(city, name), FloorOf(gml, name)}) {
      ASSERT_EQ(floor.size(), 4u);
      for (const Eigen::Vector2d& corner : polygon) {
        double nearest = 100;
        for (const Eigen::Vector3d& x : floor) {
          const Eigen::Vector3d x_in_enu = frame.EnuFromGrid(x.x(), x.y(), x.z());
          nearest = std::min(nearest, (x_in_enu.head<2>() - corner).norm());
          EXPECT_NEAR(x.z(), ground, 0.002);
        }
        EXPECT_LT(nearest, 0.001);  // measured: 0.6 mm
      }
    }
    // As high as the vertices are.
    const Json& attributes = city["CityObjects"]["building_" + name]["attributes"];
    EXPECT_NEAR(attributes["ridge_height"].get<double>(), 566, 0.05);
    EXPECT_NEAR(attributes["measured_height"].get<double>(),
                566 - attributes["ground_height"].get<double>(), 0.05);
    std::filesystem::remove(folder / "outline.json");
  };
  CommandResult result = RunCommandLine("roomtex-outline --input_path " + (folder / "model") +
                                        " --geo_origin 48.1,11.6,560" + common);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  check();

  // As roomtex-align says it: the scan frame lies turned about the place.
  const Rigid enu_from_scan{Eigen::Quaterniond(0.6, 0.1, -0.3, 0.7).normalized(), {100, -50, 7}};
  SparseModel aligned = street.model;
  const Rigid scan_from_enu = enu_from_scan.Inverse();
  TransformModel({1, scan_from_enu.rotation, scan_from_enu.translation}, &aligned);
  WriteSparseModel(aligned, folder / "aligned");
  Json alignment;
  alignment["trusted"] = true;
  alignment["reason"] = "";
  alignment["geo"] = {
      {"origin", {{"latitude", 48.1}, {"longitude", 11.6}, {"height", 560.0}}},
      {"enu_from_scan", ToJson(Similarity{1, enu_from_scan.rotation, enu_from_scan.translation})}};
  WriteBytes(folder / "aligned/alignment.json", alignment.dump());
  result = RunCommandLine("roomtex-outline --input_path " + (folder / "aligned") + common);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  check();

  for (const char* frame : {" --up 0,0,1", " --scale 2", " --geo_origin 48.1,11.6,560"}) {
    result =
        RunCommandLine("roomtex-outline --input_path " + (folder / "aligned") + frame + common);
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_NE(result.err.find("place on the Earth by itself"), std::string::npos) << result.err;
  }

  // Metres, without a place, too.
  MakeFolder(folder / "metres");
  WriteSparseModel(street.model, folder / "metres");
  WriteBytes(folder / "metres/alignment.json", R"({"trusted": true, "reason": ""})");
  result =
      RunCommandLine("roomtex-outline --input_path " + (folder / "metres") + " --scale 2" + common);
  EXPECT_EQ(result.exit_code, 2) << result.err;
  EXPECT_NE(result.err.find("in metres: leave --scale out"), std::string::npos) << result.err;

  // As COLMAP's model_aligner makes it: about the middle of the Earth.
  SparseModel earth = street.model;
  const Rigid ecef = GeoFrame({48.1, 11.6, 560}).EcefFromEnu();
  TransformModel({1, ecef.rotation, ecef.translation}, &earth);
  WriteSparseModel(earth, folder / "ecef");
  result = RunCommandLine("roomtex-outline --input_path " + (folder / "ecef") + common);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  check();

  // What stands on an alignment that is not trusted is not trusted.
  alignment["trusted"] = false;
  alignment["reason"] = "six picks contradict each other";
  WriteBytes(folder / "aligned/alignment.json", alignment.dump());
  result = RunCommandLine("roomtex-outline --input_path " + (folder / "aligned") + common);
  EXPECT_EQ(result.exit_code, 4);
  // Nor is it by way of its outline.
  const std::string again = "roomtex-outline --outline_path " + (folder / "outline.json") +
                            " --output_path " + (folder / "again.json") + " --model_path " +
                            (folder / "again.gml");
  result = RunCommandLine(again);
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_NE(result.err.find("six picks contradict"), std::string::npos) << result.err;
  result = RunCommandLine(again + " --accept_untrusted 1");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(std::filesystem::exists(folder / "again.gml"));

  // Nor is the model about the place, which roomtex-align writes into geo/, without a record of the
  // scans. North that nobody has said is told.
  WriteSparseModel(street.model, folder / "aligned/geo");
  Json geo;
  geo["origin"] = alignment["geo"]["origin"];
  geo["heading_assumed"] = true;
  geo["trusted"] = false;
  geo["reason"] = "six picks contradict each other";
  WriteBytes(folder / "aligned/geo/geo.json", geo.dump());
  const std::string of_geo = "roomtex-outline --input_path " + (folder / "aligned/geo") +
                             " --output_path " + (folder / "geo.json") + " --model_path " +
                             (folder / "geo.gml");
  result = RunCommandLine(of_geo);
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_NE(result.err.find("which way is north was assumed"), std::string::npos) << result.err;
  geo["trusted"] = true;
  geo["reason"] = "";
  WriteBytes(folder / "aligned/geo/geo.json", geo.dump());
  result = RunCommandLine(of_geo);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  result =
      RunCommandLine("roomtex-outline --outline_path " + (folder / "geo.json") + " --output_path " +
                     (folder / "copy.json") + " --report_path " + (folder / "report.json"));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(ReadJson(folder / "report.json")["warnings"].size(), 1u) << result.err;
}

// A house with a flat roof, 8 by 10 metres and 5 high.
OutlineBuilding FlatHouse(const std::string& name, const Eigen::Vector2d& at) {
  OutlineBuilding house;
  house.name = name;
  for (const Eigen::Vector2d& x : {Eigen::Vector2d(0, 0), Eigen::Vector2d(10, 0),
                                   Eigen::Vector2d(10, 8), Eigen::Vector2d(0, 8)}) {
    house.footprint.push_back(at + x);
  }
  house.roof = {{{at.x(), at.y(), 5}, 0, 0}};
  return house;
}

// Away from the origin the Earth falls away below the outline's plane: heights follow it.
TEST(OutlineCommand, GivesTheHeightsThatTheCornersHave) {
  const TempFolder folder;
  Outline outline;
  outline.metric = true;
  outline.geo.emplace(GeoPosition{48.1, 11.6, 500});
  outline.buildings = {FlatHouse("far", {3000, 0})};
  WriteOutline(folder / "o.json", outline, false);
  const CommandResult result = RunCommandLine(
      "roomtex-outline --outline_path " + (folder / "o.json") + " --output_path " +
      (folder / "p.json") + " --model_path " + (folder / "b.city.json") + " --model_path " +
      (folder / "b.gml") + " --model_path " + (folder / "b.geojson"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json city = ReadJson(folder / "b.city.json");
  const double ground = FloorOf(city, "far").at(0).z();
  EXPECT_NEAR(ground, 500.706, 0.01);
  for (const Json& attributes : {city["CityObjects"]["building_far"]["attributes"],
                                 ReadJson(folder / "b.geojson")["features"][0]["properties"]}) {
    EXPECT_NEAR(attributes["ground_height"].get<double>(), ground, 0.01);
    EXPECT_NEAR(attributes["eaves_height"].get<double>(), ground + 5, 0.01);
    EXPECT_NEAR(attributes["ridge_height"].get<double>(), ground + 5, 0.01);
    EXPECT_NEAR(attributes["measured_height"].get<double>(), 5, 1e-6);
  }
  pugi::xml_document gml;
  ASSERT_TRUE(gml.load_file((folder / "b.gml").c_str()));
  const char* const kGround = "//gen:doubleAttribute[@name='ground_height']/gen:value";
  EXPECT_NEAR(gml.select_node(kGround).node().text().as_double(), ground, 0.01);
}

TEST(OutlineCommand, CutsFootprintsAtTheAntimeridian) {
  const TempFolder folder;
  Outline outline;
  outline.metric = true;
  outline.geo.emplace(GeoPosition{-17, 180, 5});
  outline.buildings = {FlatHouse("both", {-4, 0}), FlatHouse("east", {30, 0})};
  WriteOutline(folder / "o.json", outline, false);
  const CommandResult result =
      RunCommandLine("roomtex-outline --outline_path " + (folder / "o.json") + " --output_path " +
                     (folder / "p.json") + " --model_path " + (folder / "b.geojson"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json features = ReadJson(folder / "b.geojson")["features"];
  EXPECT_EQ(features[1]["geometry"]["type"], "Polygon");
  ASSERT_EQ(features[0]["geometry"]["type"], "MultiPolygon");
  const GeoFrame frame(outline.geo->origin());
  double area = 0;
  for (const Json& part : features[0]["geometry"]["coordinates"]) {
    std::vector<Eigen::Vector2d> polygon;
    double low = 360, high = -360;
    for (const Json& x : part[0]) {
      low = std::min(low, x[0].get<double>()), high = std::max(high, x[0].get<double>());
      polygon.push_back(frame.EnuFromGeo({x[1], x[0], 5}).head<2>());
    }
    EXPECT_LT(high - low, 0.001);
    polygon.pop_back();
    EXPECT_GT(PolygonArea(polygon), 0);
    area += PolygonArea(polygon);
  }
  EXPECT_NEAR(area, 80, 0.05);
}

// An outline that was made without a place gets it later, as the note of its GeoJSON says.
TEST(OutlineCommand, GivesAnOutlineItsPlaceOnTheEarth) {
  const TempFolder folder;
  Outline outline;
  outline.metric = true;
  // Upright by the walls' word, moved.
  outline.outline_from_input = {
      1, Eigen::Quaterniond(Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitX())), {100, -20, 3}};
  outline.buildings = {FlatHouse("1", {0, 0})};
  WriteOutline(folder / "o.json", outline, false);
  const std::string line = "roomtex-outline --outline_path " + (folder / "o.json") +
                           " --output_path " + (folder / "p.json") + " --model_path " +
                           (folder / "b.geojson") + " --model_path " + (folder / "b.obj");
  for (int time = 0; time < 2; ++time) {
    const CommandResult result = RunCommandLine(line + " --geo_origin 48.1,11.5,500");
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }
  const Json house = ReadJson(folder / "b.geojson")["features"][0];
  const Json& corner = house["geometry"]["coordinates"][0][0];
  const Eigen::Vector3d expected = outline.outline_from_input.Inverse() * Eigen::Vector3d(0, 0, 0);
  const Eigen::Vector3d x = GeoFrame({48.1, 11.5, 500})
                                .EnuFromGeo({corner[1].get<double>(), corner[0].get<double>(),
                                             house["properties"]["ground_height"].get<double>()});
  EXPECT_LT((x - expected).norm(), 0.01);
  const Outline placed = ReadOutline(folder / "p.json");
  ASSERT_TRUE(placed.geo);
  EXPECT_EQ(placed.geo->origin().height, 500);

  const auto expect_refused = [&](const std::string& more, const std::string& finding) {
    const CommandResult result = RunCommandLine(line + more);
    EXPECT_EQ(result.exit_code, 2) << more << "\n" << result.err;
    EXPECT_NE(result.err.find(finding), std::string::npos) << more << "\n" << result.err;
  };
  for (const char* idle :
       {"--up 0,0,1", "--scale 2", "--area 0,0,1,1", "--min_area 3", "--right_angles 0"}) {
    expect_refused(std::string(" ") + idle, "says nothing here");
  }
  outline.metric = false;
  WriteOutline(folder / "o.json", outline, false);
  expect_refused(" --geo_origin 48.1,11.5,500", "metres");
  outline.metric = true;
  outline.outline_from_input.rotation =
      Eigen::AngleAxisd(1.5, Eigen::Vector3d::UnitX());  // a frame with y up
  WriteOutline(folder / "o.json", outline, false);
  expect_refused(" --geo_origin 48.1,11.5,500", "upright");
  outline.geo.emplace(GeoPosition{48.2, 11.5, 500});
  WriteOutline(folder / "o.json", outline, false);
  expect_refused(" --geo_origin 48.1,11.5,500", "another place");
}

// Millimetres would be coarse for a model on a table.
TEST(OutlineCommand, KeepsTheDigitsOfSmallThings) {
  const TempFolder folder;
  Outline outline;
  outline.metric = true;
  OutlineBuilding box = FlatHouse("a b", {0, 0});
  for (Eigen::Vector2d& x : box.footprint) x = 0.03456 * x;
  box.roof[0].point.z() = 0.12345;
  OutlineBuilding other = box;
  other.name = "a_b";
  for (Eigen::Vector2d& x : other.footprint) x.x() += 0.5;
  outline.buildings = {box, other};
  WriteOutline(folder / "o.json", outline, false);
  const CommandResult result =
      RunCommandLine("roomtex-outline --outline_path " + (folder / "o.json") + " --output_path " +
                     (folder / "p.json") + " --model_path " + (folder / "b.city.json") +
                     " --model_path " + (folder / "b.gml") + " --model_path " + (folder / "b.obj"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  pugi::xml_document gml;
  ASSERT_TRUE(gml.load_file((folder / "b.gml").c_str()));
  for (const auto& floor :
       {FloorOf(ReadJson(folder / "b.city.json"), "a b"), FloorOf(gml, "a b")}) {
    double right = 0;
    for (const Eigen::Vector3d& x : floor) right = std::max(right, x.x());
    EXPECT_NEAR(right, 0.3456, 1e-5);
  }
  const std::string obj = ReadBytes(folder / "b.obj");
  EXPECT_NE(obj.find("o building_a_b\n"), std::string::npos);
  EXPECT_NE(obj.find("o building_a_b_\n"), std::string::npos);
}

TEST(OutlineCommand, SaysWhatIsWrong) {
  const TempFolder folder;
  const auto expect = [&](const std::string& arguments, int exit_code, const std::string& text) {
    const CommandResult result = RunCommandLine("roomtex-outline " + arguments);
    EXPECT_EQ(result.exit_code, exit_code) << arguments << "\n" << result.err;
    EXPECT_NE(result.err.find(text), std::string::npos) << arguments << "\n" << result.err;
    EXPECT_EQ(result.out, "");
  };
  const std::string out = " --output_path " + (folder / "o.json");
  expect(out, 2, "--input_path");
  expect("--input_path none" + out, 3, "none");
  expect("--input_path none --model_path b.dae" + out, 2, "b.dae must end with");
  expect("--input_path none --up 0,0" + out, 2, "--up must be three numbers");
  expect("--input_path none --area 3,0,1,1" + out, 2, "--area must be");
  expect("--input_path none --geo_origin 100,0,0" + out, 2, "--geo_origin must be");
  WriteBytes(folder / "cloud.xyz", "0 0 0\n1 0 0\n0 1 0\n");
  expect("--input_path " + (folder / "cloud.xyz") + out, 3, "too few");
  EXPECT_FALSE(std::filesystem::exists(folder / "o.json"));
  // Points without any building: an answer, but none to trust.
  std::ostringstream noise;
  for (int i = 0; i < 400; ++i)
    noise << (i * 37 % 101) << " " << (i * 53 % 97) << " " << (i * 71 % 89) << "\n";
  WriteBytes(folder / "noise.xyz", noise.str());
  const CommandResult nothing =
      RunCommandLine("roomtex-outline --input_path " + (folder / "noise.xyz") + out);
  EXPECT_EQ(nothing.exit_code, 4) << nothing.err;
  EXPECT_NE(nothing.err.find("no building was found"), std::string::npos) << nothing.err;

  // Files that hands have broken.
  Outline outline = MakeStreet({}).truth;
  const std::string broken = folder / "broken.json";
  const auto expect_broken = [&](const std::string& text, const std::string& finding) {
    WriteBytes(broken, text);
    expect("--outline_path " + broken + " --output_path " + (folder / "p.json"), 3, finding);
  };
  const Json good = OutlineToJson(outline);
  expect_broken("{\"format\":", "is no JSON");
  expect_broken("{}", "is no outline");
  Json bad = good;
  bad["buildings"][1]["footprint"][2] = {10.0, 5.0};
  expect_broken(bad.dump(), "building 2 (\"2\"): the footprint crosses or touches itself");
  bad = good;
  bad["buildings"][0]["roof"][0]["point"][2] = -3.0;
  expect_broken(bad.dump(), "the roof does not lie above the ground");
  bad = good;
  bad["buildings"][0]["roof"][0]["slope_deg"] = "steep";
  expect_broken(bad.dump(), "roof plane 1 slope_deg: must be a number");
  bad = good;
  bad["buildings"][2]["name"] = "1";
  expect_broken(bad.dump(), "has the name of another one");
  bad["buildings"][2]["name"] = "a\x01";
  expect_broken(bad.dump(), "control character");
  bad = good;
  bad["alignment"] = {{"trusted", "no"}};
  expect_broken(bad.dump(), "alignment: lacks \"reason\"");
}

TEST(OutlineCommand, ListsAndChecksItsOptions) {
  OutlineInputOptions input;
  ProposalOptions proposal;
  std::vector<OptionFields> fields = {FieldsOf(&input), FieldsOf(&proposal)};
#ifdef ROOMTEX_PAGES
  LocalServerOptions server;
  fields.push_back(FieldsOf(&server));
#endif
  ExpectChecksItsOptions("roomtex-outline", "--input_path none --output_path none/none", fields);
}

}  // namespace
}  // namespace roomtex
