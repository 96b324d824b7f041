#include "importers/e57_document.h"

#include <charconv>
#include <cmath>
#include <cstdlib>
#include <limits>

#include <pugixml.hpp>

#include "core/error.h"
#include "core/frames.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr int kDeepestPrototype = 8;  // structures in structures
constexpr size_t kMostFields = 4096;  // of one record

std::string_view WithoutBlanks(std::string_view text) {
  const size_t first = text.find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r\n") - first + 1);
}

// Whatever the locale says. "" is zero, as in E57.
std::optional<double> ParseNumber(std::string_view text) {
  text = WithoutBlanks(text);
  if (text.empty()) return 0.0;
  if (text[0] == '+') text.remove_prefix(1);
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (end != text.data() + text.size()) return std::nullopt;
  if (error == std::errc::result_out_of_range)
    return std::strtod(std::string(text).c_str(), nullptr);
  if (error != std::errc()) return std::nullopt;
  return number;
}

std::optional<int64_t> ParseInteger(std::string_view text) {
  text = WithoutBlanks(text);
  if (text.empty()) return 0;
  if (text[0] == '+') text.remove_prefix(1);
  int64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc() && end == text.data() + text.size()) return number;
  // Some write whole numbers as 2.55e+002.
  const std::optional<double> real = ParseNumber(text);
  if (!real || *real != std::floor(*real) || !(std::abs(*real) < 9.2e18)) return std::nullopt;
  return static_cast<int64_t>(*real);
}

class DocumentParser {
 public:
  explicit DocumentParser(const E57Pages& pages) : pages_(pages) {}

  E57Document Parse() {
    std::string xml(static_cast<size_t>(pages_.xml_size()), '\0');
    pages_.Read(pages_.xml_offset(), xml.data(), pages_.xml_size());
    // pugixml reads neither document types nor external entities.
    pugi::xml_document tree;
    const pugi::xml_parse_result result =
        tree.load_buffer(xml.data(), xml.size(), pugi::parse_default, pugi::encoding_utf8);
    if (!result) {
      throw ErrorAt(result.offset,
                    std::string("the XML cannot be read here: ") + result.description());
    }
    const pugi::xml_node root = tree.child("e57Root");
    if (!root) throw ErrorAt(0, "the XML has no element e57Root");
    E57Document document;
    for (const pugi::xml_node node : root.child("data3D").children("vectorChild")) {
      document.scans.push_back(ParseScan(node));
    }
    for (const pugi::xml_node node : root.child("images2D").children("vectorChild")) {
      document.images.push_back(ParseImage(node));
    }
    return document;
  }

 private:
  InputError ErrorAt(std::ptrdiff_t offset_in_xml, const std::string& finding) const {
    const int64_t offset =
        std::clamp<int64_t>(offset_in_xml, 0, std::max<int64_t>(0, pages_.xml_size() - 1));
    return InputError(pages_.path(), pages_.Position(pages_.xml_offset() + offset), finding,
                      kDamaged);
  }
  InputError Error(const pugi::xml_node& node, const std::string& finding) const {
    return ErrorAt(node.offset_debug(), finding);
  }

  double Number(const pugi::xml_node& node) const {
    const std::optional<double> number = ParseNumber(node.child_value());
    if (!number || !std::isfinite(*number)) {
      throw Error(node, std::string("element ") + node.name() + " is " +
                            Quoted(std::string(node.child_value())) + ", expected a number");
    }
    return *number;
  }

  // Of an element that may be missing, then the number `otherwise`.
  double NumberIn(const pugi::xml_node& parent, const char* name, double otherwise = 0) const {
    const pugi::xml_node node = parent.child(name);
    return node ? Number(node) : otherwise;
  }

  int64_t Integer(const pugi::xml_node& node) const {
    const std::optional<int64_t> number = ParseInteger(node.child_value());
    if (!number) {
      throw Error(node, std::string("element ") + node.name() + " is " +
                            Quoted(std::string(node.child_value())) + ", expected a whole number");
    }
    return *number;
  }

  int64_t IntegerAttribute(const pugi::xml_node& node, const char* name, int64_t otherwise) const {
    const pugi::xml_attribute attribute = node.attribute(name);
    if (!attribute) return otherwise;
    const std::optional<int64_t> number = ParseInteger(attribute.value());
    if (!number) {
      throw Error(node, std::string("attribute ") + name + " of " + node.name() + " is " +
                            Quoted(std::string(attribute.value())) + ", expected a whole number");
    }
    return *number;
  }

