#include "importers/xyz.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <optional>
#include <vector>

#include "core/error.h"
#include "core/free_vectors.h"
#include "core/output_file.h"
#include "core/resource_limits.h"
#include "core/text.h"
#include "importers/file_reader.h"
#include "importers/mesh_scan.h"
#include "importers/xyz_columns.h"

namespace roomtex {
namespace {

constexpr int64_t kTellColumnsBy = 1 << 18;  // bytes, to tell the columns
constexpr int64_t kPointsToGuessBy = 1000;   // how many there are in all
constexpr int64_t kShortestPoint = 6;        // bytes: "0 0 0\n"
constexpr int64_t kCommasLookedAt = 1000;    // points; further ones have columns as these have
const char kNotXyz[] = "The file is damaged, or no list of points";

class XyzParser {
 public:
  XyzParser(const FileReader& file, const XyzOptions& options)
      : file_(file), options_(options), lines_(file) {
    std::string start = file.ReadSome(0, kTellColumnsBy);
    if (LineEndOf(start) == '\r') std::replace(start.begin(), start.end(), '\r', '\n');
    if (file.size() > kTellColumnsBy) start.resize(start.rfind('\n') + 1);  // nothing, of one line
    layout_ = FindXyzLayout(start);
  }

  Scan Parse() {
    scan_.path = file_.path();
    scan_.organised = false;
    scan_.up = Eigen::Vector3d::UnitZ();
    scan_.up_is_assumed = true;
    scan_.station_is_assumed = true;
    std::string_view line;
    while (lines_.Next(&line)) ParseLine(line);
    if (said_ >= 0 && num_points_ < said_) {
      throw InputError(file_.path(), LinePosition(lines_.line_number() + 1),
                       "the file ends after " + std::to_string(num_points_) + " of " +
                           std::to_string(said_) + " points",
                       "The file is cut off: copy it again");
    }
    if (scan_.points.empty()) {
      throw InputError(file_.path(), "", "holds no point",
                       options_.max_range > 0 ? "Give a larger --max_range" : "Give another file");
    }
    scan_.num_columns = static_cast<int>(scan_.points.size());
    scan_.num_rows = 1;
    return std::move(scan_);
  }

 private:
  InputError Error(std::string_view line, const std::string& expected) const {
    return InputError(file_.path(), LinePosition(lines_.line_number()),
                      "is " + Quoted(line) + ", expected " + expected, kNotXyz);
  }

  void ParseLine(std::string_view line) {
    SplitWords(line, layout_.decimal_commas, &words_);
    if (words_.empty() || IsXyzComment(line)) return;
    double number = 0;
    const bool begins_with_number = ParseXyzNumber(words_[0], layout_.decimal_commas, &number);
    if (num_points_ == 0 && !begins_with_number) {
      if (!XyzColumns::ByName(words_)) throw Error(line, "numbers, or the names of columns");
      return;
    }
    if (words_.size() == 1 && num_points_ == std::max<int64_t>(said_, 0)) {
      ParseCount(line, number);
      return;
    }
    if (!layout_.columns) {
      if (words_.size() < 3) throw Error(line, "x, y and z");
      layout_.columns = XyzColumns::ByNumber(words_.size(), {});
    }
    ParsePoint(line, *layout_.columns);
  }

  // PTS, which can hold several lists, each behind its number.
  void ParseCount(std::string_view line, double count) {
    if (!(count >= 0) || count != std::floor(count) ||
        count * kShortestPoint > static_cast<double>(lines_.BytesLeft()) + 1) {
      throw Error(line, "the number of points, of which " + std::to_string(lines_.BytesLeft()) +
                            " bytes can hold at most " +
                            std::to_string((lines_.BytesLeft() + 1) / kShortestPoint));
    }
    said_ = num_points_ + static_cast<int64_t>(count);
  }

