#include "workflow/evidence_points.h"

#include <cstring>
#include <fstream>
#include <map>
#include <sstream>

#include "core/error.h"
#include "core/output_file.h"

namespace roomtex {
namespace {

constexpr char kEvidenceRemedy[] = "Run the step texture again";

struct Layout {
  size_t count = 0, stride = 0;
  std::map<std::string, size_t> offset_of;
};

InputError EvidenceError(const std::string& path, const std::string& finding) {
  return InputError(path, "", finding, kEvidenceRemedy);
}

Layout ReadHeader(std::istream* stream, const std::string& path) {
  const std::map<std::string, size_t> kBytes = {
      {"float", 4}, {"uchar", 1}, {"double", 8}, {"int", 4}};
  Layout layout;
  std::string line;
  bool little = false, in_vertex = false;
  while (std::getline(*stream, line) && line != "end_header") {
    std::istringstream words(line);
    std::string word, type, name;
    words >> word;
    if (word == "format") {
      words >> type;
      little = type == "binary_little_endian";
    } else if (word == "element") {
      words >> name >> layout.count;
      in_vertex = name == "vertex";
      if (!in_vertex) throw EvidenceError(path, "holds more than points");
    } else if (word == "property") {
      words >> type >> name;
      if (!in_vertex || kBytes.count(type) == 0) throw EvidenceError(path, "is no evidence.ply");
      layout.offset_of[name] = layout.stride;
      layout.stride += kBytes.at(type);
    }
  }
  const bool has_all = layout.offset_of.count("x") > 0 && layout.offset_of.count("views") > 0 &&
                       layout.offset_of.count("disagreement") > 0;
  if (!little || !has_all || !*stream) throw EvidenceError(path, "is no evidence.ply");
  return layout;
}

}  // namespace

std::vector<EvidencePoint> ReadEvidence(const std::string& path) {
  RequireFile(path, kEvidenceRemedy);
  std::ifstream stream(path, std::ios::binary);
  const Layout layout = ReadHeader(&stream, path);
  const size_t x = layout.offset_of.at("x"), views = layout.offset_of.at("views"),
               disagreement = layout.offset_of.at("disagreement");
  std::vector<EvidencePoint> points;
  std::vector<char> block(layout.stride * 4096);
  while (points.size() < layout.count && stream) {
    stream.read(block.data(), static_cast<std::streamsize>(block.size()));
    const size_t num_read = static_cast<size_t>(stream.gcount()) / layout.stride;
    for (size_t i = 0; i < num_read && points.size() < layout.count; ++i) {
      const char* const at = block.data() + i * layout.stride;
      EvidencePoint point;
      std::memcpy(point.x_in_scan.data(), at + x, 12);
      std::memcpy(&point.views, at + views, 1);
      std::memcpy(&point.disagreement, at + disagreement, 4);
      points.push_back(point);
    }
  }
  if (points.size() < layout.count) throw EvidenceError(path, "is cut off");
  return points;
}

}  // namespace roomtex
