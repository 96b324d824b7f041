// roomtex-merge: matches that were made on copies of one database, in one.

#include <memory>

#include <fmt/core.h>

#include "colmap_ext/database.h"
#include "core/command_line.h"
#include "core/output_file.h"
#include "core/standard_files.h"

namespace roomtex {
namespace {

struct MergeOptions {
  std::string database_path, output_path;
  std::vector<std::string> copy_paths;
};

void Merge(const MergeOptions& options, const Command::Context& context) {
  context.progress.Stage("read databases");
  const Database database(options.database_path);
  std::vector<std::unique_ptr<Database>> opened;
  std::vector<const Database*> copies;
  for (const std::string& path : options.copy_paths) {
    opened.push_back(std::make_unique<Database>(path));
    copies.push_back(opened.back().get());
  }
  context.progress.Stage("write database");
  OutputFile file(options.output_path);
  database.CopyWithMatches(file.partial_path(), copies);
  file.Commit();
  const size_t before = database.CountMatches().size();
  const size_t after = Database(options.output_path).CountMatches().size();
  context.report["num_images"] = database.ReadImages().size();
  context.report["num_pairs"] = after;
  context.report["num_pairs_added"] = after - before;
  AnswerAtEnd(fmt::format("{}: {} pairs, {} of them from {} copies\n", options.output_path, after,
                          after - before, copies.size()));
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  using namespace roomtex;
  MergeOptions options;
  Command command("roomtex-merge",
                  "Puts the matches that COLMAP made on copies of one database, of other pairs on "
                  "each, into one.",
                  "roomtex-merge --database_path database.db --copy_path part1.db "
                  "--copy_path part2.db --output_path merged.db");
  command.AddInputPath("database_path", &options.database_path,
                       "COLMAP's database with features. Only read.");
  command.AddInputPaths("copy_path", &options.copy_paths,
                        "A copy of it in which pairs were matched. Only read.",
                        Command::Kind::kRequired);
  command.AddOutputPath("output_path", &options.output_path,
                        "Where to write the database with all pairs. Of a pair that is matched in "
                        "several, the first counts.");
  return command.Run(argc, argv, [&](const Command::Context& context) { Merge(options, context); });
}
