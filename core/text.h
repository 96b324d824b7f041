#pragma once
// Numbers as text, and text as numbers: in messages, tables and files. The decimal point is a
// point, whatever the locale.

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace roomtex {

// `digits` behind the point: Number(2.5, 2) is "2.50".
std::string Number(double value, int digits);
// At most `digits` significant ones, no zeros at the end (C's %g): Significant(0.25, 3) is "0.25".
std::string Significant(double value, int digits);
// Reads back to the same number, to the last bit: Significant() with 17 digits.
std::string Exact(double value);
// In whole per cent: Percent(0.254) is "25 %".
std::string Percent(double share);
// A length for people: "9.6 mm", "131 mm", "1.25 m"; "unknown" if it is not finite.
std::string Millimetres(double mm);

// A finite number in C notation ("-1.5e3", also "+2"); none if anything else stands there, be it a
// blank.
std::optional<double> ParseNumber(std::string_view text);

// Without blanks and control characters for spacing at both ends.
std::string Trimmed(const std::string& text);
std::string_view TrimmedView(std::string_view text);  // the same, of the same characters
std::string LowerCase(std::string text);              // ASCII
bool BeginsWith(std::string_view text, std::string_view start);
// Text of a file as it may stand in a message: in double quotes, at most 40 bytes of it, `?` for
// control characters and for bytes that are not UTF-8.
std::string Quoted(const std::string& text);

// A path as it may stand in a link: "my%20room/report.html" (RFC 3986).
std::string UrlPath(const std::string& path);

// Number of letters to insert, delete or change (Levenshtein).
size_t EditDistance(const std::string& a, const std::string& b);
// The one that it takes the fewest changes of letters to make `name` of, whatever the case; "" of
// none. What a mistyped name may have meant.
std::string NearestName(const std::vector<std::string>& names, const std::string& name);

// RFC 4648, with padding.
std::string Base64(const void* bytes, size_t count);

}  // namespace roomtex
