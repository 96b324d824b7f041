// Of PCL only the LZF decompression is used, not pcl::PCDReader (measured with 1.13): it goes on
// looking for header lines in the bytes behind "DATA binary". A whole file whose first data bytes
// spell COLUMNS is "read" with a wrong layout, and other such bytes end the program; no check of
// the header in front of it can help (tests/importers/pcd_test.cc,
// DataThatSpellHeaderLinesAreData).

#include "importers/pcd.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>
#include <vector>

#include <pcl/io/lzf.h>

#include "core/error.h"
#include "core/frames.h"
#include "core/output_file.h"
#include "core/resource_limits.h"
#include "core/text.h"
#include "importers/file_reader.h"
#include "importers/mesh_scan.h"
#include "importers/up_axis.h"

namespace roomtex {
namespace {

constexpr int64_t kLongestPcdHeader = 1 << 16;  // bytes
constexpr int64_t kLargestPoint = 1 << 16;      // bytes of one point, all fields

struct PcdField {
  std::string name;
  int size = 4;     // bytes
  char type = 'F';  // F, I or U
  int64_t count = 1;
  int64_t offset = 0;  // bytes in a point, or columns in a line of an ascii file
};

struct PcdHeader {
  std::vector<PcdField> fields;
  int64_t width = 0, height = 1, points = -1;
  Rigid viewpoint;
  std::string data;  // "ascii", "binary" or "binary_compressed"
  int64_t data_offset = 0, point_size = 0, values_per_point = 0;
  long size_line = 0, data_line = 0;

  const PcdField* Find(const std::string& name) const {
    for (const PcdField& field : fields) {
      if (field.name == name) return &field;
    }
    return nullptr;
  }
};

bool ParseWhole(const std::string& word, int64_t low, int64_t high, int64_t* number) {
  const char* const end = word.data() + word.size();
  const auto [next, error] = std::from_chars(word.data(), end, *number);
  return error == std::errc() && next == end && *number >= low && *number <= high;
}

class PcdHeaderParser {
 public:
  PcdHeaderParser(const FileReader& file, bool allow_clouds)
      : file_(file), lines_(file), allow_clouds_(allow_clouds) {}

  PcdHeader Parse() {
    std::string_view line;
    while (header_.data.empty()) {
      if (lines_.offset() > kLongestPcdHeader || !lines_.Next(&line)) {
        throw InputError(file_.path(), BytePosition(lines_.offset()),
                         "the header does not end: no DATA line up to here", kDamaged);
      }
      const std::vector<std::string> words = WordsOf(line);
      if (words.empty() || words[0][0] == '#') continue;
      if (!ParseEntry(words)) {
        throw Error("is " + Quoted(line) + ", which is no line of a PCD header",
                    RemedyForLine(line));
      }
    }
    header_.data_offset = lines_.offset();
    CheckWhole();
    return std::move(header_);
  }

 private:
  InputError Error(const std::string& finding, const std::string& remedy = kDamaged) const {
    return InputError(file_.path(), LinePosition(lines_.line_number()), finding, remedy);
  }

  bool ParseEntry(const std::vector<std::string>& words) {
    const std::string& key = words[0];
    const size_t count = words.size() - 1;
    if (key == "VERSION") return count == 1;
    if (key == "FIELDS" || key == "COLUMNS") {
      for (size_t i = 1; i <= count; ++i) header_.fields.push_back({words[i]});
      return count > 0 && header_.fields.size() == count;
    }
    if (key == "SIZE" || key == "TYPE" || key == "COUNT") return ParsePerField(words);
    if (key == "WIDTH") return count == 1 && ParseWhole(words[1], 0, 1LL << 40, &header_.width);
    if (key == "HEIGHT") {
      header_.size_line = lines_.line_number();
      return count == 1 && ParseWhole(words[1], 0, 1LL << 40, &header_.height);
    }
    if (key == "POINTS") return count == 1 && ParseWhole(words[1], 0, 1LL << 60, &header_.points);
    if (key == "VIEWPOINT") return ParseViewpoint(words);
    if (key != "DATA" || count != 1) return false;
    header_.data = words[1];
    header_.data_line = lines_.line_number();
    return words[1] == "ascii" || words[1] == "binary" || words[1] == "binary_compressed";
  }

