#include "core/text.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>

#include <fmt/core.h>

#include "core/utf8.h"

namespace roomtex {

std::string Number(double value, int digits) { return fmt::format("{:.{}f}", value, digits); }

std::string Significant(double value, int digits) { return fmt::format("{:.{}g}", value, digits); }

std::string Exact(double value) {
  return Significant(value, std::numeric_limits<double>::max_digits10);
}

std::string Percent(double share) { return Number(100 * share, 0) + " %"; }

std::string Millimetres(double mm) {
  if (!std::isfinite(mm)) return "unknown";
  if (mm >= 1000) return Number(mm / 1000, 2) + " m";
  return Number(mm, mm < 10 ? 1 : 0) + " mm";
}

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

std::string Trimmed(const std::string& text) { return std::string(TrimmedView(text)); }

std::string_view TrimmedView(std::string_view text) {
  const char* const blanks = " \t\r\n\v\f";
  const size_t begin = text.find_first_not_of(blanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(blanks) - begin + 1);
}

std::string LowerCase(std::string text) {
  for (char& c : text) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return text;
}

bool BeginsWith(std::string_view text, std::string_view start) {
  return text.substr(0, start.size()) == start;
}

std::string Quoted(const std::string& text) {
  constexpr size_t kMaxBytes = 40;
  std::string shown;
  size_t i = 0;
  while (i < text.size()) {
    const size_t count = Utf8Bytes(text, i);
    if (i + std::max<size_t>(count, 1) > kMaxBytes) break;
    const bool is_control = static_cast<unsigned char>(text[i]) < 0x20 || text[i] == 0x7f;
    shown += count == 0 || is_control ? "?" : text.substr(i, count);
    i += std::max<size_t>(count, 1);
  }
  return "\"" + shown + (i < text.size() ? "..." : "") + "\"";
}

std::string UrlPath(const std::string& path) {
  static const char* const kDigits = "0123456789ABCDEF";
  std::string url;
  for (const char c : path) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) != 0 || c == '/' || c == '.' || c == '-' || c == '_') {
      url += c;
    } else {
      url += std::string("%") + kDigits[byte >> 4] + kDigits[byte & 15];
    }
  }
  return url;
}

std::string Base64(const void* bytes, size_t count) {
  static const char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const auto* from = static_cast<const unsigned char*>(bytes);
  std::string text;
  text.reserve((count + 2) / 3 * 4);
  for (size_t i = 0; i < count; i += 3) {
    uint32_t block = 0;
    for (size_t k = 0; k < 3; ++k) block = block << 8 | (i + k < count ? from[i + k] : 0u);
    for (size_t k = 0; k < 4; ++k) {
      text += i + k <= count ? kDigits[block >> (18 - 6 * k) & 63] : '=';
    }
  }
  return text;
}

size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 0; i < a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i + 1;
    for (size_t j = 0; j < b.size(); ++j) {
      const size_t changed = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({changed, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

std::string NearestName(const std::vector<std::string>& names, const std::string& name) {
  constexpr size_t kMostLetters = 256;  // compared: the effort grows with their square
  const auto as_compared = [](const std::string& text) {
    return LowerCase(text.substr(0, kMostLetters));
  };
  std::string nearest;
  size_t nearest_distance = std::numeric_limits<size_t>::max();
  for (const std::string& one : names) {
    const size_t distance = EditDistance(as_compared(one), as_compared(name));
    if (distance >= nearest_distance) continue;
    nearest = one;
    nearest_distance = distance;
  }
  return nearest;
}

}  // namespace roomtex
