#pragma once
// What the steps of one run share: its options, the places of its files, what has been seen so far,
// and command lines.

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/colmap_program.h"
#include "core/report.h"
#include "workflow/auto_options.h"
#include "workflow/capture_facts.h"

namespace roomtex {

using CommandLine = std::vector<std::string>;  // the program's name first

// One run: its options, the places of its files, and what has been seen so far.
class Chain {
 public:
  explicit Chain(const AutoOptions& options);

  const AutoOptions& options() const { return options_; }
  std::string At(const std::string& name) const { return options_.output_path + "/" + name; }
  std::string LogOf(const std::string& step) const { return At("log/" + step + ".log"); }
  std::string ReportOf(const std::string& step) const { return At("log/" + step + ".json"); }

  // The photos as they were given, or as they were cut out of videos or panoramas.
  std::string PhotoFolder() const;
  // The same; where a pattern was projected, those with it and those without; beside the scanner's
  // own photos, links to the user's and theirs.
  std::string ColmapFolder() const;
  std::string ColorFolder() const;
  bool IsAssociated() const;                          // patterned and plain photos were told apart
  bool IsPhotoFolder(const std::string& path) const;  // one of these, or the user's
  // The scanner's own photos, in an E57. OnlyScanner: the user has none.
  bool OnlyScanner() const;
  bool UsesScanner() const { return !scanner_scan_.empty() && !IsAssociated(); }
  const std::string& ScannerScan() const { return scanner_scan_; }  // FILE or FILE#PART
  // Theirs with links to the user's, and theirs.
  std::string LinkFolder() const { return At("with_scanner"); }
  std::string ScannerFolder() const;
  // cameras[] of the report of roomtex-import; empty before it has run, and without poses.
  Json ScannerCameras() const;
  // What roomtex-mapper made: sparse/0, and those of photos that nothing connects to its own, or of
  // rooms that are alike.
  std::vector<std::string> SparseModels() const;
  // Their model, for roomtex-mapper, also before it is there; "" = none.
  std::string KnownPath() const;
  // The picks; "" = there are none.
  std::string PicksPath() const;
  // The aligned model, also one that was put beside a trusted one.
  std::string AlignedPath() const;

  // Read when they are first asked for.
  const std::vector<PhotoFacts>& Photos(const std::string& folder);
  ColmapProgram& Colmap();
  bool SeemsPatterned();

  // What a person types to pick points.
  CommandLine PickCommand() const;
  // The command line of this run, to start it again.
  CommandLine AutoCommand() const;

 private:
  const AutoOptions& options_;
  std::string scanner_scan_;
  std::vector<std::pair<std::string, std::vector<PhotoFacts>>> photos_;
  std::optional<ColmapProgram> colmap_;
  std::optional<bool> seems_patterned_;
};

// Small things that all of it uses.
bool IsThere(const std::string& path);
Json ReadJsonFile(const std::string& path);  // null if it is not there or no JSON object
// Nothing if the value is empty.
void AddOption(const std::string& name, const std::string& value, CommandLine* line);
// --num_threads and --random_seed.
void AddCommon(const AutoOptions& options, CommandLine* line);
// How the scans are read, as far as the user said it.
void AddScanReading(const AutoOptions& options, CommandLine* line);

// Where COLMAP's steps leave the database until it holds all matches.
inline constexpr char kPartialDatabase[] = "database.partial.db";
// What it is called then.
inline constexpr char kDatabase[] = "database.db";

}  // namespace roomtex
