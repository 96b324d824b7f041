#include "building/building_output.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <set>
#include <tuple>

#include <fmt/core.h>
#include <pugixml.hpp>
#include <tiny_gltf.h>

#include "building/building_solid.h"
#include "building/cell_arrangement.h"
#include "core/error.h"
#include "core/output_file.h"
#include "core/text.h"

namespace roomtex {
namespace {

using FaceKind = SolidFace::Kind;

const char* SurfaceName(FaceKind kind) {
  switch (kind) {
    case FaceKind::kGround:
      return "GroundSurface";
    case FaceKind::kRoof:
      return "RoofSurface";
    default:
      return "WallSurface";
  }
}

// Of the outline's level 0 above the ellipsoid, at the building: the Earth falls away below the
// plane that the outline lies in. 0 where it lies on no Earth.
double HeightOfLevel(const Outline& outline, const OutlineBuilding& building) {
  if (!outline.geo) return 0;
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector2d& corner : building.footprint) box.extend(corner);
  const Eigen::Vector2d centre = box.center();
  return outline.geo->GeoFromEnu({centre.x(), centre.y(), 0}).height;
}

// What GIS programs show of a building. height: of the outline's level 0 in what is written.
Json AttributesOf(const OutlineBuilding& building, const BuildingSolid& solid, double height) {
  const auto [eaves, ridge] = solid.RoofHeights();
  Json json;
  json["ground_height"] = height + building.ground;
  json["eaves_height"] = height + eaves;
  json["ridge_height"] = height + ridge;
  json["measured_height"] = ridge - building.ground;
  json["roof"] = building.RoofShape();
  json["footprint_area"] = PolygonArea(building.footprint);
  json["volume"] = solid.Volume();
  return json;
}

// Where GIS programs want the vertices, and what that is called.
struct MapFrame {
  int epsg = 0;  // 0 = the outline's own coordinates
  std::function<Eigen::Vector3d(const Eigen::Vector3d&)> from_outline;
};

MapFrame MapFrameOf(const Outline& outline) {
  MapFrame frame;
  frame.from_outline = [](const Eigen::Vector3d& x) { return x; };
  if (!outline.geo || !outline.geo->GridFromEnu(Eigen::Vector3d::Zero())) return frame;
  const GeoFrame& geo = *outline.geo;
  frame.epsg = geo.GridOfOrigin().EpsgCode();
  frame.from_outline = [geo](const Eigen::Vector3d& x) -> Eigen::Vector3d {
    const auto grid = geo.GridFromEnu(x);
    if (!grid) {
      throw InputError("outline", "", "a building lies too far from its place on the Earth for UTM",
                       "Check the coordinates of its footprint");
    }
    return {grid->easting, grid->northing, geo.GeoFromEnu(x).height};
  };
  return frame;
}

// A building as it is written in the frame of a map; its attributes are those of the outline.
struct MappedBuilding {
  const OutlineBuilding* building;
  Json attributes;
  BuildingSolid solid;
};
std::vector<MappedBuilding> OnTheMap(const Outline& outline, const MapFrame& map) {
  std::vector<MappedBuilding> buildings;
  for (const OutlineBuilding& building : outline.buildings) {
    BuildingSolid solid = ExtrudeBuilding(building);
    const double height = map.epsg == 0 ? 0 : HeightOfLevel(outline, building);
    const Json attributes = AttributesOf(building, solid, height);
    for (Eigen::Vector3d& vertex : solid.vertices) vertex = map.from_outline(vertex);
    buildings.push_back({&building, attributes, std::move(solid)});
  }
  return buildings;
}
// The last digit that is written: a millimetre, and less of small things, which keep their digits.
double UnitFor(const Eigen::AlignedBox3d& box) {
  constexpr double kMillimetre = 0.001;
  const double size = box.isEmpty() ? 0 : box.diagonal().norm();
  return size > 0 ? std::min(kMillimetre, std::pow(10, std::floor(std::log10(size / 1e5))))
                  : kMillimetre;
}
Eigen::AlignedBox3d BoxOf(const std::vector<MappedBuilding>& buildings) {
  Eigen::AlignedBox3d box;
  for (const MappedBuilding& one : buildings) {
    for (const Eigen::Vector3d& vertex : one.solid.vertices) box.extend(vertex);
  }
  return box;
}

// --- OBJ

void WriteBuildingsObj(const std::string& path, const Outline& outline) {
  OutputFile file(path);
  const Similarity input_from_outline = outline.outline_from_input.Inverse();
  const Eigen::Vector3d up = input_from_outline.rotation * Eigen::Vector3d::UnitZ();
  std::ostream& stream = file.stream();
  stream << "# roomtex-outline: buildings in the frame of the points that they were made from\n"
         << fmt::format("# up {} {} {}\n", Exact(up.x()), Exact(up.y()), Exact(up.z()));
  int first = 1;
  std::set<std::string> names;
  for (const OutlineBuilding& building : outline.buildings) {
    const BuildingSolid solid = ExtrudeBuilding(building);
    std::string name = building.name;
    std::replace_if(
        name.begin(), name.end(), [](unsigned char c) { return c <= ' '; }, '_');
    while (!names.insert(name).second) name += '_';  // "a b" beside "a_b"
    stream << "o building_" << name << "\n";
    for (const Eigen::Vector3d& vertex : solid.vertices) {
      const Eigen::Vector3d x = input_from_outline * vertex;
      stream << fmt::format("v {} {} {}\n", Number(x.x(), 6), Number(x.y(), 6), Number(x.z(), 6));
    }
    FaceKind last = FaceKind::kGround;
    bool any = false;
    for (const SolidFace& face : solid.faces) {
      if (!any || face.kind != last)
        stream << "g " << SurfaceName(face.kind) << "_" << name << "\n";
      any = true;
      last = face.kind;
      for (const Triangle& t : TrianglesOf(solid, face)) {
        stream << fmt::format("f {} {} {}\n", first + t[0], first + t[1], first + t[2]);
      }
    }
    first += static_cast<int>(solid.vertices.size());
  }
  file.Commit();
}

// --- GLB

class BuildingGlb {
 public:
  BuildingGlb() {
    model_.asset.version = "2.0";
    model_.asset.generator = "roomtex-outline";
    model_.buffers.emplace_back();
    model_.nodes.emplace_back();
    model_.nodes[0].name = "outline frame, turned to +Y up";
    const double half = std::sqrt(0.5);
    model_.nodes[0].rotation = {-half, 0, 0, half};  // x y z w: z up becomes y up
    tinygltf::Scene scene;
    scene.nodes = {0};
    model_.scenes = {scene};
    model_.defaultScene = 0;
    const auto add = [this](const char* name, double r, double g, double b) {
      tinygltf::Material material;
      material.name = name;
      material.pbrMetallicRoughness.baseColorFactor = {r, g, b, 1};
      material.pbrMetallicRoughness.metallicFactor = 0;
      material.pbrMetallicRoughness.roughnessFactor = 1;
      model_.materials.push_back(material);
    };
    add("ground", 0.30, 0.30, 0.28);
    add("roof", 0.48, 0.16, 0.11);
    add("wall", 0.72, 0.68, 0.60);
  }

