#pragma once
// What roomtex-auto left in the folders of a site's rooms, put together: the keys of site.json.

#include <string>
#include <vector>

#include "core/report.h"

namespace roomtex {

struct SiteRoom {
  std::string name, notes;  // name: of its folder
};

// The columns room and, if there is one, notes of a table with a line of names. Throws InputError.
std::vector<SiteRoom> ReadSiteRooms(const std::string& path);
// The folders in which roomtex-auto has run, by name. Throws InputError if there are none.
std::vector<SiteRoom> FindSiteRooms(const std::string& folder);

// verdict {state, headline, sentences[]}, counts {rooms, trusted, untrusted, failed, unfinished},
// rooms[], steps[] {name, seconds, cpu_seconds, peak_memory_bytes, largest_room}, total {seconds,
// cpu_seconds, peak_memory_bytes}. Of a room: name, notes, state, headline, sentences[],
// remedies[], folder (below `folder`), has_report, num_photos, num_registered, coverage,
// surface_m2, unseen_m2, expected_error_mm, far_corner_mm, seconds, cpu_seconds,
// peak_memory_bytes, places_to_photograph[], plan (of report.json); what is not known is not there.
// joined: what roomtex-join reported in joined/joined.json {trusted, reason, reference, rooms[],
// links[], loops[], scene}; null = it did not run. An unreadable file counts as none.
Json MakeSiteKeys(const std::string& folder, const std::vector<SiteRoom>& rooms);

}  // namespace roomtex