  bool ParsePerField(const std::vector<std::string>& words) {
    if (words.size() - 1 != header_.fields.size()) return false;
    for (size_t i = 0; i < header_.fields.size(); ++i) {
      PcdField& field = header_.fields[i];
      const std::string& word = words[i + 1];
      int64_t number = 0;
      if (words[0] == "TYPE") {
        if (word != "F" && word != "I" && word != "U") return false;
        field.type = word[0];
      } else if (words[0] == "SIZE") {
        if (!ParseWhole(word, 1, 8, &number) || (number & (number - 1)) != 0) return false;
        field.size = static_cast<int>(number);
      } else if (!ParseWhole(word, 1, kLargestPoint, &field.count)) {
        return false;
      }
    }
    return true;
  }

  bool ParseViewpoint(const std::vector<std::string>& words) {
    double v[7];
    if (words.size() != 8) return false;
    for (int i = 0; i < 7; ++i) {
      if (!ParseReal(words[i + 1], &v[i]) || !std::isfinite(v[i])) return false;
    }
    const Eigen::Quaterniond rotation = QuaternionFromWxyz({v[3], v[4], v[5], v[6]});
    if (!(rotation.norm() > 1e-6)) return false;
    header_.viewpoint = {rotation.normalized(), {v[0], v[1], v[2]}};
    return true;
  }

  void CheckWhole() {
    for (const char* name : {"x", "y", "z"}) {
      const PcdField* field = header_.Find(name);
      if (field == nullptr || field->type != 'F' || field->size < 4 || field->count != 1) {
        throw Error(std::string("the header ends without a float field ") + name);
      }
    }
    for (PcdField& field : header_.fields) {
      field.offset = header_.data == "ascii" ? header_.values_per_point : header_.point_size;
      header_.point_size += field.size * field.count;
      header_.values_per_point += field.count;
      if (header_.point_size > kLargestPoint || (field.type == 'F' && field.size < 4)) {
        throw Error("the field " + field.name + " has an impossible size");
      }
    }
    if (header_.height < 1 || (header_.height == 1 && !allow_clouds_)) {
      throw InputError(file_.path(), header_.size_line > 0 ? LinePosition(header_.size_line) : "",
                       "is a cloud without a grid (HEIGHT 1)",
                       "Export it organised (HEIGHT = number of rows), or as PTX");
    }
    const double cells = static_cast<double>(header_.width) * static_cast<double>(header_.height);
    if (header_.width < 1 || cells > std::numeric_limits<int>::max() ||
        (header_.points >= 0 && static_cast<double>(header_.points) != cells)) {
      throw Error("WIDTH " + std::to_string(header_.width) + " x HEIGHT " +
                  std::to_string(header_.height) + " and POINTS " + std::to_string(header_.points) +
                  " do not make a grid");
    }
    CheckDataSize(static_cast<int64_t>(cells));
  }

  // Nothing but zeros follows, as many as old versions of PCL put there: the rest of a page.
  bool IsPadding(int64_t offset) const {
    constexpr int64_t kLargestPage = 1 << 16;
    if (file_.size() - offset > kLargestPage) return false;
    const std::string rest = file_.ReadSome(offset, kLargestPage);
    return rest.find_first_not_of('\0') == std::string::npos;
  }

  void CheckDataSize(int64_t num_points) {
    const int64_t left = file_.size() - header_.data_offset;
    const int64_t data_size = num_points * header_.point_size;
    const auto fail = [&](const std::string& expected) {
      throw InputError(
          file_.path(), BytePosition(header_.data_offset),
          std::to_string(left) + " bytes of data follow the header, expected " + expected,
          left < data_size ? "The file is cut off: copy it again" : kDamaged);
    };
    if (header_.data == "ascii") {
      const int64_t shortest = 2 * header_.values_per_point * num_points - 1;
      if (left < shortest) fail("at least " + std::to_string(shortest));
    } else if (header_.data == "binary") {
      if (left < data_size || !IsPadding(header_.data_offset + data_size)) {
        fail(std::to_string(data_size));
      }
    } else {
      uint32_t sizes[2] = {0, 0};
      if (left < 8) fail("at least 8");
      file_.Read(header_.data_offset, sizes, 8);
      if (sizes[0] > left - 8 || !IsPadding(header_.data_offset + 8 + sizes[0])) {
        fail(std::to_string(8 + static_cast<int64_t>(sizes[0])));
      }
      // A reference of LZF, 3 bytes, stands for at most 264.
      if (sizes[1] != data_size || sizes[1] > 100 * static_cast<int64_t>(sizes[0])) {
        throw InputError(file_.path(), BytePosition(header_.data_offset + 4),
                         "says " + std::to_string(sizes[1]) + " bytes after decompression of " +
                             std::to_string(sizes[0]) + ", expected " + std::to_string(data_size),
                         kDamaged);
      }
    }
  }