  void Add(const OutlineBuilding& building) {
    const BuildingSolid solid = ExtrudeBuilding(building);
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& vertex : solid.vertices) box.extend(vertex);
    const Eigen::Vector3d centre = box.center();
    tinygltf::Mesh mesh;
    mesh.name = building.name;
    for (const FaceKind kind : {FaceKind::kGround, FaceKind::kRoof, FaceKind::kWall}) {
      std::vector<float> positions, normals;
      for (const SolidFace& face : solid.faces) {
        if (face.kind != kind) continue;
        for (const Triangle& t : TrianglesOf(solid, face))
          AddTriangle(solid, t, centre, &positions, &normals);
      }
      if (positions.empty()) continue;
      tinygltf::Primitive primitive;
      primitive.mode = TINYGLTF_MODE_TRIANGLES;
      primitive.material = static_cast<int>(kind);
      primitive.attributes["POSITION"] = AddVectors(positions, true);
      primitive.attributes["NORMAL"] = AddVectors(normals, false);
      mesh.primitives.push_back(primitive);
    }
    tinygltf::Node node;
    node.name = "building " + building.name;
    node.mesh = static_cast<int>(model_.meshes.size());
    node.translation = {centre.x(), centre.y(), centre.z()};
    model_.meshes.push_back(mesh);
    model_.nodes[0].children.push_back(static_cast<int>(model_.nodes.size()));
    model_.nodes.push_back(node);
  }

