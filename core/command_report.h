#pragma once
// Where the report of a command may go, and how it gets there together with the results. For
// command_line.cc.

#include <string>
#include <vector>

#include "core/report.h"

namespace roomtex {

// Throws UsageError for a --report_path ("" = none) in whose place stands what is no report: a slip
// of the finger must not put one in the place of somebody's work.
void RequireReplaceableReport(const std::string& report_path);

bool IsReportOf(const std::string& command, const std::string& path);

// Whether a file may become the report of a command that could not read its options, and so does
// not know what is an input: none, or an earlier report of this command that lies in no folder
// which the arguments name. There it belongs to results, which a slip does not change.
bool MayReportEarly(const std::string& command, const std::string& path,
                    const std::vector<std::string>& arguments);

// Puts the sets and copies of a command in their places, if it ran to its end, and its report, also
// to report_path ("" = nowhere). Throws UsageError if that is a result.
void WriteReports(bool ran_to_end, const Json& json, const Report& report,
                  const std::string& report_path);

}  // namespace roomtex
