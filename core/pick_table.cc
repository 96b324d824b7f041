#include "core/pick_table.h"

#include <algorithm>
#include <map>
#include <tuple>

#include <fmt/core.h>

#include "core/csv.h"
#include "core/error.h"
#include "core/output_file.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr char kHeader[] = "image_name,x,y,scan_x,scan_y,scan_z";
constexpr int kNumFields = 6;  // and behind them, where the header has them:
constexpr char kWeight[] = "weight";
constexpr char kLabel[] = "label";
const char* const kFieldNames[kNumFields] = {"image_name", "x", "y", "scan_x", "scan_y", "scan_z"};

// The columns that the header announces; -1 = it has none of them.
struct Columns {
  int count = 0, weight = -1, label = -1;
  std::string names;
};

Columns ReadHeader(const CsvReader& table) {
  const auto fields = table.Fields();
  Columns columns;
  columns.count = fields ? static_cast<int>(fields->size()) : 0;
  columns.names = kHeader;
  bool matches = columns.count >= kNumFields;
  for (int i = 0; matches && i < columns.count; ++i) {
    const std::string name = LowerCase((*fields)[i]);
    if (i < kNumFields) {
      matches = name == kFieldNames[i];
      continue;
    }
    int* const column = name == kWeight  ? &columns.weight
                        : name == kLabel ? &columns.label
                                         : nullptr;
    matches = column != nullptr && *column < 0;
    if (!matches) break;
    *column = i;
    columns.names += "," + name;
  }
  if (matches) return columns;
  const bool looks_like_pick = columns.count >= kNumFields && ParseNumber((*fields)[1]);
  throw table.Error(looks_like_pick ? "the header is missing: the first line is a pick already"
                                    : "found " + Quoted(table.line()) +
                                          " where the header of a picks file should be",
                    fmt::format("Expected the header line {} (and, if wanted, {} and {} behind it)",
                                kHeader, kWeight, kLabel));
}

double ParseField(const CsvReader& table, const std::string& name, const std::string& field) {
  const auto value = ParseNumber(field);
  if (value) return *value;
  throw table.Error(fmt::format("{} is {}, which is not a finite number", name, Quoted(field)),
                    "Correct the line or remove it");
}

Pick ParsePick(const CsvReader& table, const Columns& columns) {
  const auto fields = table.Fields();
  if (!fields) {
    throw table.Error("a quoted name is not closed by a quote",
                      "A quote inside a quoted name is written twice");
  }
  if (static_cast<int>(fields->size()) != columns.count) {
    throw table.Error(
        fmt::format("found {} fields, expected {} ({})", fields->size(), columns.count,
                    columns.names),
        "Separate fields by commas, write decimals with a point, and put a name that holds a comma "
        "in double quotes");
  }
  if ((*fields)[0].empty()) {
    throw table.Error("the image name is empty", "Name the photo as in the sparse model");
  }
  double values[kNumFields - 1];
  for (int i = 1; i < kNumFields; ++i) {
    values[i - 1] = ParseField(table, kFieldNames[i], (*fields)[i]);
  }
  Pick pick{
      (*fields)[0], {values[0], values[1]}, {values[2], values[3], values[4]}, table.line_number()};
  if (columns.weight >= 0) {
    const std::string& field = (*fields)[columns.weight];
    pick.weight = ParseField(table, kWeight, field);
    if (!(pick.weight >= 0 && pick.weight <= kMaxPickWeight)) {
      throw table.Error(
          fmt::format("{} is {}", kWeight, Quoted(field)),
          fmt::format(
              "A weight is 1 for an ordinary pick, more for a more exact one (up to {:g}), 0 "
              "for a check point, on which nothing rests",
              kMaxPickWeight));
    }
  }
  if (columns.label >= 0) pick.label = (*fields)[columns.label];
  return pick;
}

void RefuseDuplicates(const std::string& path, const std::vector<Pick>& picks) {
  using PixelKey = std::tuple<std::string, double, double>;
  using ScanKey = std::tuple<std::string, double, double, double>;
  std::map<PixelKey, long> pixels;
  std::map<ScanKey, long> scan_points;
  for (const Pick& pick : picks) {
    const auto [pixel, new_pixel] =
        pixels.insert({{pick.image_name, pick.x_in_img.x(), pick.x_in_img.y()}, pick.line});
    const auto [scan_point, new_scan_point] = scan_points.insert(
        {{pick.image_name, pick.x_in_scan.x(), pick.x_in_scan.y(), pick.x_in_scan.z()}, pick.line});
    if (new_pixel && new_scan_point) continue;
    const std::string what = !new_pixel && !new_scan_point ? "the same pick"
                             : !new_pixel                  ? "the same pixel"
                                                           : "the same scan point";
    const long earlier = new_pixel ? scan_point->second : pixel->second;
    throw InputError(
        path, LinePosition(pick.line),
        fmt::format("{} of {} stands on line {} already", what, pick.image_name, earlier),
        "Remove one of the two lines");
  }
}

}  // namespace

std::string LineOf(const Pick& pick) {
  return pick.line > 0 ? LinePosition(pick.line) : "a pick of " + pick.image_name;
}

std::vector<Pick> ReadPicks(const std::string& path) {
  CsvReader table(path, "Check --picks_path",
                  std::string("Expected a CSV file with the header ") + kHeader);
  table.CommentsFrom(1);  // behind the photo's name
  std::vector<Pick> picks;
  Columns columns;  // none = the header is still to come
  while (table.Next()) {
    if (columns.count == 0) {
      columns = ReadHeader(table);
    } else {
      picks.push_back(ParsePick(table, columns));
    }
  }
  if (columns.count == 0) {
    throw InputError(path, "", "holds no picks",
                     std::string("Expected the header line ") + kHeader);
  }
  RefuseDuplicates(path, picks);
  return picks;
}

void WritePicks(const std::string& path, const std::vector<Pick>& picks) {
  OutputFile file(path);
  const bool weighted =
      std::any_of(picks.begin(), picks.end(), [](const Pick& pick) { return pick.weight != 1; });
  const bool labelled =
      std::any_of(picks.begin(), picks.end(), [](const Pick& pick) { return !pick.label.empty(); });
  file.stream() << kHeader << (weighted ? std::string(",") + kWeight : "")
                << (labelled ? std::string(",") + kLabel : "") << '\n';
  for (const Pick& pick : picks) {
    std::vector<std::string> fields = {pick.image_name};
    for (const double x : pick.x_in_img) fields.push_back(Exact(x));
    for (const double x : pick.x_in_scan) fields.push_back(Exact(x));
    if (weighted) fields.push_back(Exact(pick.weight));
    if (labelled) fields.push_back(pick.label);
    file.stream() << CsvLine(fields);
  }
  file.Commit();
}

}  // namespace roomtex
