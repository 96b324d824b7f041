#pragma once
// The agreement between photos and scan as it stands in alignment.json (docs/commands.md).

#include "align/trust/agreement.h"
#include "core/report.h"

namespace roomtex {

// The report's `agreement`.
Json AgreementToJson(const Agreement& agreement, const AgreementOptions& options);

}  // namespace roomtex
