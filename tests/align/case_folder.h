#pragma once
// A simulated case as files in a folder, for running roomtex-align on it as a user would.

#include <string>

#include "colmap_ext/sparse_model.h"
#include "core/output_file.h"
#include "core/scan_mesh.h"
#include "importers/scan_writer.h"
#include "tests/align/simulated_alignment.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {

struct CaseFolder {
  explicit CaseFolder(const SimulatedCase& one) {
    WriteSparseModel(one.model, folder / "sparse");
    WriteScan(one.scans[0], {}, folder / "room.rtpi");
    WritePicks(folder / "picks.csv", one.picks);
  }

  // roomtex-align on these files, with more options.
  CommandResult Align(const std::string& more = "") const {
    return RunCommandLine("roomtex-align --quiet --input_path " + input_path + " --scan_path " +
                          scan_path + " --picks_path " + picks_path + " --output_path " +
                          output_path + " " + more);
  }

  TempFolder folder;
  std::string input_path = folder / "sparse", scan_path = folder / "room.rtpi";
  std::string picks_path = folder / "picks.csv", output_path = folder / "aligned";
};

}  // namespace roomtex