  void ParsePoint(std::string_view line, const XyzColumns& columns) {
    if (words_.size() != columns.count) {
      throw Error(line, std::to_string(columns.count) + " columns as in the lines before");
    }
    if (num_points_ < kCommasLookedAt && !layout_.decimal_commas && HasCommasInNumbers(line)) {
      throw InputError(
          file_.path(), LinePosition(lines_.line_number()),
          "is " + Quoted(line) + ", where commas stand within numbers, and points as well",
          "Write all numbers with points, and commas between them or none");
    }
    const auto number = [&](int column) {
      double value = 0;
      if (!ParseXyzNumber(words_[static_cast<size_t>(column)], layout_.decimal_commas, &value)) {
        throw Error(line, "numbers");
      }
      return value;
    };
    if (++num_points_ > std::numeric_limits<int>::max()) {
      throw Error(line, "no more than 2147483647 points");
    }
    if (num_points_ == kPointsToGuessBy) {
      const double all = static_cast<double>(file_.size());
      RequireMemoryForSamples(file_.path(),
                              kPointsToGuessBy * all / static_cast<double>(lines_.offset()));
    }
    const auto three = [&](const int(&of)[3]) {
      return Eigen::Vector3d(number(of[0]), number(of[1]), number(of[2]));
    };
    const Eigen::Vector3d point = options_.meters_per_unit * three(columns.place);
    double intensity = columns.intensity >= 0 ? number(columns.intensity) : 0;
    Eigen::Vector3d color = Eigen::Vector3d::Zero();
    if (has_colors_ && columns.color[0] >= 0) {
      color = three(columns.color);
      if (color.minCoeff() < 0) ForgetColors();
      if (has_colors_ && columns.intensity < 0) intensity = GreyOf(color);
    }
    const double range = point.norm();
    if (!std::isfinite(range) || (options_.max_range > 0 && range > options_.max_range)) {
      ++scan_.num_left_out;
      return;
    }
    scan_.points.push_back(point);
    if (options_.colors && has_colors_ && columns.color[0] >= 0) {
      scan_.colors.push_back(color_scale_.Bytes(color, &scan_.colors));
    }
    if (columns.normal[0] >= 0) {
      const Eigen::Vector3d normal = three(columns.normal);
      const bool is_one = normal.allFinite() && normal.norm() > 0.5;
      scan_.normals.push_back(is_one ? normal.normalized().cast<float>().eval()
                                     : Eigen::Vector3f::Zero().eval());
    }
    scan_.intensity.push_back(std::isfinite(intensity) ? static_cast<float>(intensity) : 0.0f);
  }

  // The columns hold something else, and the grey made of them is none either.
  void ForgetColors() {
    has_colors_ = false;
    FreeVectors(&scan_.colors);
    if (layout_.columns->intensity < 0) {
      std::fill(scan_.intensity.begin(), scan_.intensity.end(), 0.0f);
    }
  }

  const FileReader& file_;
  XyzOptions options_;
  LineReader lines_;
  std::vector<std::string_view> words_;
  XyzLayout layout_;
  bool has_colors_ = true;
  int64_t said_ = -1, num_points_ = 0;
  Scan scan_;
  ColorScale color_scale_{1};
};

}  // namespace

Scan ReadXyz(const std::string& path, const XyzOptions& options) {
  const FileReader file(path);
  return XyzParser(file, options).Parse();
}

std::string UnitOfXyz(std::string_view start) {
  const XyzLayout layout = FindXyzLayout(start);
  return layout.columns ? layout.columns->unit : "";
}

bool LooksLikeXyz(std::string_view start) { return FindXyzLayout(start).columns.has_value(); }

std::optional<XyzKind> XyzKindOf(const std::string& extension) {
  if (extension == ".xyz") return XyzKind::kXyz;
  if (extension == ".pts") return XyzKind::kPts;
  if (extension == ".csv") return XyzKind::kCsv;
  return std::nullopt;
}

void WriteXyz(const std::vector<const Scan*>& scans, const std::string& path, XyzKind kind) {
  constexpr size_t kBlock = 1 << 20;
  bool has_colors = false;
  size_t count = 0;
  for (const Scan* scan : scans) {
    has_colors = has_colors || !scan->colors.empty();
    count += scan->points.size() - static_cast<size_t>(scan->NumMissing());
  }
  const char between = kind == XyzKind::kCsv ? ',' : ' ';
  OutputFile output(path);
  std::string text;
  if (kind == XyzKind::kPts) text = std::to_string(count) + "\n";
  if (kind == XyzKind::kCsv) text = has_colors ? "x,y,z,intensity,r,g,b\n" : "x,y,z,intensity\n";
  char number[352];  // the longest double without exponent has 309 digits before the point
  char* const end = number + sizeof(number);
  for (const Scan* scan : scans) {
    for (size_t i = 0; i < scan->points.size(); ++i) {
      if (scan->IsMissing(static_cast<int>(i))) continue;
      for (int k = 0; k < 3; ++k) {
        text.append(
            number,
            std::to_chars(number, end, scan->points[i][k], std::chars_format::fixed, 6).ptr);
        text += between;
      }
      const float intensity = std::isfinite(scan->intensity[i]) ? scan->intensity[i] : 0.0f;
      text.append(number, std::to_chars(number, end, intensity).ptr);
      for (size_t k = 0; k < 3 && has_colors; ++k) {
        text += between + std::to_string(scan->colors.empty() ? 0 : scan->colors[i][k]);
      }
      text += '\n';
      if (text.size() < kBlock) continue;
      output.stream() << text;
      text.clear();
    }
  }
  output.stream() << text;
  output.Commit();
}

}  // namespace roomtex