  void Write(const std::string& path) {
    OutputFile file(path);
    tinygltf::TinyGLTF writer;
    if (!writer.WriteGltfSceneToStream(&model_, file.stream(), false, true)) {
      throw InputError(path, "", "could not be written as GLB", "Check that the disk is not full");
    }
    file.Commit();
  }

 private:
  static void AddTriangle(const BuildingSolid& solid, const Triangle& t,
                          const Eigen::Vector3d& centre, std::vector<float>* positions,
                          std::vector<float>* normals) {
    const auto at = [&](int k) {
      return solid.vertices[static_cast<size_t>(t[static_cast<size_t>(k)])];
    };
    const Eigen::Vector3d normal = (at(1) - at(0)).cross(at(2) - at(0)).normalized();
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d x = at(k) - centre;
      for (int axis = 0; axis < 3; ++axis) {
        positions->push_back(static_cast<float>(x[axis]));
        normals->push_back(static_cast<float>(normal[axis]));
      }
    }
  }

  int AddVectors(const std::vector<float>& values, bool bounds) {
    auto& data = model_.buffers[0].data;
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = data.size();
    view.byteLength = values.size() * sizeof(float);
    view.target = TINYGLTF_TARGET_ARRAY_BUFFER;
    const auto* bytes = reinterpret_cast<const unsigned char*>(values.data());
    data.insert(data.end(), bytes, bytes + view.byteLength);
    tinygltf::Accessor accessor;
    accessor.bufferView = static_cast<int>(model_.bufferViews.size());
    accessor.componentType = TINYGLTF_COMPONENT_TYPE_FLOAT;
    accessor.type = TINYGLTF_TYPE_VEC3;
    accessor.count = values.size() / 3;
    if (bounds) {
      accessor.minValues.assign(3, std::numeric_limits<double>::infinity());
      accessor.maxValues.assign(3, -std::numeric_limits<double>::infinity());
      for (size_t i = 0; i < values.size(); ++i) {
        accessor.minValues[i % 3] = std::min(accessor.minValues[i % 3], double{values[i]});
        accessor.maxValues[i % 3] = std::max(accessor.maxValues[i % 3], double{values[i]});
      }
    }
    model_.bufferViews.push_back(view);
    model_.accessors.push_back(accessor);
    return static_cast<int>(model_.accessors.size()) - 1;
  }

  tinygltf::Model model_;
};

// --- CityJSON

