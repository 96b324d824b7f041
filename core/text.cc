#include "core/text.h"

#include <charconv>
#include <cmath>
#include <limits>

#include <fmt/core.h>

namespace roomtex {

std::string Number(double value, int digits) { return fmt::format("{:.{}f}", value, digits); }

std::string Significant(double value, int digits) { return fmt::format("{:.{}g}", value, digits); }

std::string Exact(double value) {
  return Significant(value, std::numeric_limits<double>::max_digits10);
}

std::string Percent(double share) { return Number(100 * share, 0) + " %"; }

std::optional<double> ParseNumber(std::string_view text) {
  const char* begin = text.data();
  const char* const end = begin + text.size();
  if (begin != end && *begin == '+') ++begin;  // from_chars knows no plus
  double value = 0;
  const auto [stop, error] = std::from_chars(begin, end, value);
  if (begin == end || error != std::errc() || stop != end || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

std::string Trimmed(const std::string& text) {
  const char* const blanks = " \t\r\n\v\f";
  const size_t begin = text.find_first_not_of(blanks);
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find_last_not_of(blanks) - begin + 1);
}

std::string Quoted(const std::string& text) {
  std::string shown;
  for (const char c : text.substr(0, 40)) {
    shown += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  }
  return "\"" + shown + (text.size() > 40 ? "..." : "") + "\"";
}

}  // namespace roomtex
