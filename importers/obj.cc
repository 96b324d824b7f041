#include "importers/obj.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <sstream>
#include <string_view>

#include "core/error.h"
#include "core/free_vectors.h"
#include "core/text.h"
#include "importers/file_reader.h"
#include "importers/mesh_scan.h"

namespace roomtex {
namespace {

// What OBJ knows beside v and f: attributes, elements, groups, free-form curves and surfaces.
constexpr std::string_view kSkipped[] = {
    "vt",       "vn",         "vp",        "g",      "o",    "s",    "mg",    "usemtl",
    "mtllib",   "usemap",     "maplib",    "l",      "p",    "lod",  "bevel", "c_interp",
    "d_interp", "shadow_obj", "trace_obj", "cstype", "deg",  "bmat", "step",  "curv",
    "curv2",    "surf",       "parm",      "trim",   "hole", "scrv", "sp",    "end",
    "con",      "ctech",      "stech",     "call",   "csh"};

bool IsSkipped(std::string_view word) {
  return std::find(std::begin(kSkipped), std::end(kSkipped), word) != std::end(kSkipped);
}

bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

// The next word of the line, removed from it; "" at its end.
std::string_view TakeWord(std::string_view* line) {
  while (!line->empty() && IsBlank(line->front())) line->remove_prefix(1);
  size_t length = 0;
  while (length < line->size() && !IsBlank((*line)[length])) ++length;
  const std::string_view word = line->substr(0, length);
  line->remove_prefix(length);
  return word;
}

class ObjParser {
 public:
  ObjParser(const std::string& path, const PlyOptions& options)
      : file_(path), lines_(file_), options_(options) {}

  Scan Parse() {
    scan_.up = Eigen::Vector3d::UnitZ();
    scan_.up_is_assumed = true;
    scan_.station_is_assumed = true;
    std::string_view line;
    while (NextLine(&line)) {
      const std::string_view whole = line;
      const std::string_view word = TakeWord(&line);
      if (word.empty()) continue;
      if (word.front() == '#') {
        ReadComment(whole);
      } else if (word == "v") {
        ReadVertex(line, whole);
      } else if (word == "f" || word == "fo") {  // fo: what old files call a face
        ReadFace(line, whole);
      } else if (!IsSkipped(word)) {
        Fail("is " + Quoted(whole) + ", which is no line of an OBJ file");
      }
    }
    return Finish();
  }

 private:
  [[noreturn]] void Fail(const std::string& finding, const std::string& remedy = kDamaged) const {
    throw InputError(file_.path(), LinePosition(lines_.line_number()), finding, remedy);
  }

  // A line that ends with a backslash goes on in the next one.
  bool NextLine(std::string_view* line) {
    if (!lines_.Next(line)) return false;
    if (line->empty() || line->back() != '\\') return true;
    constexpr size_t kLongest = 1 << 24;
    joined_.clear();
    std::string_view next = *line;
    while (!next.empty() && next.back() == '\\') {
      joined_.append(next.substr(0, next.size() - 1)).push_back(' ');
      if (joined_.size() > kLongest) Fail("a line is longer than 16 megabytes");
      next = {};
      if (!lines_.Next(&next)) break;
    }
    joined_.append(next);
    *line = joined_;
    return true;
  }

  void ReadComment(std::string_view line) {
    std::istringstream words{std::string(line.substr(line.find('#') + 1))};
    std::string who, what;
    Eigen::Vector3d v;
    if (!(words >> who >> what >> v[0] >> v[1] >> v[2]) || who != "roomtex") return;
    if (what != "up" || !v.allFinite() || !(v.norm() > 0.5)) return;
    scan_.up = v.normalized();
    scan_.up_is_assumed = false;
  }

  void ReadVertex(std::string_view line, std::string_view whole) {
    Eigen::Vector3d point;
    for (int k = 0; k < 3; ++k) {
      const std::string_view word = TakeWord(&line);
      if (!ParseReal(word, &point[k])) {
        Fail("is " + Quoted(whole) + ", expected v and three numbers", RemedyForLine(whole));
      }
    }
    if (scan_.points.size() >= static_cast<size_t>(std::numeric_limits<int>::max())) {
      throw InputError(file_.path(), LinePosition(lines_.line_number()),
                       "is more than 2^31 vertices", "Divide the mesh");
    }
    scan_.points.push_back(options_.meters_per_unit * point);
    ReadColor(line);
  }