void WriteCityJson(const std::string& path, const Outline& outline) {
  const MapFrame map = MapFrameOf(outline);
  Json json;
  json["type"] = "CityJSON";
  json["version"] = "2.0";
  json["transform"] = nullptr;
  json["metadata"] = Json::object();
  if (map.epsg != 0) {
    json["metadata"]["referenceSystem"] =
        "https://www.opengis.net/def/crs/EPSG/0/" + std::to_string(map.epsg);
  }
  json["CityObjects"] = Json::object();
  const std::vector<MappedBuilding> buildings = OnTheMap(outline, map);
  const Eigen::AlignedBox3d box = BoxOf(buildings);
  const Eigen::Vector3d origin =
      box.isEmpty() ? Eigen::Vector3d::Zero() : Eigen::Vector3d(box.min().array().floor());
  const double unit = UnitFor(box);
  json["transform"] = {{"scale", {unit, unit, unit}},
                       {"translate", {origin.x(), origin.y(), origin.z()}}};
  std::map<std::tuple<int64_t, int64_t, int64_t>, int> index;
  Json vertices = Json::array();
  const auto vertex_at = [&](const Eigen::Vector3d& x) {
    const Eigen::Vector3d at = (x - origin) / unit;
    const std::tuple<int64_t, int64_t, int64_t> key(std::llround(at.x()), std::llround(at.y()),
                                                    std::llround(at.z()));
    const auto [found, is_new] = index.emplace(key, static_cast<int>(vertices.size()));
    if (is_new) vertices.push_back({std::get<0>(key), std::get<1>(key), std::get<2>(key)});
    return found->second;
  };
  for (const auto& [building, attributes, solid] : buildings) {
    Json shell = Json::array(), values = Json::array(), surfaces = Json::array();
    for (const FaceKind kind : {FaceKind::kGround, FaceKind::kRoof, FaceKind::kWall}) {
      surfaces.push_back({{"type", SurfaceName(kind)}});
    }
    for (const SolidFace& face : solid.faces) {
      Json ring = Json::array();
      for (const Eigen::Vector3d& corner : solid.CornersOf(face)) ring.push_back(vertex_at(corner));
      shell.push_back(Json::array({ring}));
      values.push_back(static_cast<int>(face.kind));
    }
    Json geometry;
    geometry["type"] = "Solid";
    geometry["lod"] = "2";
    geometry["boundaries"] = Json::array({shell});
    geometry["semantics"] = {{"surfaces", surfaces}, {"values", Json::array({values})}};
    Json object;
    object["type"] = "Building";
    object["attributes"] = attributes;
    object["geometry"] = Json::array({geometry});
    json["CityObjects"]["building_" + building->name] = object;
  }
  if (!box.isEmpty()) {
    json["metadata"]["geographicalExtent"] = {box.min().x(), box.min().y(), box.min().z(),
                                              box.max().x(), box.max().y(), box.max().z()};
  }
  json["vertices"] = vertices;
  OutputFile file(path);
  file.stream() << json.dump() << "\n";
  file.Commit();
}

// --- CityGML

std::string PositionsOf(const std::vector<Eigen::Vector3d>& corners, int digits) {
  std::string text;
  for (size_t i = 0; i <= corners.size(); ++i) {
    const Eigen::Vector3d& x = corners[i % corners.size()];  // a ring ends where it began
    if (!text.empty()) text += ' ';
    text += Number(x.x(), digits) + ' ' + Number(x.y(), digits) + ' ' + Number(x.z(), digits);
  }
  return text;
}

void AddMeasure(pugi::xml_node* building, const char* name, double value) {
  pugi::xml_node attribute = building->append_child("gen:doubleAttribute");
  attribute.append_attribute("name") = name;
  attribute.append_child("gen:value").text() = Number(value, 3).c_str();
}

// The model's root element.
pugi::xml_node AppendCity(pugi::xml_document* document) {
  pugi::xml_node declaration = document->append_child(pugi::node_declaration);
  declaration.append_attribute("version") = "1.0";
  declaration.append_attribute("encoding") = "UTF-8";
  pugi::xml_node city = document->append_child("core:CityModel");
  const std::pair<const char*, const char*> namespaces[] = {
      {"xmlns:core", "http://www.opengis.net/citygml/2.0"},
      {"xmlns:bldg", "http://www.opengis.net/citygml/building/2.0"},
      {"xmlns:gen", "http://www.opengis.net/citygml/generics/2.0"},
      {"xmlns:gml", "http://www.opengis.net/gml"},
      {"xmlns:xlink", "http://www.w3.org/1999/xlink"},
      {"xmlns:xsi", "http://www.w3.org/2001/XMLSchema-instance"},
      {"xsi:schemaLocation",
       "http://www.opengis.net/citygml/building/2.0 "
       "http://schemas.opengis.net/citygml/building/2.0/building.xsd "
       "http://www.opengis.net/citygml/generics/2.0 "
       "http://schemas.opengis.net/citygml/generics/2.0/generics.xsd"},
  };
  for (const auto& [name, value] : namespaces) city.append_attribute(name) = value;
  return city;
}