  const FileReader& file_;
  LineReader lines_;
  bool allow_clouds_;
  PcdHeader header_;
};

double ValueAt(const uint8_t* bytes, char type, int size) {
  const auto as = [bytes](auto value) {
    std::memcpy(&value, bytes, sizeof(value));
    return static_cast<double>(value);
  };
  if (type == 'F') return size == 4 ? as(float{}) : as(double{});
  if (type == 'I') {
    return size == 1   ? as(int8_t{})
           : size == 2 ? as(int16_t{})
           : size == 4 ? as(int32_t{})
                       : as(int64_t{});
  }
  return size == 1   ? as(uint8_t{})
         : size == 2 ? as(uint16_t{})
         : size == 4 ? as(uint32_t{})
                     : as(uint64_t{});
}

// The field with the packed colour, null if there is none.
const PcdField* PcdColor(const PcdHeader& header) {
  for (const char* name : {"rgb", "rgba"}) {
    const PcdField* const field = header.Find(name);
    if (field != nullptr && field->size == 4 && field->count == 1) return field;
  }
  return nullptr;
}

const PcdField* PcdNormal(const PcdHeader& header, int axis) {
  return header.Find(std::string("normal_") + "xyz"[axis]);
}

class PcdFiller {
 public:
  PcdFiller(const PcdHeader& header, const PcdOptions& options, Scan* scan)
      : options_(options), scan_(scan), has_intensity_(header.Find("intensity") != nullptr) {
    scan->num_columns = static_cast<int>(header.width);
    scan->num_rows = static_cast<int>(header.height);
    scan->scan_from_station = header.viewpoint;
    scan->scan_from_station.translation *= options.meters_per_unit;
    scan->points.resize(static_cast<size_t>(header.width * header.height));
    scan->intensity.resize(scan->points.size());
    if (options.colors && PcdColor(header) != nullptr) {
      scan->colors.assign(scan->points.size(), {0, 0, 0});
    }
    if (header.height == 1 && PcdNormal(header, 0) != nullptr && PcdNormal(header, 1) != nullptr &&
        PcdNormal(header, 2) != nullptr) {
      scan->normals.assign(scan->points.size(), Eigen::Vector3f::Zero());
    }
  }

  bool wants_normals() const { return !scan_->normals.empty(); }
  void SetNormal(int cell, const Eigen::Vector3d& normal) {
    scan_->normals[static_cast<size_t>(cell)] = normal.cast<float>();
  }

  // rgb: packed, 0xrrggbb.
  void SetColor(int cell, uint32_t rgb) {
    const auto at = static_cast<size_t>(cell);
    if (scan_->IsMissing(cell)) return;
    const std::array<uint8_t, 3> color = {
        static_cast<uint8_t>(rgb >> 16), static_cast<uint8_t>(rgb >> 8), static_cast<uint8_t>(rgb)};
    if (!scan_->colors.empty()) scan_->colors[at] = color;
    if (!has_intensity_) {
      scan_->intensity[at] =
          static_cast<float>(GreyOf(Eigen::Vector3d(color[0], color[1], color[2])));
    }
  }

  void Set(int cell, const Eigen::Vector3d& x_in_file, double intensity) {
    const Eigen::Vector3d point = options_.meters_per_unit * x_in_file;
    const double range = (point - scan_->Station()).norm();
    const bool measured = std::isfinite(range) && range > 0 &&
                          (options_.max_range <= 0 || range <= options_.max_range);
    scan_->points[cell] = measured ? point : Scan::MissingPoint();
    scan_->intensity[cell] =
        measured && std::isfinite(intensity) ? static_cast<float>(intensity) : 0.0f;
  }

