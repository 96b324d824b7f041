#include "workflow/late_inputs.h"

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "core/child_program.h"
#include "core/command_line.h"
#include "core/csv.h"
#include "core/error.h"
#include "core/photo_fit.h"
#include "core/text.h"
#include "workflow/own_commands.h"

namespace roomtex {
namespace {

constexpr char kCommand[] = "roomtex-import";
constexpr char kLook[] = "scans";  // how its log is called
constexpr char kPickColumns[] = "image_name,x,y,scan_x,scan_y,scan_z";
constexpr size_t kNumPickColumns = 6;  // the first is a name, weight and label may follow

bool IsHeader(const std::vector<std::string>& fields) {
  std::string names;
  for (size_t i = 0; i < std::min(fields.size(), kNumPickColumns); ++i) {
    names += (i > 0 ? "," : "") + LowerCase(fields[i]);
  }
  return names == kPickColumns;
}

// The sentence that an InputError of a command was: "PATH: FINDING. REMEDY."
[[noreturn]] void ThrowAgain(const std::string& sentence) {
  const std::string between = ": ";
  const size_t end = sentence.find(between);
  if (end == std::string::npos) throw InputError(kCommand, "", AsClause(sentence), "");
  throw InputError(sentence.substr(0, end), "", AsClause(sentence.substr(end + between.size())),
                   "");
}

}  // namespace

void RequireReadableScans(const Chain& chain) {
  const std::string report_path = chain.ReportOf(kLook);
  std::error_code ignored;
  std::filesystem::remove(report_path, ignored);  // not there, or replaced
  std::ofstream(chain.LogOf(kLook), std::ios::trunc) << kCommand << " " << Version() << "\n";
  CommandLine line = {FindOwnCommand(kCommand)};
  for (const std::string& path : chain.options().scan_paths) AddOption("--input_path", path, &line);
  AddScanReading(chain.options(), &line);
  if (chain.options().azimuth == "auto") AddOption("--azimuth", "auto", &line);  // not its default
  AddOption("--report_path", report_path, &line);
  AddOption("--quiet", "1", &line);
  ChildSettings settings;
  settings.log_path = chain.LogOf(kLook);
  settings.stop_signal = SIGTERM;
  const ChildRun run = RunChild(line, settings);
  if (run.success) return;
  const std::string reason = ReasonOf(kCommand, report_path, run);
  if (run.exit_code == kExitUsage) throw UsageError(reason);
  if (run.exit_code == kExitInput) ThrowAgain(reason);
  throw std::runtime_error(std::string(kCommand) + ": " + reason);
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
