#pragma once
// How the place of the photos in the scan was found, where roomtex-align searched for it: what
// speaks for the best place, and against the others.

#include <string>

#include "core/report.h"

namespace roomtex {

// Of the report of roomtex-align: an entry for each sparse model whose place was searched for, with
// what its search found, best first, and what that means in sentences. Empty without a search.
Json SearchEvidence(const Json& align);

// The same as a part of the page.
std::string SearchHtml(const Json& searches);

}  // namespace roomtex
