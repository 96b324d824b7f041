#pragma once
// What roomtex-align says and writes, however the photos were aligned.

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "align/command/align_options.h"
#include "align/command/scan_reading.h"
#include "align/trust/perspective_views.h"
#include "colmap_ext/sparse_model.h"
#include "core/command_line.h"
#include "core/similarity.h"

namespace roomtex {

// Those that are written into --output_path where there is a model.
std::vector<std::string> FilesOfAlignedModel();

// The photos of the models that can be compared with the scan; what there is to say about the
// others (the report's `photos_left_out`). Returns the reasons that were told. Throws InputError
// with --strict 1.
std::set<std::string> LookForPhotos(const AlignCommandOptions& a,
                                    const std::vector<const SparseModel*>& models,
                                    const Command::Context& context);
// What photos and scan, and photos and photos, say about each other.
struct WhatPhotosSay {
  bool agree = false;                 // both speak for the alignment
  std::optional<double> shown_share;  // GradientShifts::ShownShare()
};
// The report's `agreement` and `divided_photos`; of a.image_path. told: of LookForPhotos().
WhatPhotosSay CompareWithPhotos(const AlignCommandOptions& a, const AlignedPhotos& aligned,
                                const SurveyedScans& surveyed, const std::set<std::string>& told,
                                const Command::Context& context);
// --Plane.output_path; appears with what is written next.
void WritePlanes(const AlignCommandOptions& a, const ScanReading& reading,
                 const Command::Context& context);
// Nothing but the report, which says why; an earlier result that was not trusted either goes.
void WriteRefusal(const AlignCommandOptions& a, const std::string& refusal,
                  const ScanReading& reading, const Command::Context& context);
// The aligned model and what belongs to it: overlays, similarity, `geo`. Without local_from_sparse
// there was no sparse model. Model and scans are moved back to where the files have them.
void WriteAligned(const AlignCommandOptions& a, SparseModel model, const RowMotions& row_motions,
                  const std::optional<Similarity>& local_from_sparse, ScanReading* reading,
                  const std::set<std::string>& told, const Command::Context& context);

}  // namespace roomtex