 private:
  PcdOptions options_;
  Scan* scan_;
  bool has_intensity_;
};

// In text the bits of the colour are those of a float, or it is the number itself.
uint32_t PackedColor(double value, char type) {
  uint32_t bits = 0;
  if (type == 'F') {
    const auto as_float = static_cast<float>(value);
    std::memcpy(&bits, &as_float, sizeof(bits));
  } else if (value >= -2147483648.0 && value <= 4294967295.0) {
    bits = static_cast<uint32_t>(static_cast<int64_t>(value));
  }
  return bits;
}

void ReadAscii(const FileReader& file, const PcdHeader& header, PcdFiller* filler) {
  LineReader lines(file, header.data_offset);
  std::string_view line;
  const auto error = [&](const std::string& finding) {
    return InputError(file.path(),
                      LinePosition(header.data_line + std::max(1L, lines.line_number())), finding,
                      RemedyForLine(line));
  };
  const PcdField* const intensity = header.Find("intensity");
  const int64_t offsets[3] = {header.Find("x")->offset, header.Find("y")->offset,
                              header.Find("z")->offset};
  const PcdField* const color = PcdColor(header);
  std::vector<double> values(static_cast<size_t>(header.values_per_point));
  for (int64_t cell = 0; cell < header.width * header.height;) {
    if (!lines.Next(&line)) {
      throw error("the file ends after " + std::to_string(cell) + " of " +
                  std::to_string(header.width * header.height) + " points");
    }
    const std::vector<std::string> words = WordsOf(line);
    if (words.empty()) continue;
    bool good = words.size() == values.size();
    for (size_t i = 0; good && i < words.size(); ++i) good = ParseReal(words[i], &values[i]);
    if (!good) {
      throw error("is " + Quoted(line) + ", expected " + std::to_string(values.size()) +
                  " numbers");
    }
    const int at = static_cast<int>(cell++);
    filler->Set(at, {values[offsets[0]], values[offsets[1]], values[offsets[2]]},
                intensity != nullptr ? values[intensity->offset] : 0);
    if (color != nullptr) filler->SetColor(at, PackedColor(values[color->offset], color->type));
    if (filler->wants_normals()) {
      Eigen::Vector3d normal;
      for (int k = 0; k < 3; ++k) normal[k] = values[PcdNormal(header, k)->offset];
      filler->SetNormal(at, normal);
    }
  }
  while (lines.Next(&line)) {
    if (!WordsOf(line).empty())
      throw error("is " + Quoted(line) + ", expected the end of the file");
  }
}

// Where the values of x, y, z and intensity stand, and those of colours and normals.
struct PcdColumns {
  const PcdField* fields[4];
  const PcdField* color;
  const PcdField* normals[3];

  explicit PcdColumns(const PcdHeader& header)
      : fields{header.Find("x"), header.Find("y"), header.Find("z"), header.Find("intensity")},
        color(PcdColor(header)),
        normals{PcdNormal(header, 0), PcdNormal(header, 1), PcdNormal(header, 2)} {}

