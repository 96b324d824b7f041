#include "workflow/late_inputs.h"

#include <optional>

#include "core/csv.h"
#include "core/error.h"
#include "core/text.h"
#include "importers/scan_reader.h"

namespace roomtex {
namespace {

constexpr double kHeldSamples = 1000;  // of scans that are read to be looked at
constexpr char kPickColumns[] = "image_name,x,y,scan_x,scan_y,scan_z";
constexpr size_t kNumPickColumns = 6;  // the first is a name, weight and label may follow

bool IsHeader(const std::vector<std::string>& fields) {
  std::string names;
  for (size_t i = 0; i < std::min(fields.size(), kNumPickColumns); ++i) {
    names += (i > 0 ? "," : "") + LowerCase(fields[i]);
  }
  return names == kPickColumns;
}

}  // namespace

void RequireReadableScans(const AutoOptions& options) {
  ScanReaderOptions reader;
  reader.azimuth = options.azimuth;
  reader.units = options.units;
  reader.max_range = options.max_range;
  reader.up_axis = options.up_axis;
  reader.e57_check = options.e57_check;
  ThrowIfProblems(reader.Problems());
  ReadPlacedScans(options.scan_paths, options.scan_poses, reader, kHeldSamples);
}

void RequireReadablePicks(const std::string& path) {
  const std::string expected = std::string("Expected a CSV file with the header ") + kPickColumns;
  CsvReader table(path, "Make it with roomtex-pick, or leave --picks_path out", expected);
  table.CommentsFrom(1);
  size_t num_columns = 0;
  while (table.Next()) {
    const std::optional<std::vector<std::string>> fields = table.Fields();
    if (num_columns == 0) {
      if (!fields || !IsHeader(*fields)) {
        throw table.Error(Quoted(table.line()) + " is no header of a picks file", expected);
      }
      num_columns = fields->size();
      continue;
    }
    bool is_pick = fields && fields->size() == num_columns && !(*fields)[0].empty();
    for (size_t i = 1; is_pick && i < kNumPickColumns; ++i) {
      is_pick = ParseNumber((*fields)[i]).has_value();
    }
    if (!is_pick) {
      throw table.Error(Quoted(table.line()) + " is no pick",
                        "Expected " + std::string(kPickColumns) +
                            " as the header has them: correct the line or remove it");
    }
  }
  if (num_columns == 0) throw InputError(path, "", "holds no picks", expected);
}

}  // namespace roomtex