  double NumberAttribute(const pugi::xml_node& node, const char* name, double otherwise) const {
    const pugi::xml_attribute attribute = node.attribute(name);
    if (!attribute) return otherwise;
    const std::optional<double> number = ParseNumber(attribute.value());
    if (!number || !std::isfinite(*number)) {
      throw Error(node, std::string("attribute ") + name + " of " + node.name() + " is " +
                            Quoted(std::string(attribute.value())) + ", expected a number");
    }
    return *number;
  }

  // A number of any of the three types.
  double Value(const pugi::xml_node& node) const {
    if (std::string_view(node.attribute("type").value()) != "ScaledInteger") return Number(node);
    return Number(node) * NumberAttribute(node, "scale", 1) + NumberAttribute(node, "offset", 0);
  }

  // Rotation, translation or both may be missing.
  Rigid ParsePose(const pugi::xml_node& node) const {
    Rigid pose;
    const pugi::xml_node rotation = node.child("rotation"), translation = node.child("translation");
    if (rotation) {
      const Eigen::Quaterniond q(NumberIn(rotation, "w"), NumberIn(rotation, "x"),
                                 NumberIn(rotation, "y"), NumberIn(rotation, "z"));
      const double norm = q.norm();
      if (!(norm > 1e-6) || !std::isfinite(norm)) {
        throw Error(rotation, "the rotation of a pose is the quaternion 0");
      }
      pose.rotation = q.normalized();
    }
    pose.translation = {NumberIn(translation, "x"), NumberIn(translation, "y"),
                        NumberIn(translation, "z")};
    return pose;
  }

  std::optional<E57Limits> ParseLimits(const pugi::xml_node& parent,
                                       const std::string& name) const {
    const pugi::xml_node low = parent.child((name + "Minimum").c_str());
    const pugi::xml_node high = parent.child((name + "Maximum").c_str());
    if (!low || !high) return std::nullopt;
    const E57Limits limits{Value(low), Value(high)};
    if (!(limits.minimum < limits.maximum)) return std::nullopt;
    return limits;
  }

  E57Scan ParseScan(const pugi::xml_node& node) const {
    E57Scan scan;
    scan.name = node.child_value("name");
    scan.guid = node.child_value("guid");
    if (const pugi::xml_node pose = node.child("pose")) scan.file_from_scan = ParsePose(pose);
    if (const pugi::xml_node bounds = node.child("indexBounds")) {
      const auto bound = [&](const char* name) { return Integer(bounds.child(name)); };
      if (bounds.child("rowMaximum") && bounds.child("columnMaximum")) {
        scan.index_bounds = E57Scan::IndexBounds{bound("rowMinimum"), bound("rowMaximum"),
                                                 bound("columnMinimum"), bound("columnMaximum")};
      }
    }
    scan.intensity_limits = ParseLimits(node.child("intensityLimits"), "intensity");
    const pugi::xml_node colors = node.child("colorLimits");
    const char* const kColors[] = {"colorRed", "colorGreen", "colorBlue"};
    for (int i = 0; i < 3; ++i) scan.color_limits[i] = ParseLimits(colors, kColors[i]);
    const pugi::xml_node points = node.child("points");
    if (!points) throw Error(node, "a scan has no element points");
    scan.points = ParsePoints(points);
    return scan;
  }

  E57Points ParsePoints(const pugi::xml_node& node) const {
    E57Points points;
    points.num_records = IntegerAttribute(node, "recordCount", 0);
    if (points.num_records < 0) {
      throw Error(node, "says " + std::to_string(points.num_records) + " points");
    }
    AddFields(node.child("prototype"), 0, &points.fields);
    if (points.num_records == 0) return points;  // then the section need not be there
    if (points.fields.empty()) throw Error(node, "the points have no fields");
    points.section = SectionOf(node, "the points of a scan");
    return points;
  }

  int64_t SectionOf(const pugi::xml_node& node, const std::string& what) const {
    const int64_t offset = IntegerAttribute(node, "fileOffset", 0);
    if (offset < E57Pages::kHeaderSize) {
      throw Error(node, what + " are said to lie at byte " + std::to_string(offset));
    }
    return pages_.LogicalFromPhysical(static_cast<uint64_t>(offset), what);
  }

  void AddFields(const pugi::xml_node& parent, int depth, std::vector<E57Field>* fields) const {
    for (const pugi::xml_node node : parent.children()) {
      if (node.type() != pugi::node_element) continue;
      if (std::string_view(node.attribute("type").value()) != "Structure") {
        fields->push_back(ParseField(node));
      } else if (depth < kDeepestPrototype) {
        AddFields(node, depth + 1, fields);
      } else {
        throw Error(node, "the structures of a record are nested too deep");
      }
      if (fields->size() > kMostFields) throw Error(node, "a record has too many fields");
    }
  }

