#include "workflow/late_inputs.h"

#include <csignal>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <system_error>

#include "core/child_program.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/photo_files.h"
#include "core/photo_fit.h"
#include "core/text.h"
#include "workflow/own_commands.h"

namespace roomtex {
namespace {

constexpr char kCommand[] = "roomtex-import";
constexpr char kLook[] = "scans";  // how its log is called

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
  for (const std::string& path : chain.options().scan_paths) {
    if (!IsPhotoName(path)) continue;  // such ones are panoramas to the command
    throw InputError(path, "", "is a photo, expected a range scan",
                     "Give photos with --image_path, panoramas with --panoramas_path");
  }
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

}  // namespace roomtex
