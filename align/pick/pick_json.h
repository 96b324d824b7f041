#pragma once
// The page's JSON (align/pick/README.md) from and to our types.

#include <string>
#include <vector>

#include "align/pick/pick_session.h"
#include "core/report.h"

namespace roomtex {

// `picks` and `revision` of a PUT. Throws UsageError with a sentence for whatever is not as the
// page may send it, and for a place of a scan that cannot be picked.
struct PutPicks {
  int revision = 0;
  std::vector<SessionPick> picks;
};
PutPicks ParsePutPicks(const Json& json, const PickScene& scene);

Json SessionToJson(const PickSession::Snapshot& snapshot, const PickScene& scene);
Json ScanPointToJson(const ScanPlaces::Found& found);

}  // namespace roomtex
