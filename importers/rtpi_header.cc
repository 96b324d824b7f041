#include "importers/rtpi_header.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

#include "core/error.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr char kMagic[] = "RTPI_version_";
constexpr char kMagic2[] = "RTPIv2";
constexpr int64_t kLongestRtpiHeader = 1 << 20;  // bytes; the manual's has below one thousand

// The line without its "#" and the blanks around.
std::string_view Content(std::string_view line) {
  line = TrimmedView(line);
  if (BeginsWith(line, "#")) line = TrimmedView(line.substr(1));
  return line;
}

// "key: value" or "key value".
void SplitItem(std::string_view content, std::string_view* key, std::string_view* value) {
  const size_t end = content.find_first_of(": \t");
  *key = content.substr(0, end);
  *value = end == std::string_view::npos ? std::string_view() : TrimmedView(content.substr(end));
  if (BeginsWith(*value, ":")) *value = TrimmedView(value->substr(1));
}

// En dash (UTF-8 and Windows-1252) and the typographic minus as '-'.
std::string WithPlainMinus(std::string_view text) {
  std::string plain;
  for (size_t i = 0; i < text.size(); ++i) {
    if (BeginsWith(text.substr(i), "\xE2\x80\x93") || BeginsWith(text.substr(i), "\xE2\x88\x92")) {
      plain += '-';
      i += 2;
    } else {
      plain += text[i] == '\x96' ? '-' : text[i];
    }
  }
  return plain;
}

// The finite numbers at the beginning of the text, at most `count`. Commas stand between them, or
// are decimal ones.
std::vector<double> Numbers(std::string_view text, size_t count) {
  std::string plain = WithPlainMinus(text);
  if (HasDecimalCommas(count == 1 ? plain + " 0" : plain)) {
    std::replace(plain.begin(), plain.end(), ',', '.');
  }
  std::vector<double> numbers;
  const char* at = plain.data();
  const char* const end = at + plain.size();
  while (numbers.size() < count) {
    while (at < end && (*at == ' ' || *at == '\t' || *at == ',')) ++at;
    if (at < end && *at == '+') ++at;
    double number = 0;
    const auto [next, error] = std::from_chars(at, end, number);
    if (error != std::errc() || !std::isfinite(number)) break;
    numbers.push_back(number);
    at = next;
  }
  return numbers;
}

bool ParsePositive(std::string_view value, std::optional<double>* target) {
  const std::vector<double> numbers = Numbers(value, 1);
  if (numbers.empty() || !(numbers[0] > 0)) return false;
  *target = numbers[0];
  return true;
}

bool ParsePair(std::string_view value, std::optional<std::array<double, 2>>* target) {
  const std::vector<double> numbers = Numbers(value, 2);
  if (numbers.size() < 2) return false;
  *target = {numbers[0], numbers[1]};
  return true;
}

int64_t ParseCount(const std::string& path, long line_number, std::string_view key,
                   std::string_view value) {
  int64_t count = -1;
  const char* const end = value.data() + value.size();
  const auto [next, error] = std::from_chars(value.data(), end, count);
  if (error != std::errc() || count < 0 || (next != end && *next != ' ' && *next != '\t')) {
    throw InputError(path, LinePosition(line_number),
                     std::string(key) + " is " + Quoted(value) + ", expected a whole number from 0",
                     "The file is damaged or not RTPI");
  }
  return count;
}

class HeaderParser {
 public:
  explicit HeaderParser(const FileReader& file) : path_(file.path()), lines_(file) {}

  RtpiLayout Parse() {
    std::string_view line;
    if (!NextLine(&line)) throw NotRtpi();
    while (BeginsWith(TrimmedView(line), "#")) {
      layout_.header.comments.emplace_back(line);  // version 2 begins with free lines
      if (!NextLine(&line)) throw NotRtpi();
    }
    if (BeginsWith(line, "P9 ")) {
      throw InputError(path_, LinePosition(lines_.line_number()), "is RTPI version 1 (\"P9\")",
                       "Version 1 is not supported: convert the file to version 3.0 with the "
                       "scanner's software");
    }
    if (BeginsWith(line, kMagic2)) {
      ParseVersion2(line);
    } else if (BeginsWith(line, kMagic)) {
      ParseVersion3(line);
    } else {
      throw NotRtpi();
    }
    layout_.body_offset = lines_.offset();
    return std::move(layout_);
  }

