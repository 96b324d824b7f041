#include "texture/earlier_results.h"

#include <filesystem>

#include "core/error.h"
#include "core/json_text.h"
#include "importers/scan_record.h"

namespace roomtex {
namespace fs = std::filesystem;
namespace {

bool HoldsModelFiles(const std::string& folder) {
  for (const char* name : kSparseModelFiles) {
    for (const char* extension : {".bin", ".txt"}) {
      std::error_code error;
      if (fs::exists((fs::path(folder) / name).replace_extension(extension), error)) return true;
    }
  }
  return false;
}

}  // namespace

SparseModel ReadAlignedModel(const std::string& folder) {
  const AlignmentRecord alignment = ReadAlignmentRecord(folder);
  if (alignment.found && !alignment.trusted && !HoldsModelFiles(folder)) {
    throw InputError(folder, "",
                     "holds no model, only the report of roomtex-align, which refused to align: " +
                         (alignment.reason.empty() ? "it does not say why." : alignment.reason),
                     "Align anew; what stands in the way is in alignment.json there");
  }
  return ReadSparseModel(folder);
}

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
