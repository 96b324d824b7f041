#include "align/clicks/picks.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <map>
#include <numeric>
#include <optional>

#include "core/error.h"
#include "core/output_file.h"

namespace roomtex {
namespace {

constexpr char kHeader[] = "image_name,x,y,scan_x,scan_y,scan_z";
constexpr int kNumFields = 6;  // and a seventh, the weight, where the header has it
constexpr char kWeight[] = "weight";
constexpr size_t kMaxLineLength = 64 * 1024;
const char* const kFieldNames[kNumFields] = {"image_name", "x", "y", "scan_x", "scan_y", "scan_z"};

std::string Trimmed(const std::string& text) {
  const char* const blanks = " \t\r\n\v\f";
  const size_t begin = text.find_first_not_of(blanks);
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find_last_not_of(blanks) - begin + 1);
}

std::string Lowercase(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

// Text of the file as it may be quoted in a message: one short line of printable characters.
std::string Quoted(const std::string& text) {
  std::string shown;
  for (const char c : text.substr(0, 40)) {
    shown += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  }
  return "\"" + shown + (text.size() > 40 ? "..." : "") + "\"";
}

// Fields of one CSV line, blanks around them removed; "" inside quotes is one quote (RFC 4180).
// None if a quote is not closed.
std::optional<std::vector<std::string>> SplitCsv(const std::string& line) {
  std::vector<std::string> fields;
  size_t at = 0;
  while (true) {
    while (at < line.size() && (line[at] == ' ' || line[at] == '\t')) ++at;
    std::string field;
    if (at < line.size() && line[at] == '"') {
      for (++at;; ++at) {
        if (at >= line.size()) return std::nullopt;
        if (line[at] == '"') {
          if (at + 1 >= line.size() || line[at + 1] != '"') break;
          ++at;
        }
        field += line[at];
      }
      const size_t comma = std::min(line.find(',', at), line.size());
      if (!Trimmed(line.substr(at + 1, comma - at - 1)).empty()) return std::nullopt;
      at = comma;
    } else {
      const size_t comma = std::min(line.find(',', at), line.size());
      field = Trimmed(line.substr(at, comma - at));
      at = comma;
    }
    fields.push_back(field);
    if (at >= line.size()) return fields;
    ++at;
  }
}

// A finite number in C notation, whatever the locale; none otherwise.
std::optional<double> ParseNumber(const std::string& text) {
  double value = 0;
  const char* begin = text.data();
  if (!text.empty() && *begin == '+') ++begin;
  const auto [end, error] = std::from_chars(begin, text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || begin == end) return std::nullopt;
  if (!std::isfinite(value)) return std::nullopt;
  return value;
}

// Number of fields that the header announces.
int ReadHeader(const std::string& path, long line_number, const std::string& line) {
  const std::string expected = std::string("Expected the header line ") + kHeader +
                               " (and, if wanted, a seventh field " + kWeight + ")";
  const auto fields = SplitCsv(line);
  const int num_fields = fields ? static_cast<int>(fields->size()) : 0;
  bool matches = num_fields == kNumFields || num_fields == kNumFields + 1;
  for (int i = 0; matches && i < num_fields; ++i) {
    matches = Lowercase((*fields)[i]) == (i < kNumFields ? kFieldNames[i] : kWeight);
  }
  if (matches) return num_fields;
  const bool looks_like_pick = num_fields >= kNumFields && ParseNumber((*fields)[1]);
  throw InputError(path, LinePosition(line_number),
                   looks_like_pick
                       ? "the header is missing: the first line is a pick already"
                       : "found " + Quoted(line) + " where the header of a picks file should be",
                   expected);
}

Pick ParsePick(const std::string& path, long line_number, const std::string& line, int num_fields) {
  const auto fields = SplitCsv(line);
  if (!fields) {
    throw InputError(path, LinePosition(line_number), "a quoted name is not closed by a quote",
                     "A quote inside a quoted name is written twice");
  }
  if (static_cast<int>(fields->size()) != num_fields) {
    throw InputError(path, LinePosition(line_number),
                     "found " + std::to_string(fields->size()) + " fields, expected " +
                         std::to_string(num_fields) + " (" + kHeader +
                         (num_fields > kNumFields ? std::string(",") + kWeight : "") + ")",
                     "Separate fields by commas, write decimals with a point, and put a name that "
                     "holds a comma in double quotes");
  }
  if ((*fields)[0].empty()) {
    throw InputError(path, LinePosition(line_number), "the image name is empty",
                     "Name the photo as in the sparse model");
  }
  double values[kNumFields] = {0, 0, 0, 0, 0, 1};
  for (int i = 1; i < num_fields; ++i) {
    const auto value = ParseNumber((*fields)[i]);
    if (!value) {
      throw InputError(path, LinePosition(line_number),
                       std::string(i < kNumFields ? kFieldNames[i] : kWeight) + " is " +
                           Quoted((*fields)[i]) + ", which is not a finite number",
                       "Correct the line or remove it");
    }
    values[i - 1] = *value;
  }
  if (!(values[5] >= 0 && values[5] <= kMaxPickWeight)) {
    throw InputError(
        path, LinePosition(line_number),
        std::string(kWeight) + " is " + Quoted((*fields)[kNumFields]),
        "A weight is 1 for an ordinary pick, more for a more exact one (up to 1000), 0 "
        "for one that is switched off");
  }
  return {(*fields)[0],
          {values[0], values[1]},
          {values[2], values[3], values[4]},
          line_number,
          values[5]};
}

void RefuseDuplicates(const std::string& path, const std::vector<Pick>& picks) {
  using PixelKey = std::tuple<std::string, double, double>;
  using ScanKey = std::tuple<std::string, double, double, double>;
  std::map<PixelKey, long> pixels;
  std::map<ScanKey, long> scan_points;
  for (const Pick& pick : picks) {
    const auto [pixel, new_pixel] =
        pixels.insert({{pick.image_name, pick.x_in_img.x(), pick.x_in_img.y()}, pick.line});
    const auto [scan_point, new_scan_point] = scan_points.insert(
        {{pick.image_name, pick.x_in_scan.x(), pick.x_in_scan.y(), pick.x_in_scan.z()}, pick.line});
    if (new_pixel && new_scan_point) continue;
    const std::string what = !new_pixel && !new_scan_point ? "the same pick"
                             : !new_pixel                  ? "the same pixel"
                                                           : "the same scan point";
    const long earlier = new_pixel ? scan_point->second : pixel->second;
    throw InputError(
        path, LinePosition(pick.line),
        what + " of " + pick.image_name + " stands on line " + std::to_string(earlier) + " already",
        "Remove one of the two lines");
  }
}

int EditDistance(const std::string& a, const std::string& b) {
  std::vector<int> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (size_t i = 1; i <= a.size(); ++i) {
    int diagonal = row[0];
    row[0] = static_cast<int>(i);
    for (size_t j = 1; j <= b.size(); ++j) {
      const int substituted = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substituted});
    }
  }
  return row.back();
}

