#pragma once
// One sparse model brought into the scan, with everything that is said of it.

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "align/command/align_options.h"
#include "align/command/scan_reading.h"
#include "align/search/search_hint.h"
#include "colmap_ext/database.h"
#include "colmap_ext/mapper_verdict.h"
#include "colmap_ext/sparse_model.h"
#include "core/command_line.h"

namespace roomtex {

struct ModelToAlign {
  // Those of the command, with the picks and hints of other models' photos left out: picks_path and
  // near are "" where there are none of this one's.
  AlignCommandOptions options;
  SparseModel model;
  MapperVerdict verdict;
  std::vector<Pick> picks;
  std::vector<NearHint> near;
  std::set<std::string> told;  // of LookForPhotos()
};

// The model of options.input_path, and what its mapper said of it; no picks. Throws InputError.
ModelToAlign ReadModelToAlign(const AlignCommandOptions& options, const Command::Context& context);
// Where the photos belong, besides the picks, which are checked: fewer than six are a hint where
// there are photos to confirm what is found.
std::vector<NearHint> ReadHints(const AlignCommandOptions& a, const std::vector<Pick>& picks,
                                const SparseModel& model, const Command::Context& context);
// Moves picks and hints to where the scans are held.
void MoveToLocal(const ScanReading& reading, ModelToAlign* one);

struct AlignedModel {
  SparseModel model;             // `scan`, about the local origin
  Similarity local_from_sparse;  // from the model as it was read
  RowMotions row_motions;        // of its photos
};

// The report of the context gets what is said of the model. None: it has no place, and refusal says
// why. may_turn: the scans may turn out to be mirrored. Throws InputError.
std::optional<AlignedModel> AlignOne(ModelToAlign one, const Database* database, bool may_turn,
                                     ScanReading* reading, std::string* refusal,
                                     const Command::Context& context);

// The planes of the scans (thesis 7.2), where they are asked for.
std::vector<ScanPlane> PlanesOf(const AlignCommandOptions& a, const SurveyedScans& surveyed);

}  // namespace roomtex