void AppendEnvelope(const Eigen::AlignedBox3d& box, int epsg, int digits, pugi::xml_node* city) {
  if (box.isEmpty()) return;
  pugi::xml_node envelope = city->append_child("gml:boundedBy").append_child("gml:Envelope");
  if (epsg != 0) {
    envelope.append_attribute("srsName") =
        ("urn:ogc:def:crs:EPSG::" + std::to_string(epsg)).c_str();
  }
  envelope.append_attribute("srsDimension") = 3;
  const auto corner = [digits](const Eigen::Vector3d& x) {
    return Number(x.x(), digits) + ' ' + Number(x.y(), digits) + ' ' + Number(x.z(), digits);
  };
  envelope.append_child("gml:lowerCorner").text() = corner(box.min()).c_str();
  envelope.append_child("gml:upperCorner").text() = corner(box.max()).c_str();
}

// The solid names its surfaces, which follow with what they are.
void AppendSurfaces(const BuildingSolid& solid, const std::string& id, int digits,
                    pugi::xml_node* building) {
  pugi::xml_node composite = building->append_child("bldg:lod2Solid")
                                 .append_child("gml:Solid")
                                 .append_child("gml:exterior")
                                 .append_child("gml:CompositeSurface");
  int face_number = 0;
  for (const SolidFace& face : solid.faces) {
    const std::string face_id = id + "_" + std::to_string(++face_number);
    composite.append_child("gml:surfaceMember").append_attribute("xlink:href") =
        ("#" + face_id).c_str();
    pugi::xml_node polygon =
        building->append_child("bldg:boundedBy")
            .append_child((std::string("bldg:") + SurfaceName(face.kind)).c_str())
            .append_child("bldg:lod2MultiSurface")
            .append_child("gml:MultiSurface")
            .append_child("gml:surfaceMember")
            .append_child("gml:Polygon");
    polygon.append_attribute("gml:id") = face_id.c_str();
    pugi::xml_node positions = polygon.append_child("gml:exterior")
                                   .append_child("gml:LinearRing")
                                   .append_child("gml:posList");
    positions.append_attribute("srsDimension") = 3;
    positions.text() = PositionsOf(solid.CornersOf(face), digits).c_str();
  }
}

void WriteCityGml(const std::string& path, const Outline& outline) {
  const MapFrame map = MapFrameOf(outline);
  const std::vector<MappedBuilding> buildings = OnTheMap(outline, map);
  const int digits = 1 - static_cast<int>(std::lround(std::log10(UnitFor(BoxOf(buildings)))));
  pugi::xml_document document;
  pugi::xml_node city = AppendCity(&document);
  AppendEnvelope(BoxOf(buildings), map.epsg, digits, &city);
  int building_number = 0;
  for (const auto& [building, attributes, solid] : buildings) {
    const std::string id = "b" + std::to_string(++building_number);
    pugi::xml_node node = city.append_child("core:cityObjectMember").append_child("bldg:Building");
    node.append_attribute("gml:id") = id.c_str();
    node.append_child("gml:name").text() = building->name.c_str();
    for (const char* name :
         {"ground_height", "eaves_height", "ridge_height", "footprint_area", "volume"}) {
      AddMeasure(&node, name, attributes[name].get<double>());
    }
    pugi::xml_node measured = node.append_child("bldg:measuredHeight");
    measured.append_attribute("uom") = outline.metric ? "m" : "1";
    measured.text() = Number(attributes["measured_height"].get<double>(), 3).c_str();
    AppendSurfaces(solid, id, digits, &node);
  }
  OutputFile file(path);
  document.save(file.stream(), "  ");
  file.Commit();
}

// --- GeoJSON

using Ring = std::vector<Eigen::Vector2d>;  // longitude and latitude, or x and y

// What of it lies where sign * (x - limit) <= 0 (Sutherland, Hodgman 1974).
Ring CutAt(const Ring& ring, double limit, double sign) {
  Ring kept;
  for (size_t i = 0; i < ring.size(); ++i) {
    const Eigen::Vector2d &a = ring[i], &b = ring[(i + 1) % ring.size()];
    const double da = sign * (a.x() - limit), db = sign * (b.x() - limit);
    if (da <= 0) kept.push_back(a);
    if (da * db < 0) kept.emplace_back(limit, a.y() + da / (da - db) * (b.y() - a.y()));
  }
  return kept;
}

