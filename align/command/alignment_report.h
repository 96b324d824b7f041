#pragma once
// alignment.json: the keys of docs/commands.md that come from an alignment alone.

#include <cstdint>
#include <map>
#include <vector>

#include "align/alignment.h"
#include "align/photo_alignment.h"
#include "align/trust/photo_verdict.h"
#include "align/trust/station_check.h"
#include "core/report.h"

namespace roomtex {

// All but `planes`, `cameras`, `images` and what photos and stations say. reprojection_rms_after in
// pixels, of the model as it is written.
void FillReport(const Alignment& alignment, double reprojection_rms_after, Report* report);
// The report's `images`: one standard deviation of each photo of an adjusted model, null for one
// that took no part.
Json PhotosToJson(const Alignment& alignment, const SparseModel& aligned);
// Adds to them what each photo by itself is worth, and why it is doubted.
void AddVerdicts(const std::map<uint32_t, PhotoVerdict>& photos, const SparseModel& aligned,
                 Json* images);
// The report's `stations`, a record for each pair that overlaps.
Json StationsToJson(const StationCheck& check, const std::vector<Scan>& scans);

// Of photos without a sparse model: adds to the records of PhotosToJson() what was found of their
// cameras.
void AddLenses(const PhotoAlignment& found, Json* images);
// Takes away what an alignment without a sparse model does not have.
void NullWithoutModel(Report* report);

}  // namespace roomtex
