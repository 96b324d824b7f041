#include "workflow/evidence_points.h"

#include <cstring>
#include <fstream>
#include <map>
#include <sstream>

#include "core/error.h"
#include "core/output_file.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr char kEvidenceRemedy[] = "Run the step texture again";

struct Property {
  std::string type;
  size_t offset = 0;
};

struct Layout {
  double count = 0;
  size_t stride = 0;
  std::map<std::string, Property> properties;

  bool Has(const std::string& name, const std::string& type) const {
    const auto found = properties.find(name);
    return found != properties.end() && found->second.type == type;
  }
  bool HasPoints(const std::string& type) const {
    return Has("x", type) && Has("y", type) && Has("z", type);
  }
};

InputError EvidenceError(const std::string& path, const std::string& finding) {
  return InputError(path, "", finding, kEvidenceRemedy);
}

Layout ReadHeader(std::istream* stream, const std::string& path) {
  const std::map<std::string, size_t> kBytes = {
      {"float", 4}, {"uchar", 1}, {"double", 8}, {"int", 4}};
  const std::string last = "end_header\n";
  std::string begin(4096, '\0');
  stream->read(begin.data(), static_cast<std::streamsize>(begin.size()));
  const size_t end = begin.find(last);
  if (end == std::string::npos) throw EvidenceError(path, "is no evidence.ply");
  stream->clear();
  stream->seekg(static_cast<std::streamoff>(end + last.size()));
  Layout layout;
  bool little = false, in_vertex = false;
  std::istringstream lines(begin.substr(0, end));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string word, type, name;
    words >> word;
    if (word == "format") {
      words >> type;
      little = type == "binary_little_endian";
    } else if (word == "element") {
      words >> name >> type;
      if (name != "vertex" || in_vertex) throw EvidenceError(path, "holds more than points");
      in_vertex = true;
      layout.count = ParseNumber(type).value_or(-1);
    } else if (word == "property") {
      words >> type >> name;
      if (!in_vertex || kBytes.count(type) == 0) throw EvidenceError(path, "is no evidence.ply");
      layout.properties[name] = {type, layout.stride};
      layout.stride += kBytes.at(type);
    }
  }
  const bool has_all = (layout.HasPoints("float") || layout.HasPoints("double")) &&
                       layout.Has("views", "uchar") && layout.Has("disagreement", "float");
  if (!little || !has_all || layout.count < 0) {
    throw EvidenceError(path, "is no evidence.ply");
  }
  return layout;
}

template <typename Value>
Value ValueAt(const char* at, size_t offset) {
  Value value;
  std::memcpy(&value, at + offset, sizeof value);
  return value;
}

}  // namespace

std::vector<EvidencePoint> ReadEvidencePoints(const std::string& path) {
  RequireFile(path, kEvidenceRemedy);
  std::ifstream stream(path, std::ios::binary);
  const Layout layout = ReadHeader(&stream, path);
  const auto offset_of = [&layout](const char* name) { return layout.properties.at(name).offset; };
  const size_t xyz[3] = {offset_of("x"), offset_of("y"), offset_of("z")};
  const size_t views = offset_of("views"), disagreement = offset_of("disagreement");
  const bool as_double = layout.HasPoints("double");
  const auto is_complete = [&](size_t count) { return static_cast<double>(count) >= layout.count; };
  std::vector<EvidencePoint> points;
  std::vector<char> block(layout.stride * 4096);
  while (!is_complete(points.size()) && stream) {
    stream.read(block.data(), static_cast<std::streamsize>(block.size()));
    const size_t num_read = static_cast<size_t>(stream.gcount()) / layout.stride;
    for (size_t i = 0; i < num_read && !is_complete(points.size()); ++i) {
      const char* const at = block.data() + i * layout.stride;
      EvidencePoint point;
      for (int k = 0; k < 3; ++k) {
        point.x_in_scan[k] = as_double ? ValueAt<double>(at, xyz[k]) : ValueAt<float>(at, xyz[k]);
      }
      if (!point.x_in_scan.allFinite()) throw EvidenceError(path, "has a point without a place");
      point.views = ValueAt<uint8_t>(at, views);
      point.disagreement = ValueAt<float>(at, disagreement);
      points.push_back(point);
    }
  }
  if (!is_complete(points.size())) throw EvidenceError(path, "is cut off");
  return points;
}

}  // namespace roomtex