  // value_at(field) gives the address of the field's value for this cell.
  template <typename ValueAddress>
  void Fill(int cell, const ValueAddress& value_at, PcdFiller* filler) const {
    double values[4] = {0, 0, 0, 0};
    for (int k = 0; k < 4; ++k) {
      if (fields[k] == nullptr) continue;
      values[k] = ValueAt(value_at(*fields[k]), fields[k]->type, fields[k]->size);
    }
    filler->Set(cell, {values[0], values[1], values[2]}, values[3]);
    if (color != nullptr) {
      uint32_t rgb = 0;
      std::memcpy(&rgb, value_at(*color), sizeof(rgb));
      filler->SetColor(cell, rgb);
    }
    if (!filler->wants_normals()) return;
    Eigen::Vector3d normal;
    for (int k = 0; k < 3; ++k) {
      normal[k] = ValueAt(value_at(*normals[k]), normals[k]->type, normals[k]->size);
    }
    filler->SetNormal(cell, normal);
  }
};

// One point after the other, all fields of each.
void ReadBinary(const FileReader& file, const PcdHeader& header, PcdFiller* filler) {
  const PcdColumns columns(header);
  std::vector<uint8_t> row(static_cast<size_t>(header.width * header.point_size));
  int cell = 0;
  for (int64_t r = 0; r < header.height; ++r) {
    const auto row_size = static_cast<int64_t>(row.size());
    file.Read(header.data_offset + r * row_size, row.data(), row_size);
    for (int64_t c = 0; c < header.width; ++c) {
      const uint8_t* const point = row.data() + c * header.point_size;
      columns.Fill(
          cell++, [point](const PcdField& field) { return point + field.offset; }, filler);
    }
  }
}

// One field after the other, each for all points, compressed by LZF as a whole. The sizes before
// the data were compared with the file and the header (CheckDataSize).
void ReadCompressed(const FileReader& file, const PcdHeader& header, PcdFiller* filler) {
  uint32_t sizes[2];  // compressed, decompressed
  file.Read(header.data_offset, sizes, 8);
  std::vector<uint8_t> packed(sizes[0]), data(sizes[1]);
  file.Read(header.data_offset + 8, packed.data(), sizes[0]);
  if (pcl::lzfDecompress(packed.data(), sizes[0], data.data(), sizes[1]) != sizes[1]) {
    throw InputError(file.path(), BytePosition(header.data_offset + 8),
                     "the compressed data cannot be decoded", kDamaged);
  }
  const PcdColumns columns(header);
  const int64_t num_points = header.width * header.height;
  for (int64_t cell = 0; cell < num_points; ++cell) {
    columns.Fill(
        static_cast<int>(cell),
        [&](const PcdField& field) {
          return data.data() + num_points * field.offset + cell * field.size * field.count;
        },
        filler);
  }
}

}  // namespace

Scan ReadPcd(const std::string& path, const PcdOptions& options, std::string* data_kind) {
  const FileReader file(path);
  const PcdHeader header = PcdHeaderParser(file, options.clouds).Parse();
  RequireMemoryForSamples(path, static_cast<double>(header.width * header.height));
  Scan scan;
  scan.path = path;
  PcdFiller filler(header, options, &scan);
  if (header.data == "ascii") {
    ReadAscii(file, header, &filler);
  } else if (header.data == "binary") {
    ReadBinary(file, header, &filler);
  } else {
    ReadCompressed(file, header, &filler);
  }
  if (scan.NumMissing() == static_cast<int>(scan.points.size())) {
    throw InputError(path, "", "holds no measured sample",
                     options.max_range > 0 ? "Give a larger --max_range" : "Give another file");
  }
  if (header.height == 1) FinishCloud(path, options.max_range, &scan);
  scan.up = scan.organised ? FindUpAxis(scan) : Eigen::Vector3d::UnitZ();
  scan.up_is_assumed = !scan.organised;
  if (data_kind != nullptr) *data_kind = header.data;
  return scan;
}

void WritePcd(const Scan& scan, const std::string& path) {
  const size_t count = scan.organised ? scan.points.size()
                                      : scan.points.size() - static_cast<size_t>(scan.NumMissing());
  const bool has_colors = !scan.colors.empty();
  const bool as_double = NeedsDouble(scan);
  OutputFile output(path);
  std::ostream& stream = output.stream();
  const char* const size = as_double ? "8" : "4";
  stream << "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z intensity"
         << (has_colors ? " rgb" : "") << "\nSIZE " << size << ' ' << size << ' ' << size << " 4"
         << (has_colors ? " 4" : "") << "\nTYPE F F F F" << (has_colors ? " F" : "")
         << "\nCOUNT 1 1 1 1" << (has_colors ? " 1" : "") << "\nWIDTH "
         << (scan.organised ? static_cast<size_t>(scan.num_columns) : count) << "\nHEIGHT "
         << scan.num_rows << "\nVIEWPOINT";
  const Eigen::Vector4d wxyz = WxyzFromQuaternion(scan.scan_from_station.rotation);
  stream.precision(17);
  for (int i = 0; i < 3; ++i) stream << ' ' << scan.Station()[i];
  for (int i = 0; i < 4; ++i) stream << ' ' << wxyz[i];
  stream << "\nPOINTS " << count << "\nDATA binary\n";
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (!scan.organised && scan.IsMissing(static_cast<int>(i))) continue;
    if (as_double) {
      stream.write(reinterpret_cast<const char*>(scan.points[i].data()), 3 * sizeof(double));
    } else {
      const Eigen::Vector3f point = scan.points[i].cast<float>();
      stream.write(reinterpret_cast<const char*>(point.data()), 3 * sizeof(float));
    }
    stream.write(reinterpret_cast<const char*>(&scan.intensity[i]), sizeof(float));
    if (!has_colors) continue;
    const std::array<uint8_t, 3>& c = scan.colors[i];
    const uint32_t rgb =
        static_cast<uint32_t>(c[0]) << 16 | static_cast<uint32_t>(c[1]) << 8 | c[2];
    stream.write(reinterpret_cast<const char*>(&rgb), sizeof(rgb));
  }
  output.Commit();
}

}  // namespace roomtex
