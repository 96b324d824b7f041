#pragma once
// The vertices of a binary PLY as the commands write it, for tests and roomtex-evaluate.

#include <cstdint>
#include <cstring>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/error.h"
#include "core/text.h"

namespace roomtex {

struct PlyVertices {
  std::vector<Eigen::Vector3f> points;
  std::vector<Eigen::Matrix<uint8_t, 3, 1>> colors;  // red, green, blue; empty without colours
  std::vector<int> views;                            // empty without the property
  // Averaged over a sample's cell (truth/true_colors.ply); empty without the properties.
  std::vector<Eigen::Matrix<uint8_t, 3, 1>> cell_colors;
};

// bytes: the whole file. path: for messages. Throws InputError unless it is a little-endian PLY
// whose first element is `vertex` with x, y, z as float.
inline PlyVertices ParsePlyVertices(const std::string& bytes, const std::string& path) {
  const auto fail = [&](const std::string& finding) {
    return InputError(path, "", finding, "Expected a binary little-endian PLY written by roomtex");
  };
  const std::string last = "end_header\n";
  const size_t header_end = bytes.find(last);
  if (bytes.compare(0, 4, "ply\n") != 0 || header_end == std::string::npos)
    throw fail("is not a PLY file");
  std::istringstream header(bytes.substr(0, header_end));
  size_t count = 0, stride = 0;
  bool in_vertex = false, little = false;
  struct Property {
    std::string type, name;
    size_t offset;
  };
  std::vector<Property> properties;
  for (std::string line; std::getline(header, line);) {
    std::istringstream words(line);
    std::string first, second, third;
    words >> first >> second >> third;
    if (first == "format") little = second == "binary_little_endian";
    if (first == "element") {
      in_vertex = second == "vertex";
      const double said = ParseNumber(third).value_or(-1);
      if (!(said >= 0) || said > static_cast<double>(bytes.size())) {
        throw fail("says " + Quoted(third) + " of " + Quoted(second));
      }
      if (in_vertex) count = static_cast<size_t>(said);
    }
    if (first != "property" || !in_vertex) continue;
    size_t size = 0;
    if (second == "float" || second == "int" || second == "uint" || second == "float32") size = 4;
    if (second == "uchar" || second == "char" || second == "uint8") size = 1;
    if (second == "ushort" || second == "short") size = 2;
    if (second == "double") size = 8;
    if (size == 0) throw fail("has a vertex property of type " + second);
    properties.push_back({second, third, stride});
    stride += size;
  }
  const size_t begin = header_end + last.size();
  if (!little || stride == 0 || count > (bytes.size() - begin) / stride)
    throw fail("is truncated or not binary");
  // Of the first of `num` properties of that type; -1 = there is none.
  const auto offset_of = [&](const std::string& name, const std::string& type, size_t num) {
    for (size_t i = 0; i < properties.size(); ++i) {
      if (properties[i].name != name) continue;
      for (size_t k = i; k < i + num; ++k) {
        if (k >= properties.size() || properties[k].type != type) {
          throw fail("has vertex properties in another order");
        }
      }
      return static_cast<long>(properties[i].offset);
    }
    return -1L;
  };
  const long x = offset_of("x", "float", 3), red = offset_of("red", "uchar", 3),
             views = offset_of("views", "uchar", 1), cell = offset_of("cell_red", "uchar", 3);
  if (x < 0) throw fail("has no vertex property x");
  PlyVertices vertices;
  for (size_t i = 0; i < count; ++i) {
    const char* vertex = bytes.data() + begin + i * stride;
    Eigen::Vector3f point;
    std::memcpy(point.data(), vertex + x, 12);
    vertices.points.push_back(point);
    if (red >= 0) {
      Eigen::Matrix<uint8_t, 3, 1> color;
      std::memcpy(color.data(), vertex + red, 3);
      vertices.colors.push_back(color);
    }
    if (cell >= 0) {
      Eigen::Matrix<uint8_t, 3, 1> color;
      std::memcpy(color.data(), vertex + cell, 3);
      vertices.cell_colors.push_back(color);
    }
    if (views >= 0) vertices.views.push_back(static_cast<uint8_t>(vertex[views]));
  }
  return vertices;
}

}  // namespace roomtex
