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

namespace roomtex {
namespace {

constexpr size_t kMostColumns = 64;
constexpr int64_t kPointsToGuessBy = 1000;  // how many there are in all
constexpr int64_t kShortestPoint = 6;       // bytes: "0 0 0\n"
const char kNotXyz[] = "The file is damaged, or no list of points";

// The words of a line.
void SplitWords(std::string_view line, std::vector<std::string_view>* words) {
  constexpr char kBetween[] = " \t,;\r";
  words->clear();
  size_t at = line.find_first_not_of(kBetween);
  while (at != std::string_view::npos && words->size() <= kMostColumns) {
    const size_t end = std::min(line.find_first_of(kBetween, at), line.size());
    words->push_back(line.substr(at, end - at));
    at = line.find_first_not_of(kBetween, end);
  }
}

bool IsComment(std::string_view line) {
  return line.substr(0, 1) == "#" || line.substr(0, 2) == "//";
}

// "nan", "inf" and what no double holds are numbers, too: of no point.
bool ParseWord(std::string_view word, double* number) {
  if (!word.empty() && word[0] == '+') word.remove_prefix(1);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), *number);
  if (error == std::errc::result_out_of_range) {
    *number = std::strtod(std::string(word).c_str(), nullptr);  // 1e-400 is zero
  }
  return (error == std::errc() || error == std::errc::result_out_of_range) &&
         end == word.data() + word.size();
}

bool AreNumbers(const std::vector<std::string_view>& words) {
  double number = 0;
  return std::all_of(words.begin(), words.end(),
                     [&](std::string_view word) { return ParseWord(word, &number); });
}

// Which column is what; -1 = there is none.
struct XyzColumns {
  int place[3] = {0, 1, 2};
  int intensity = -1;
  int color[3] = {-1, -1, -1};
  size_t count = 0;

  static XyzColumns ByNumber(size_t count) {
    XyzColumns columns;
    columns.count = count;
    if (count == 4 || count >= 7) columns.intensity = 3;
    if (count == 6) std::iota(columns.color, columns.color + 3, 3);
    if (count >= 7) std::iota(columns.color, columns.color + 3, 4);
    return columns;
  }
  // None if the words do not name x, y and z.
  static std::optional<XyzColumns> ByName(const std::vector<std::string_view>& words) {
    const auto find = [&](const std::vector<std::string>& names) {
      for (size_t i = 0; i < words.size(); ++i) {
        std::string word(words[i]);
        for (const char quote : {'"', '\'', '/', '#'}) {
          word.erase(std::remove(word.begin(), word.end(), quote), word.end());
        }
        if (std::find(names.begin(), names.end(), LowerCase(word)) != names.end())
          return static_cast<int>(i);
      }
      return -1;
    };
    XyzColumns columns;
    columns.count = words.size();
    const char* const kAxes[] = {"x", "y", "z"};
    for (int i = 0; i < 3; ++i) columns.place[i] = find({kAxes[i]});
    if (*std::min_element(columns.place, columns.place + 3) < 0) return std::nullopt;
    columns.intensity = find({"intensity", "i", "scalar_intensity", "reflectance"});
    columns.color[0] = find({"r", "red"});
    columns.color[1] = find({"g", "green"});
    columns.color[2] = find({"b", "blue"});
    if (std::min(columns.color[0], columns.color[1]) < 0) columns.color[2] = -1;
    return columns;
  }
};

class XyzParser {
 public:
  XyzParser(const FileReader& file, const XyzOptions& options)
      : file_(file), options_(options), lines_(file) {}

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
    SplitWords(line, &words_);
    if (words_.empty()) return;
    if (!columns_ && !AreNumbers(words_)) {
      columns_ = XyzColumns::ByName(words_);
      if (!columns_ && !IsComment(line)) throw Error(line, "numbers, or the names of columns");
      return;
    }
    if (IsComment(line)) return;
    if (!columns_ && said_ < 0 && words_.size() == 1) {
      ParseCount(line);
      return;
    }
    if (!columns_) {
      if (words_.size() < 3) throw Error(line, "x, y and z");
      columns_ = XyzColumns::ByNumber(words_.size());
    }
    ParsePoint(line);
  }

  // PTS.
  void ParseCount(std::string_view line) {
    double count = 0;
    if (!ParseWord(words_[0], &count) || !(count >= 0) || count != std::floor(count) ||
        count * kShortestPoint > static_cast<double>(lines_.BytesLeft()) + 1) {
      throw Error(line, "the number of points, of which " + std::to_string(lines_.BytesLeft()) +
                            " bytes can hold at most " +
                            std::to_string((lines_.BytesLeft() + 1) / kShortestPoint));
    }
    said_ = static_cast<int64_t>(count);
  }

  void ParsePoint(std::string_view line) {
    if (words_.size() != columns_->count) {
      throw Error(line, std::to_string(columns_->count) + " columns as in the lines before");
    }
    const auto number = [&](int column) {
      double value = 0;
      if (!ParseWord(words_[static_cast<size_t>(column)], &value)) throw Error(line, "numbers");
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
    Eigen::Vector3d point;
    for (int i = 0; i < 3; ++i) point[i] = options_.meters_per_unit * number(columns_->place[i]);
    double intensity = columns_->intensity >= 0 ? number(columns_->intensity) : 0;
    Eigen::Vector3d color = Eigen::Vector3d::Zero();
    const bool has_color = columns_->color[2] >= 0;
    if (has_color && (options_.colors || columns_->intensity < 0)) {
      for (int k = 0; k < 3; ++k) color[k] = number(columns_->color[k]);
      if (columns_->intensity < 0) intensity = GreyOf(color);
    }
    if (options_.colors && color.minCoeff() < 0) {  // these columns are none
      options_.colors = false;
      FreeVectors(&scan_.colors);
    }
    const double range = point.norm();
    if (!std::isfinite(range) || (options_.max_range > 0 && range > options_.max_range)) return;
    scan_.points.push_back(point);
    if (options_.colors && has_color) {
      scan_.colors.push_back(color_scale_.Bytes(color, &scan_.colors));
    }
    scan_.intensity.push_back(std::isfinite(intensity) ? static_cast<float>(intensity) : 0.0f);
  }

  const FileReader& file_;
  XyzOptions options_;
  LineReader lines_;
  std::vector<std::string_view> words_;
  std::optional<XyzColumns> columns_;
  int64_t said_ = -1, num_points_ = 0;
  Scan scan_;
  ColorScale color_scale_{1};
};

}  // namespace

Scan ReadXyz(const std::string& path, const XyzOptions& options) {
  const FileReader file(path);
  return XyzParser(file, options).Parse();
}

bool LooksLikeXyz(std::string_view start) {
  std::vector<std::string_view> words;
  bool had_count = false;
  while (!start.empty()) {
    const size_t end = std::min(start.find('\n'), start.size());
    const std::string_view line = start.substr(0, end);
    start.remove_prefix(std::min(end + 1, start.size()));
    SplitWords(line, &words);
    if (words.empty()) continue;
    if (XyzColumns::ByName(words)) return true;
    if (IsComment(line)) continue;
    if (!AreNumbers(words)) return false;
    if (words.size() >= 3) return true;
    if (had_count || words.size() != 1) return false;
    had_count = true;
  }
  return false;
}

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
