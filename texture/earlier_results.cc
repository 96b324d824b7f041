#include "texture/earlier_results.h"

#include <filesystem>

#include "core/json_text.h"

namespace roomtex {
namespace fs = std::filesystem;

void TakeOverTrustOfResult(const std::string& path, const std::string& command, bool accept,
                           const Command::Context& context) {
  fs::path folder = fs::absolute(path).parent_path();
  std::error_code error;
  if (folder.filename().string().rfind("station_", 0) == 0 &&
      !fs::exists(folder / "report.json", error)) {
    folder = folder.parent_path();
  }
  const Json report = ReadJsonIfAny((folder / "report.json").string());
  if (!report.is_object() || report.value("command", Json()) != command ||
      report.value("trusted", Json()) != false) {
    return;
  }
  const Json why = report.value("reason", Json());
  const std::string reason = path + ", which " + command + " made, is not to be trusted" +
                             (why.is_string() ? ": " + why.get<std::string>() : ".");
  if (accept) {
    context.Warn(reason);
  } else {
    context.report.SetUntrusted(reason + " (--accept_untrusted 1 takes it as it is.)");
  }
}

}  // namespace roomtex
