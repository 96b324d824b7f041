#pragma once
// What the columns of a text file of points are, as the lines that it begins with show.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace roomtex {

// The words of a line: between blanks, tabs, semicolons and, unless decimal_commas, commas.
void SplitWords(std::string_view line, bool decimal_commas, std::vector<std::string_view>* words);
// Whether blanks, tabs or semicolons part three numbers and more, of which some have commas within:
// such as "1,5 2,5 3.5" and "1,234.5 2,345.6 7.8".
bool HasCommasInNumbers(std::string_view line);
// Begins with # or //.
bool IsXyzComment(std::string_view line);
// "nan", "inf" and what no double holds are numbers, too: of no point.
bool ParseXyzNumber(std::string_view word, bool decimal_commas, double* number);

// Indices of columns; -1 = there is none.
struct XyzColumns {
  int place[3] = {0, 1, 2};
  int intensity = -1;
  int color[3] = {-1, -1, -1};
  int normal[3] = {-1, -1, -1};
  size_t count = 0;
  // One of LengthUnitNames(), where x, y and z are named with it alike; "" = not said.
  std::string unit;

  // By their number and, where that leaves it open, by what stands in them: three last columns of
  // unit length are a normal; of "r g b scalar" and "intensity r g b" those are the colours that
  // are whole numbers up to 255. rows: the first points of the file, count numbers each.
  static XyzColumns ByNumber(size_t count, const std::vector<std::vector<double>>& rows);
  // None if the words do not name x, y and z. What makes a line a comment is no part of a name.
  static std::optional<XyzColumns> ByName(const std::vector<std::string_view>& words);
};

struct XyzLayout {
  bool decimal_commas = false;  // "1,5 2,5 3,5" and "1,5;2,5;3,5"
  // None if no line of at least three numbers is there, or what stands before it names no columns
  // and is no comment.
  std::optional<XyzColumns> columns;
};

// start: of the file, whole lines. Names in a comment are those of the columns where there are as
// many: other comments have x, y and z in them, too.
XyzLayout FindXyzLayout(std::string_view start);

}  // namespace roomtex