std::string NearestName(const SparseModel& model, const std::string& name) {
  std::string nearest;
  int nearest_distance = -1;
  for (const auto& [id, image] : model.images) {
    const int distance =
        EditDistance(Lowercase(image.name.substr(0, 256)), Lowercase(name.substr(0, 256)));
    if (nearest_distance < 0 || distance < nearest_distance) {
      nearest = image.name;
      nearest_distance = distance;
    }
  }
  return nearest;
}

}  // namespace

std::vector<Pick> ReadPicks(const std::string& path) {
  RequireFile(path, "Check --picks_path");
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw InputError(path, "", "cannot be opened", "Check that you may read it");
  std::vector<Pick> picks;
  std::string line;
  int num_fields = 0;  // 0 = the header is still to come
  for (long line_number = 1; std::getline(stream, line); ++line_number) {
    if (line_number == 1 && line.rfind("\xef\xbb\xbf", 0) == 0) line.erase(0, 3);
    if (line.size() > kMaxLineLength || line.find('\0') != std::string::npos) {
      throw InputError(path, LinePosition(line_number), "is not a line of a text file",
                       std::string("Expected a CSV file with the header ") + kHeader);
    }
    line = Trimmed(line);
    if (line.empty() || line[0] == '#') continue;
    if (num_fields == 0) {
      num_fields = ReadHeader(path, line_number, line);
      continue;
    }
    picks.push_back(ParsePick(path, line_number, line, num_fields));
  }
  if (stream.bad()) throw InputError(path, "", "could not be read to its end", "Check the disk");
  if (num_fields == 0) {
    throw InputError(path, "", "holds no picks",
                     std::string("Expected the header line ") + kHeader);
  }
  RefuseDuplicates(path, picks);
  return picks;
}

