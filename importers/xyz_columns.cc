#include "importers/xyz_columns.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "core/text.h"
#include "importers/file_reader.h"
#include "importers/length_unit.h"

namespace roomtex {
namespace {

constexpr size_t kMostColumns = 64;
constexpr size_t kMostRows = 1000;  // looked at

using Rows = std::vector<std::vector<double>>;

bool AreNumbers(const std::vector<std::string_view>& words, bool decimal_commas) {
  double number = 0;
  return std::all_of(words.begin(), words.end(), [&](std::string_view word) {
    return ParseXyzNumber(word, decimal_commas, &number);
  });
}

// Calls visit(line) until it says false.
template <typename Visit>
void ForLines(std::string_view text, const Visit& visit) {
  while (!text.empty()) {
    const size_t end = std::min(text.find('\n'), text.size());
    if (!visit(text.substr(0, end))) return;
    text.remove_prefix(std::min(end + 1, text.size()));
  }
}

// Decimal: three or more numbers between other things than commas, each comma within one of them,
// and no point in any.
enum class Commas { kNone, kDecimal, kBetween };
Commas CommasOf(std::string_view line, std::vector<std::string_view>* words) {
  if (line.find(',') == std::string_view::npos) return Commas::kNone;
  SplitWords(line, true, words);
  const auto is_number = [](std::string_view word) {
    double number = 0;
    const size_t comma = word.find(',');
    const bool is_within =
        comma == std::string_view::npos || (comma > 0 && comma + 1 < word.size());
    return is_within && word.find('.') == std::string_view::npos &&
           ParseXyzNumber(word, true, &number);
  };
  return words->size() >= 3 && std::all_of(words->begin(), words->end(), is_number)
             ? Commas::kDecimal
             : Commas::kBetween;
}

// With a comma in place of the point, or with commas and a point: "1,5", "5,412,345.25".
bool IsNumberWithCommas(std::string_view word) {
  double number = 0;
  if (word.empty() || word.front() == ',' || word.back() == ',') return false;
  if (ParseXyzNumber(word, true, &number)) return true;
  const size_t point = word.find('.');
  if (point == std::string_view::npos) return false;
  const std::string_view whole = word.substr(0, point);
  for (size_t comma = whole.find(','); comma != std::string_view::npos;) {
    const size_t next = whole.find(',', comma + 1);
    if (std::min(next, whole.size()) - comma != 4) return false;  // thousands
    comma = next;
  }
  std::string without(word);
  without.erase(std::remove(without.begin(), without.end(), ','), without.end());
  return ParseReal(without, &number);
}

bool FindDecimalCommas(std::string_view start) {
  bool found = false;
  size_t num_lines = 0;
  std::vector<std::string_view> words;
  ForLines(start, [&](std::string_view line) {
    SplitWords(line, false, &words);
    if (IsXyzComment(line) || words.empty() || !AreNumbers(words, false)) return true;
    const Commas commas = CommasOf(line, &words);
    found = commas == Commas::kDecimal || (found && commas == Commas::kNone);
    return commas != Commas::kBetween && ++num_lines < kMostRows;
  });
  return found;
}

bool AreUnitVectors(const Rows& rows, size_t first) {
  size_t num_unit = 0;
  for (const std::vector<double>& row : rows) {
    const double length = std::hypot(row[first], row[first + 1], row[first + 2]);
    if (std::abs(length - 1) < 0.01)
      ++num_unit;
    else if (length != 0)
      return false;
  }
  // Zero stands where a program found no normal.
  return 2 * num_unit > rows.size();
}

bool AreBytes(const Rows& rows, size_t first) {
  return std::all_of(rows.begin(), rows.end(), [first](const std::vector<double>& row) {
    return std::all_of(row.begin() + first, row.begin() + first + 3, [](double value) {
      return value >= 0 && value <= 255 && value == std::floor(value);
    });
  });
}

bool AreNotNegative(const Rows& rows, size_t first) {
  return std::all_of(rows.begin(), rows.end(), [first](const std::vector<double>& row) {
    return !(*std::min_element(row.begin() + first, row.begin() + first + 3) < 0);
  });
}

}  // namespace

void SplitWords(std::string_view line, bool decimal_commas, std::vector<std::string_view>* words) {
  const char* const between = decimal_commas ? " \t;\r" : " \t,;\r";
  words->clear();
  size_t at = line.find_first_not_of(between);
  while (at != std::string_view::npos && words->size() <= kMostColumns) {
    const size_t end = std::min(line.find_first_of(between, at), line.size());
    words->push_back(line.substr(at, end - at));
    at = line.find_first_not_of(between, end);
  }
}

bool HasCommasInNumbers(std::string_view line) {
  if (line.find(',') == std::string_view::npos) return false;
  std::vector<std::string_view> words;
  SplitWords(line, true, &words);
  return words.size() >= 3 && std::all_of(words.begin(), words.end(), IsNumberWithCommas);
}

bool IsXyzComment(std::string_view line) {
  return line.substr(0, 1) == "#" || line.substr(0, 2) == "//";
}

bool ParseXyzNumber(std::string_view word, bool decimal_commas, double* number) {
  const size_t comma = decimal_commas ? word.find(',') : std::string_view::npos;
  if (comma == std::string_view::npos) return ParseReal(word, number);
  std::string with_point(word);
  with_point[comma] = '.';
  return ParseReal(with_point, number);
}

XyzColumns XyzColumns::ByNumber(size_t count, const Rows& rows) {
  XyzColumns columns;
  columns.count = count;
  // Behind x, y, z: [intensity] [r g b [scalar]] [normal].
  size_t end = count;
  if (count >= 6 && count != 8 && !rows.empty() && AreUnitVectors(rows, count - 3)) {
    end -= 3;
    std::iota(columns.normal, columns.normal + 3, static_cast<int>(end));
  }
  if (end == 4) columns.intensity = 3;
  if (end == 6 && AreNotNegative(rows, 3)) std::iota(columns.color, columns.color + 3, 3);
  if (end < 7) return columns;
  const bool scalar_is_behind = !rows.empty() && AreBytes(rows, 3) && !AreBytes(rows, 4);
  columns.intensity = scalar_is_behind ? 6 : 3;
  std::iota(columns.color, columns.color + 3, scalar_is_behind ? 3 : 4);
  return columns;
}

std::optional<XyzColumns> XyzColumns::ByName(const std::vector<std::string_view>& words) {
  std::vector<std::string> names, units;
  for (const std::string_view word : words) {
    std::string name(word);
    for (const char mark : {'"', '\'', '/', '#'}) {
      name.erase(std::remove(name.begin(), name.end(), mark), name.end());
    }
    name = LowerCase(name);
    // A unit, stuck to the name or a word by itself.
    std::string unit;
    const size_t at = name.find_first_of("[(");
    if (at != std::string::npos && (name.back() == ']' || name.back() == ')')) {
      unit = name.substr(at + 1, name.size() - at - 2);
      name.erase(at);
    }
    if (!name.empty()) {
      names.push_back(name);
      units.push_back(unit);
    } else if (!units.empty() && !unit.empty()) {
      units.back() = unit;
    }
  }
  // The first of `wanted` that is there.
  const auto find = [&names](std::initializer_list<const char*> wanted) {
    for (const char* name : wanted) {
      const auto found = std::find(names.begin(), names.end(), name);
      if (found != names.end()) return static_cast<int>(found - names.begin());
    }
    return -1;
  };
  const auto keep_whole = [](int(&three)[3]) {
    if (*std::min_element(three, three + 3) < 0) std::fill(three, three + 3, -1);
  };
  XyzColumns columns;
  columns.count = names.size();
  columns.place[0] = find({"x", "easting", "east"});
  columns.place[1] = find({"y", "northing", "north"});
  columns.place[2] = find({"z", "elevation", "height"});
  if (*std::min_element(columns.place, columns.place + 3) < 0) return std::nullopt;
  const auto unit_of = [&](int k) { return LengthUnitOf(units[columns.place[k]]); };
  if (unit_of(0) == unit_of(1) && unit_of(0) == unit_of(2)) columns.unit = unit_of(0);
  columns.intensity = find({"intensity", "i", "scalar_intensity", "reflectance"});
  columns.color[0] = find({"r", "red"});
  columns.color[1] = find({"g", "green"});
  columns.color[2] = find({"b", "blue"});
  columns.normal[0] = find({"nx", "normal_x"});
  columns.normal[1] = find({"ny", "normal_y"});
  columns.normal[2] = find({"nz", "normal_z"});
  keep_whole(columns.color);
  keep_whole(columns.normal);
  return columns;
}

XyzLayout FindXyzLayout(std::string_view start) {
  start.remove_prefix(SizeOfByteOrderMark(start));
  XyzLayout layout;
  layout.decimal_commas = FindDecimalCommas(start);
  std::optional<XyzColumns> named, named_in_comment;
  Rows rows;
  std::vector<std::string_view> words;
  bool is_none = false, had_count = false;
  ForLines(start, [&](std::string_view line) {
    SplitWords(line, layout.decimal_commas, &words);
    if (words.empty()) return true;
    if (IsXyzComment(line)) {
      if (const auto found = XyzColumns::ByName(words)) named_in_comment = found;
      return true;
    }
    const bool fits_comment = named_in_comment && named_in_comment->count == words.size();
    if (rows.empty() && !named && !fits_comment && !AreNumbers(words, layout.decimal_commas)) {
      named = XyzColumns::ByName(words);
      is_none = !named;
      return !is_none;
    }
    if (named || (rows.empty() && fits_comment)) {
      if (!named) named = named_in_comment;
      return false;
    }
    if (rows.empty() && words.size() < 3) {  // the number of points
      is_none = had_count || words.size() == 2;
      had_count = true;
      return !is_none;
    }
    if (words.size() != (rows.empty() ? words.size() : rows[0].size())) return true;
    std::vector<double> row(words.size());
    for (size_t i = 0; i < row.size(); ++i) {
      if (!ParseXyzNumber(words[i], layout.decimal_commas, &row[i])) return false;
    }
    rows.push_back(row);
    return rows.size() < kMostRows;
  });
  if (is_none) return layout;
  if (named) {
    layout.columns = named;
  } else if (!rows.empty()) {
    layout.columns = XyzColumns::ByNumber(rows[0].size(), rows);
  }
  return layout;
}

}  // namespace roomtex