Json RingToJson(const Ring& ring) {
  Json json = Json::array();
  for (size_t i = 0; i <= ring.size(); ++i) {
    const Eigen::Vector2d& x = ring[i % ring.size()];
    json.push_back({x.x(), x.y()});
  }
  return json;
}

Json FootprintToGeoJson(const Outline& outline, const OutlineBuilding& building) {
  Ring ring = building.footprint;
  double low = 0, high = 0;
  if (outline.geo) {
    for (Eigen::Vector2d& corner : ring) {
      const GeoPosition position =
          outline.geo->GeoFromEnu({corner.x(), corner.y(), building.ground});
      // A tenth of a millimetre.
      const auto rounded = [](double degrees) { return std::round(degrees * 1e9) / 1e9; };
      corner = {rounded(position.longitude_deg), rounded(position.latitude_deg)};
      low = std::min(low, corner.x()), high = std::max(high, corner.x());
    }
  }
  if (high - low <= 180) {
    return {{"type", "Polygon"}, {"coordinates", Json::array({RingToJson(ring)})}};
  }
  // Across the antimeridian: cut there, else it would go around the Earth (RFC 7946, 3.1.9).
  for (Eigen::Vector2d& corner : ring) corner.x() += corner.x() < 0 ? 360 : 0;
  Ring east = CutAt(ring, 180, 1), west = CutAt(ring, 180, -1);
  for (Eigen::Vector2d& corner : west) corner.x() -= 360;
  Json parts = Json::array();
  for (const Ring& part : {east, west}) {
    if (part.size() >= 3) parts.push_back(Json::array({RingToJson(part)}));
  }
  return {{"type", "MultiPolygon"}, {"coordinates", parts}};
}

void WriteGeoJson(const std::string& path, const Outline& outline) {
  Json json;
  json["type"] = "FeatureCollection";
  if (!outline.geo) {
    json["note"] = std::string("These coordinates are no longitudes and latitudes: x and y in ") +
                   outline.Unit() +
                   ", in the frame of outline.json. The model has no place on the Earth; "
                   "roomtex-outline --geo_origin gives it one.";
  }
  json["features"] = Json::array();
  for (const OutlineBuilding& building : outline.buildings) {
    Json named;
    named["name"] = building.name;
    named.update(
        AttributesOf(building, ExtrudeBuilding(building), HeightOfLevel(outline, building)));
    Json feature;
    feature["type"] = "Feature";
    feature["properties"] = named;
    feature["geometry"] = FootprintToGeoJson(outline, building);
    json["features"].push_back(feature);
  }
  WriteJson(path, json);
}

bool EndsWith(const std::string& text, const std::string& end) {
  if (text.size() < end.size()) return false;
  return std::equal(end.rbegin(), end.rend(), text.rbegin(), [](char a, char b) {
    return a == std::tolower(static_cast<unsigned char>(b));
  });
}

using BuildingWriter = void (*)(const std::string&, const Outline&);

void WriteBuildingsGlb(const std::string& path, const Outline& outline) {
  BuildingGlb glb;
  for (const OutlineBuilding& building : outline.buildings) glb.Add(building);
  glb.Write(path);
}

BuildingWriter WriterOf(const std::string& path) {
  static const std::pair<const char*, BuildingWriter> kWriters[] = {
      {".obj", WriteBuildingsObj},  {".glb", WriteBuildingsGlb}, {".city.json", WriteCityJson},
      {".cityjson", WriteCityJson}, {".gml", WriteCityGml},      {".citygml", WriteCityGml},
      {".geojson", WriteGeoJson},
  };
  for (const auto& [extension, writer] : kWriters) {
    if (EndsWith(path, extension)) return writer;
  }
  return nullptr;
}

}  // namespace

const char* BuildingExtensions() { return ".glb, .obj, .city.json, .gml or .geojson"; }
bool IsBuildingPath(const std::string& path) { return WriterOf(path) != nullptr; }

void WriteBuildings(const std::string& path, const Outline& outline) {
  const BuildingWriter writer = WriterOf(path);
  if (writer == nullptr) {
    throw UsageError(path + " ends with no extension of a building model: " + BuildingExtensions());
  }
  writer(path, outline);
}

}  // namespace roomtex
