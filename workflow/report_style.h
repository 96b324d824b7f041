#pragma once

namespace roomtex {

// The style sheet of report.html and site.html: light and dark by the reader's choice, paper, small
// screens.
extern const char kReportStyle[];

}  // namespace roomtex