  // "r g b" behind the place; else what stands there is passed over.
  void ReadColor(std::string_view line) {
    if (!options_.colors && !options_.grey_as_intensity) return;
    Eigen::Vector3d color = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k) {
      const std::string_view word = TakeWord(&line);
      if (word.empty()) return;
      if (!ParseReal(word, &color[k])) return;
    }
    scan_.colors.resize(scan_.points.size() - 1, {0, 0, 0});
    scan_.colors.push_back(color_scale_.Bytes(color, &scan_.colors));
  }

  // "7", "7/1", "7//3", "7/1/3" or negative; the vertex alone counts.
  int ReadCorner(std::string_view word, std::string_view whole) {
    int64_t number = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
    const bool whole_word = end == word.data() + word.size() || *end == '/';
    if (error != std::errc() || !whole_word || number == 0) {
      Fail("is " + Quoted(whole) + ", expected f and numbers of vertices from 1");
    }
    const auto count = static_cast<int64_t>(scan_.points.size());
    if (number < 0) number += count + 1;
    if (number < 1 || number > std::numeric_limits<int>::max()) {
      Fail("a face names a vertex before the first");
    }
    if (number > highest_) {
      highest_ = number;
      highest_line_ = lines_.line_number();
    }
    return static_cast<int>(number - 1);
  }

  void ReadFace(std::string_view line, std::string_view whole) {
    Triangle fan = {0, 0, 0};
    int count = 0;
    for (std::string_view word = TakeWord(&line); !word.empty(); word = TakeWord(&line)) {
      if (word.front() == '#') break;
      fan[std::min(count++, 2)] = ReadCorner(word, whole);
      if (count < 3) continue;
      if (fan[0] != fan[1] && fan[1] != fan[2] && fan[0] != fan[2]) scan_.triangles.push_back(fan);
      fan[1] = fan[2];
    }
    if (count < 3) {
      Fail("a face has " + std::to_string(count) + " corners, expected at least 3");
    }
    ++num_faces_;
  }

  Scan Finish() {
    if (num_faces_ == 0) {
      throw InputError(
          file_.path(), "",
          "holds " + std::to_string(scan_.points.size()) +
              " vertices without faces, expected a triangle mesh",
          "Triangulate it, or give the scan with its grid (RTPI, PTX or organised PCD)");
    }
    if (highest_ > static_cast<int64_t>(scan_.points.size())) {
      throw InputError(file_.path(), LinePosition(highest_line_),
                       "a face names vertex " + std::to_string(highest_) + " of " +
                           std::to_string(scan_.points.size()),
                       kDamaged);
    }
    scan_.intensity.assign(scan_.points.size(), 1.0f);
    if (!scan_.colors.empty()) scan_.colors.resize(scan_.points.size(), {0, 0, 0});
    for (size_t i = 0; i < scan_.colors.size() && options_.grey_as_intensity; ++i) {
      const std::array<uint8_t, 3>& c = scan_.colors[i];
      scan_.intensity[i] = static_cast<float>(GreyOf(Eigen::Vector3d(c[0], c[1], c[2])));
    }
    if (!options_.colors) FreeVectors(&scan_.colors);
    FinishMesh(file_.path(), options_.max_range, &scan_);
    return std::move(scan_);
  }

  const FileReader file_;
  LineReader lines_;
  PlyOptions options_;
  std::string joined_;
  Scan scan_;
  int64_t num_faces_ = 0, highest_ = 0;
  long highest_line_ = 0;
  ColorScale color_scale_{1};
};

}  // namespace

Scan ReadObj(const std::string& path, const PlyOptions& options) {
  return ObjParser(path, options).Parse();
}

bool LooksLikeObj(std::string_view start) {
  while (!start.empty()) {
    const size_t newline = std::min(start.find('\n'), start.size());
    std::string_view line = start.substr(0, newline);
    start.remove_prefix(std::min(newline + 1, start.size()));
    const std::string_view word = TakeWord(&line);
    if (word.empty() || word.front() == '#') continue;
    return (word == "v" || word == "f" || IsSkipped(word)) && !TakeWord(&line).empty();
  }
  return false;
}

}  // namespace roomtex