 private:
  InputError NotRtpi() const {
    return InputError(path_, LinePosition(1),
                      "does not begin with \"RTPI_version_3.0\" or \"RTPIv2\"",
                      "Give an RTPI file");
  }
  InputError NoEnd() const {
    return InputError(path_, BytePosition(lines_.offset()),
                      "the header does not end: no line \"# --end_header--\" up to here",
                      "The file is cut off or damaged: copy it again");
  }

  bool NextLine(std::string_view* line) {
    return lines_.offset() < kLongestRtpiHeader && lines_.Next(line);
  }

  void ParseVersion2(std::string_view line) {
    layout_.header.version = 2;
    const std::string_view rest = TrimmedView(line.substr(std::string_view(kMagic2).size()));
    const size_t end = std::min(rest.find_first_of(" \t"), rest.size());
    const long number = lines_.line_number();
    layout_.num_columns_line = number;
    layout_.num_columns = ParseCount(path_, number, "the number of columns", rest.substr(0, end));
    layout_.header.max_samples_per_column =
        ParseCount(path_, number, "the largest number of samples", TrimmedView(rest.substr(end)));
  }

  void ParseVersion3(std::string_view magic) {
    if (!BeginsWith(magic.substr(std::string_view(kMagic).size()), "3")) {
      throw InputError(path_, LinePosition(lines_.line_number()),
                       "is " + Quoted(magic) + ", expected \"RTPI_version_3.0\"",
                       "Only the versions 2 and 3.0 are supported");
    }
    bool has_num_columns = false, in_parameters = false, in_comments = false;
    std::string line;
    for (bool have_line = Take(&line);; have_line = Take(&line)) {
      if (!have_line) throw NoEnd();
      const std::string_view content = Content(line);
      if (BeginsWith(content, "--end_header--")) break;
      if (in_comments) {
        layout_.header.comments.push_back(line);
      } else if (BeginsWith(content, "--begin_comments--")) {
        in_comments = true;
      } else if (BeginsWith(content, "--begin_scan_parameters--")) {
        in_parameters = true;
      } else if (!BeginsWith(content, "--begin_header--")) {
        if (!ParseItem(line, &has_num_columns)) {
          (in_parameters ? layout_.header.parameters : layout_.header.device).push_back(line);
        }
      }
    }
    if (!has_num_columns) {
      throw InputError(path_, BytePosition(lines_.offset()),
                       "the header ends without the line \"# num_columns: N\"",
                       "The file is damaged");
    }
  }

  // The next line, or the one put back.
  bool Take(std::string* line) {
    if (put_back_) {
      *line = std::move(*put_back_);
      put_back_.reset();
      return true;
    }
    std::string_view view;
    if (!NextLine(&view)) return false;
    *line = std::string(view);
    return true;
  }

  // Takes the line if it is one of the items that have a field of their own.
  bool ParseItem(const std::string& line, bool* has_num_columns) {
    std::string_view key, value;
    SplitItem(Content(line), &key, &value);
    RtpiHeader& header = layout_.header;
    const bool known = key == "num_columns" || key == "max_samples_per_column" ||
                       key == "has_color" || key == "units" || key == "az_fov" || key == "el_fov" ||
                       key == "curr_samples_per_degree_az" || key == "curr_samples_per_degree_el" ||
                       key == "max_range";
    if (!known) return false;
    const long number = lines_.line_number();
    std::string next;
    if (value.empty() && Take(&next)) {  // the manual's print has values on the next line
      const std::string_view content = Content(next);
      if (content.find("--") == std::string_view::npos &&
          content.find(':') == std::string_view::npos) {
        value = content;
      } else {
        put_back_ = next;
      }
    }
    if (key == "num_columns") {
      layout_.num_columns = ParseCount(path_, number, key, value);
      layout_.num_columns_line = number;
      *has_num_columns = true;
      return true;
    }
    if (key == "max_samples_per_column") {
      layout_.header.max_samples_per_column = ParseCount(path_, number, key, value);
      return true;
    }
    if (key == "has_color") {
      if (value != "yes" && value != "no") {
        throw InputError(path_, LinePosition(number),
                         "has_color is " + Quoted(value) + ", expected yes or no",
                         "The file is damaged or not RTPI");
      }
      header.has_color = value == "yes";
      return true;
    }
    if (key == "units") {
      header.units = std::string(value);
      return true;
    }
    if (key == "az_fov") return ParsePair(value, &header.az_fov);
    if (key == "el_fov") return ParsePair(value, &header.el_fov);
    if (key == "curr_samples_per_degree_az") {
      return ParsePositive(value, &header.samples_per_degree_az);
    }
    if (key == "curr_samples_per_degree_el") {
      return ParsePositive(value, &header.samples_per_degree_el);
    }
    return ParsePositive(value, &header.max_range);
  }

