// roomtex-site: one page over all rooms of a site, from what roomtex-auto reported of each.

#include <filesystem>

#include "core/command_line.h"
#include "core/commit_together.h"
#include "core/error.h"
#include "core/input_guard.h"
#include "core/output_file.h"
#include "core/standard_files.h"
#include "workflow/site_page.h"
#include "workflow/site_rooms.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;

struct SiteOptions {
  std::string input_path, rooms_path, output_path;
};

void ReportSite(const SiteOptions& options, const Command::Context& context) {
  RequireFolder(options.input_path, "Give the folder that holds the rooms' output folders");
  if (fs::path(options.output_path).extension() == ".json") {
    throw UsageError("--output_path " + options.output_path +
                     " is the page: give a name that ends with .html");
  }
  const std::vector<SiteRoom> rooms = options.rooms_path.empty()
                                          ? FindSiteRooms(options.input_path)
                                          : ReadSiteRooms(options.rooms_path);
  for (const SiteRoom& room : rooms) {
    for (const char* file : {"steps.json", "report.json", "report.html", "log/align.json"}) {
      NoteInput((fs::path(options.input_path) / room.name / file).string());
    }
  }
  const std::string copy = fs::path(options.output_path).replace_extension(".json").string();
  RefuseToReplaceInput(copy);
  const Json keys = MakeSiteKeys(options.input_path, rooms);
  const fs::path page = fs::absolute(options.output_path).lexically_normal();
  const std::string to_rooms = fs::absolute(options.input_path)
                                   .lexically_normal()
                                   .lexically_relative(page.parent_path())
                                   .generic_string();
  CommitFilesAtEnd();
  OutputFile file(options.output_path);
  file.stream() << MakeSitePage(keys, to_rooms == "." ? "" : to_rooms + "/");
  file.Commit();
  for (const auto& [key, value] : keys.items()) context.report[key] = value;
  context.report.AddCopy(copy);

  std::string names;
  for (const Json& room : keys["rooms"]) {
    if (room["state"] == "trusted") continue;
    names += (names.empty() ? "" : ", ") + room["name"].get<std::string>() + " (" +
             room["headline"].get<std::string>() + ")";
  }
  if (!names.empty()) context.report.SetUntrusted("look after " + names + ".");
  const Json& joined = keys["joined"];
  if (!joined.is_null() && !joined["trusted"].get<bool>()) {
    context.report.SetUntrusted(joined["reason"].get<std::string>());
  }
  AnswerAtEnd(keys["verdict"]["headline"].get<std::string>() + "\n" + options.output_path + "\n");
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  using namespace roomtex;
  SiteOptions options;
  Command command("roomtex-site",
                  "One page over all rooms of a site: what can be trusted, what to do and to "
                  "photograph again, what it cost.",
                  "roomtex-site --input_path result --output_path result/site.html");
  command.AddInputPath("input_path", &options.input_path,
                       "Folder that holds a folder for each room, the --output_path of "
                       "roomtex-auto.");
  command.AddInputPath("rooms_path", &options.rooms_path,
                       "Table with the column room, and notes if there are any, e.g. site.csv; not "
                       "given = all rooms that are there.",
                       Command::Kind::kOptional);
  command.AddOutputPath("output_path", &options.output_path,
                        "Where to write the page (.html); beside it the same as .json.");
  return command.Run(argc, argv,
                     [&](const Command::Context& context) { ReportSite(options, context); });
}