  E57Field ParseField(const pugi::xml_node& node) const {
    E57Field field;
    field.name = node.name();
    const std::string_view type = node.attribute("type").value();
    if (type == "Integer" || type == "ScaledInteger") {
      field.type = type == "Integer" ? E57Field::Type::kInteger : E57Field::Type::kScaledInteger;
      field.has_range = node.attribute("minimum") && node.attribute("maximum");
      field.minimum = IntegerAttribute(node, "minimum", std::numeric_limits<int64_t>::min());
      field.maximum = IntegerAttribute(node, "maximum", std::numeric_limits<int64_t>::max());
      if (field.minimum > field.maximum) {
        throw Error(node, "the minimum of " + field.name + " is above its maximum");
      }
      if (type == "ScaledInteger") {
        field.scale = NumberAttribute(node, "scale", 1);
        field.offset = NumberAttribute(node, "offset", 0);
      }
      field.num_bits = 0;
      for (uint64_t range =
               static_cast<uint64_t>(field.maximum) - static_cast<uint64_t>(field.minimum);
           range != 0; range >>= 1) {
        ++field.num_bits;
      }
    } else if (type == "Float") {
      const bool is_single = std::string_view(node.attribute("precision").value()) == "single";
      field.type = is_single ? E57Field::Type::kSingle : E57Field::Type::kDouble;
      field.num_bits = is_single ? 32 : 64;
    } else if (type == "String") {
      field.type = E57Field::Type::kString;
      field.num_bits = 8;
    } else {
      throw Error(node, "field " + field.name + " has the type " + Quoted(type) +
                            ", which no record can hold");
    }
    return field;
  }

  E57Image ParseImage(const pugi::xml_node& node) const {
    E57Image image;
    image.name = node.child_value("name");
    image.guid = node.child_value("guid");
    image.scan_guid = node.child_value("associatedData3DGuid");
    if (const pugi::xml_node pose = node.child("pose")) image.file_from_camera = ParsePose(pose);
    const std::pair<const char*, E57Image::Kind> kKinds[] = {
        {"pinholeRepresentation", E57Image::Kind::kPinhole},
        {"sphericalRepresentation", E57Image::Kind::kSpherical},
        {"cylindricalRepresentation", E57Image::Kind::kCylindrical},
        {"visualReferenceRepresentation", E57Image::Kind::kVisual}};
    for (const auto& [name, kind] : kKinds) {
      const pugi::xml_node shown = node.child(name);
      if (!shown || (image.num_bytes > 0 && kind == E57Image::Kind::kVisual)) continue;
      image.kind = kind;
      ParseRepresentation(shown, &image);
      if (image.num_bytes > 0) break;
    }
    for (const pugi::xml_node child : node.children()) {
      const std::string_view name = child.name();
      if (name.size() > 11 && name.substr(name.size() - 11) == ":distortion") {
        image.has_distortion = true;
      }
    }
    return image;
  }

  void ParseRepresentation(const pugi::xml_node& node, E57Image* image) const {
    image->width = Integer(node.child("imageWidth"));
    image->height = Integer(node.child("imageHeight"));
    image->focal_length = NumberIn(node, "focalLength");
    image->pixel_width = NumberIn(node, "pixelWidth");
    image->pixel_height = NumberIn(node, "pixelHeight");
    image->principal_point_x = NumberIn(node, "principalPointX");
    image->principal_point_y = NumberIn(node, "principalPointY");
    const pugi::xml_node png = node.child("pngImage"), jpeg = node.child("jpegImage");
    const pugi::xml_node blob = jpeg ? jpeg : png;
    if (!blob) return;
    image->is_png = !jpeg;
    ParseBlob(blob, "a picture", &image->section, &image->num_bytes);
    if (const pugi::xml_node mask = node.child("imageMask")) {
      ParseBlob(mask, "a mask", &image->mask_section, &image->num_mask_bytes);
    }
  }

  void ParseBlob(const pugi::xml_node& blob, const std::string& what, int64_t* section,
                 int64_t* num_bytes) const {
    *num_bytes = IntegerAttribute(blob, "length", 0);
    if (*num_bytes <= 0) {
      throw Error(blob, "says " + what + " of " + std::to_string(*num_bytes) + " bytes");
    }
    *section = SectionOf(blob, "the bytes of " + what);
  }

  const E57Pages& pages_;
};

}  // namespace

int E57Points::Find(const std::string& name) const {
  for (size_t i = 0; i < fields.size(); ++i) {
    if (fields[i].name == name) return static_cast<int>(i);
  }
  return -1;
}

E57Document ReadE57Document(const E57Pages& pages) { return DocumentParser(pages).Parse(); }

}  // namespace roomtex