  std::string path_;
  LineReader lines_;
  RtpiLayout layout_;
  std::optional<std::string> put_back_;
};

// Shortest text that reads back as the same number.
std::string NumberText(double number) {
  char text[64];
  return std::string(text, std::to_chars(text, text + sizeof(text), number).ptr);
}

}  // namespace

bool LooksLikeRtpi(const std::string& first_bytes) {
  std::string_view rest = first_bytes;
  while (BeginsWith(rest, "#")) {
    const size_t newline = rest.find('\n');
    if (newline == std::string_view::npos) return false;
    rest = rest.substr(newline + 1);
  }
  return BeginsWith(rest, kMagic) || BeginsWith(rest, kMagic2) || BeginsWith(rest, "P9 ");
}

RtpiLayout ReadRtpiHeader(const FileReader& file) { return HeaderParser(file).Parse(); }

std::string AzimuthOfFile(const RtpiHeader& header) {
  const auto says = [](const std::vector<std::string>& lines, const std::string& line) {
    return std::find(lines.begin(), lines.end(), line) != lines.end();
  };
  if (!says(header.device, kModelRoomtex)) return "";
  for (const char* azimuth : {"clockwise", "counterclockwise"}) {
    if (says(header.comments, AzimuthComment(azimuth))) return azimuth;
  }
  return "";
}

std::string AzimuthOfScanner(const RtpiHeader& header) {
  const auto has = [&](const std::string& start) {
    return std::any_of(header.device.begin(), header.device.end(), [&](const std::string& line) {
      if (line.size() <= start.size()) return false;
      return BeginsWith(LowerCase(line), LowerCase(start)) &&
             line.find_first_not_of(" \t", start.size()) != std::string::npos;
    });
  };
  const bool is_scanners = has("# model: deltaSphere") && has("# serial_number:") &&
                           has("# laser:") && has("# scan_start_time:");
  return is_scanners ? "counterclockwise" : "";
}

std::string AzimuthComment(const std::string& azimuth) { return "# azimuth: " + azimuth; }

std::string OtherAzimuth(const std::string& azimuth) {
  return azimuth == "clockwise" ? "counterclockwise" : "clockwise";
}

std::string RtpiHeaderText(const RtpiHeader& header, int64_t num_columns) {
  const int64_t max_samples_per_column = header.max_samples_per_column.value_or(0);
  std::string text;
  const auto add_lines = [&text](const std::vector<std::string>& lines) {
    for (const std::string& line : lines) text += line + "\n";
  };
  if (header.version == 2) {
    add_lines(header.comments);
    return text + kMagic2 + " " + std::to_string(num_columns) + " " +
           std::to_string(max_samples_per_column) + "\n";
  }
  const auto add = [&text](const std::string& key, const std::string& value) {
    text += "# " + key + ": " + value + "\n";
  };
  const auto add_number = [&](const std::string& key, const std::optional<double>& value) {
    if (value) add(key, NumberText(*value));
  };
  const auto add_pair = [&](const std::string& key,
                            const std::optional<std::array<double, 2>>& value) {
    if (value) add(key, NumberText((*value)[0]) + " " + NumberText((*value)[1]));
  };
  text = std::string(kMagic) + "3.0\n# --begin_header--\n";
  add_lines(header.device);
  text += "# --begin_scan_parameters--\n";
  add("num_columns", std::to_string(num_columns));
  add("max_samples_per_column", std::to_string(max_samples_per_column));
  add("has_color", header.has_color ? "yes" : "no");
  if (!header.units.empty()) add("units", header.units);
  add_pair("az_fov", header.az_fov);
  add_pair("el_fov", header.el_fov);
  add_number("curr_samples_per_degree_az", header.samples_per_degree_az);
  add_number("curr_samples_per_degree_el", header.samples_per_degree_el);
  add_number("max_range", header.max_range);
  add_lines(header.parameters);
  text += "# --begin_comments--\n";
  add_lines(header.comments);
  return text + "# --end_header--\n";
}

}  // namespace roomtex