void WritePicks(const std::string& path, const std::vector<Pick>& picks) {
  OutputFile file(path);
  std::ostream& out = file.stream();
  const bool weighted =
      std::any_of(picks.begin(), picks.end(), [](const Pick& pick) { return pick.weight != 1; });
  out << kHeader << (weighted ? std::string(",") + kWeight : "") << '\n' << std::setprecision(17);
  for (const Pick& pick : picks) {
    std::string name = pick.image_name;
    if (name.find_first_of(",\"#") != std::string::npos || name != Trimmed(name)) {
      for (size_t at = 0; (at = name.find('"', at)) != std::string::npos; at += 2) {
        name.insert(at, "\"");
      }
      name = "\"" + name + "\"";
    }
    out << name << ',' << pick.x_in_img.x() << ',' << pick.x_in_img.y() << ',' << pick.x_in_scan.x()
        << ',' << pick.x_in_scan.y() << ',' << pick.x_in_scan.z();
    if (weighted) out << ',' << pick.weight;
    out << '\n';
  }
  file.Commit();
}

void CheckPickNames(const std::string& path, const std::vector<Pick>& picks,
                    const SparseModel& model) {
  for (const Pick& pick : picks) {
    const SparseImage* image = model.FindImage(pick.image_name);
    if (image == nullptr) {
      throw InputError(path, LinePosition(pick.line),
                       "the photo " + pick.image_name +
                           " is not in the sparse model (nearest name: " +
                           NearestName(model, pick.image_name) + ")",
                       "Correct the name, or pick in a photo that COLMAP has registered");
    }
    const Camera& camera = model.cameras.at(image->camera_id);
    const Eigen::Vector2d& x = pick.x_in_img;
    if (!(x.x() >= 0 && x.y() >= 0 && x.x() <= camera.width && x.y() <= camera.height)) {
      std::ostringstream where;
      where << "the pixel (" << x.x() << ", " << x.y() << ") lies outside " << pick.image_name
            << ", which has " << camera.width << " x " << camera.height << " pixels";
      throw InputError(path, LinePosition(pick.line), where.str(),
                       "Give x and y in pixels of the photo as taken");
    }
  }
}

void CheckPicksAgainstModel(const std::string& path, const std::vector<Pick>& picks,
                            const SparseModel& model) {
  CheckPickNames(path, picks, model);
  std::map<std::string, int> count;
  for (const Pick& pick : picks) count[pick.image_name] += pick.weight > 0;
  int most = 0;
  for (const auto& [name, number] : count) most = std::max(most, number);
  if (most >= kMinPicksPerPhoto) return;
  throw InputError(path, "",
                   "holds " + std::to_string(picks.size()) + " picks, at most " +
                       std::to_string(most) + " in one photo; at least " +
                       std::to_string(kMinPicksPerPhoto) + " in one photo are needed",
                   "Add picks, well spread over the photo and in depth");
}

}  // namespace roomtex
