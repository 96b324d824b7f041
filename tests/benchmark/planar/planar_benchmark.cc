// How often COLMAP's own mapper, the thesis' rule and roomtex start right before walls, reliefs,
// corners and in rooms, on simulated keypoints with known truth. docs/colmap.md shows the tables.
//   planar_benchmark --table in_process
//   planar_benchmark --table mapper --sets 50

#include <cstdio>
#include <exception>

#include <CLI/CLI.hpp>

#include "tests/benchmark/planar/end_to_end_table.h"
#include "tests/benchmark/planar/in_process_table.h"

int main(int argc, char** argv) {
  using namespace roomtex;
  CLI::App app("Simulated planar sets against their truth.");
  std::string table = "in_process", rows, show;
  int sets = 0, jobs = 1, seed = 0, rival_sets = -1;
  EndToEndOptions programs;
  app.add_option("--table", table, "in_process, mapper, sequences or adversarial")
      ->check(CLI::IsMember({"in_process", "mapper", "sequences", "adversarial"}));
  app.add_option("--sets", sets, "Sets per row (in_process: per cell of a row); 0 = 50 (12)");
  app.add_option("--rows", rows, "Only rows whose name holds this");
  app.add_option("--jobs", jobs, "Sets side by side");
  app.add_option(
      "--rival_sets", rival_sets,
      "in_process: sets per cell that run the thesis' rule and the lower cost; -1 = all");
  app.add_option("--roomtex_mapper", programs.roomtex_mapper, "The program")->capture_default_str();
  app.add_option("--colmap", programs.colmap, "The program")->capture_default_str();
  app.add_option("--show", show,
                 "Tells all about the set of this name and --seed, without a table");
  app.add_option("--seed", seed, "0-199, for --show");
  CLI11_PARSE(app, argc, argv);
  try {
    if (!show.empty()) {
      ShowSet(FindSet(show), seed, stdout);
      ShowPrograms(FindSet(show), seed, programs, stdout);
    } else if (table == "in_process") {
      InProcessOptions options;
      if (sets > 0) options.sets_per_cell = sets;
      options.rows = rows;
      options.jobs = jobs;
      options.rival_sets_per_cell = rival_sets < 0 ? options.sets_per_cell : rival_sets;
      PrintInProcessTable(options, stdout);
    } else {
      if (sets > 0) programs.sets_per_row = sets;
      programs.rows = rows;
      programs.jobs = jobs;
      PrintEndToEndTable(table, programs, stdout);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "planar_benchmark: %s\n", error.what());
    return 1;
  }
}
