#include "workflow/own_commands.h"

#include "core/text.h"
#include "workflow/chain.h"

namespace roomtex {

std::string FindOwnCommand(const std::string& name) {
  return FindProgram(BesideThisProgram(name), "Install all commands of roomtex together");
}

std::string ReasonOf(const std::string& name, const std::string& report_path, const ChildRun& run) {
  const Json report = ReadJsonFile(report_path);
  if (report.is_object() && !report.value("reason", std::string()).empty()) {
    return report["reason"].get<std::string>();
  }
  const std::string prefix = name + ": ";
  for (size_t i = run.last.size(); i-- > 0;) {
    if (BeginsWith(run.last[i], prefix)) return run.last[i].substr(prefix.size());
  }
  return run.failure + (run.last.empty() ? "" : ": " + run.last.back());
}

}  // namespace roomtex
