#include "importers/ptx.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string_view>

#include "core/error.h"
#include "core/output_file.h"
#include "core/resource_limits.h"
#include "core/text.h"
#include "importers/file_reader.h"
#include "importers/mesh_scan.h"
#include "importers/up_axis.h"

namespace roomtex {
namespace {

constexpr int64_t kShortestSample = 8;  // bytes: "0 0 0 0\n"
const char kNotPtx[] = "The file is damaged or not PTX";

bool IsSeparator(char c) { return c == ' ' || c == '\t' || c == ',' || c == ';'; }

// The numbers of a line; -1 if something in it is no number or there are more than `max_count`.
// Commas stand between them, or are decimal ones.
int ParseNumbers(std::string_view line, double* numbers, int max_count) {
  std::string with_points;
  if (HasDecimalCommas(line)) {
    with_points = line;
    std::replace(with_points.begin(), with_points.end(), ',', '.');
    line = with_points;
  }
  const char* at = line.data();
  const char* const end = at + line.size();
  int count = 0;
  while (true) {
    while (at < end && IsSeparator(*at)) ++at;
    if (at == end) return count;
    if (count == max_count) return -1;
    if (*at == '+') ++at;
    const auto [next, error] = std::from_chars(at, end, numbers[count]);
    if (error == std::errc::result_out_of_range) {
      numbers[count] = std::strtod(std::string(at, next).c_str(), nullptr);  // 1e-400 is zero
      if (!std::isfinite(numbers[count])) return -1;
    } else if (error != std::errc()) {
      return -1;
    }
    if (next < end && !IsSeparator(*next)) return -1;
    at = next;
    ++count;
  }
}

// The pose of one scan in the scan frame, and what takes the file's coordinates to the scan frame.
struct PtxPose {
  Eigen::Matrix3d scan_from_file_rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d scan_from_file_translation = Eigen::Vector3d::Zero();
  Rigid scan_from_station;
};

bool IsRotation(const Eigen::Matrix3d& matrix) {
  return (matrix * matrix.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-3 &&
         matrix.determinant() > 0;
}

class PtxParser {
 public:
  PtxParser(const FileReader& file, const PtxOptions& options)
      : file_(file), options_(options), lines_(file) {}

  std::vector<Scan> Parse(std::vector<std::string>* notes, const ScanVisitor& visit) {
    std::vector<Scan> scans;
    std::string_view line;
    int number = 0;
    while (NextUnblankLine(&line)) {
      Scan scan = ParseScan(line);
      scan.number_in_file = ++number;
      if (scan.NumMissing() == static_cast<int>(scan.points.size())) {
        notes->push_back("scan " + std::to_string(number) +
                         " holds no measured point and is left out");
        continue;
      }
      scans.push_back(std::move(scan));
      if (visit) visit(&scans);
    }
    if (number == 0) throw InputError(file_.path(), "", "is empty", "Give a PTX file");
    if (scans.empty()) {
      throw InputError(file_.path(), "", "no scan in it holds a measured point",
                       options_.max_range > 0 ? "Give a larger --max_range" : "Give another file");
    }
    return scans;
  }

 private:
  InputError Error(const std::string& finding) const {
    return InputError(file_.path(), LinePosition(lines_.line_number()), finding, kNotPtx);
  }
  InputError CutOff(const std::string& finding) const {
    return InputError(file_.path(), LinePosition(lines_.line_number() + 1), finding,
                      "The file is cut off: copy it again");
  }

  bool NextUnblankLine(std::string_view* line) {
    while (lines_.Next(line)) {
      if (line->find_first_not_of(" \t\x1a") != std::string_view::npos) return true;
    }
    return false;
  }

  int64_t ParseCount(std::string_view line, const char* name) const {
    double number = 0;
    if (ParseNumbers(line, &number, 1) != 1 || !(number >= 1) || !(number <= 1e15) ||
        number != std::floor(number)) {
      throw Error("is " + Quoted(line) + ", expected the number of " + name);
    }
    return static_cast<int64_t>(number);
  }

  void ParseRow(int count, double* numbers, const char* name) {
    std::string_view line;
    if (!lines_.Next(&line)) throw CutOff(std::string("the file ends before the ") + name);
    bool good = ParseNumbers(line, numbers, count) == count;
    for (int i = 0; good && i < count; ++i) good = std::isfinite(numbers[i]);
    if (!good) {
      throw Error("is " + Quoted(line) + ", expected the " + std::to_string(count) +
                  " numbers of the " + name);
    }
  }

  PtxPose ParsePose() {
    double position[3], axes[9], m[16];
    ParseRow(3, position, "scanner position");
    for (int i = 0; i < 3; ++i) ParseRow(3, axes + 3 * i, "scanner axes");
    for (int i = 0; i < 4; ++i) ParseRow(4, m + 4 * i, "4x4 pose");
    const Eigen::Matrix4d matrix =
        Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(m);
    const bool last_row = matrix.bottomLeftCorner<1, 3>().any();
    const bool last_column = matrix.topRightCorner<3, 1>().any();
    // Cyclone multiplies rows from the left, so that the translation is the last row.
    const Eigen::Matrix4d pose = last_column && !last_row ? matrix : matrix.transpose();
    PtxPose result;
    result.scan_from_file_rotation = pose.topLeftCorner<3, 3>();
    result.scan_from_file_translation = options_.meters_per_unit * pose.topRightCorner<3, 1>();
    if ((last_row && last_column) || std::abs(m[15] - 1) > 1e-6 ||
        !IsRotation(result.scan_from_file_rotation)) {
      throw Error("the 4x4 pose that ends here is not a rotation with a translation");
    }
    result.scan_from_station = {Eigen::Quaterniond(result.scan_from_file_rotation).normalized(),
                                result.scan_from_file_translation};
    const Eigen::Map<const Eigen::Vector3d> station(position);
    if (pose.isIdentity(0) && station.any()) {
      // Coordinates stand in the scan frame already; the scanner's place is told apart.
      const Eigen::Map<const Eigen::Matrix3d> axes_as_columns(axes);
      if (IsRotation(axes_as_columns)) {
        result.scan_from_station.rotation =
            Eigen::Quaterniond(Eigen::Matrix3d(axes_as_columns)).normalized();
      }
      result.scan_from_station.translation = options_.meters_per_unit * station;
    }
    return result;
  }

  Scan ParseScan(std::string_view first_line) {
    const int64_t num_columns = ParseCount(first_line, "columns");
    std::string_view line;
    if (!lines_.Next(&line)) throw CutOff("the file ends before the number of rows");
    const int64_t num_rows = ParseCount(line, "rows");
    const long size_line = lines_.line_number();
    const PtxPose pose = ParsePose();
    const double cells = static_cast<double>(num_columns) * static_cast<double>(num_rows);
    if (cells * kShortestSample > static_cast<double>(lines_.BytesLeft()) + 1 ||
        cells > std::numeric_limits<int>::max()) {
      throw InputError(file_.path(), LinePosition(size_line),
                       "says " + std::to_string(num_columns) + " columns by " +
                           std::to_string(num_rows) + " rows, but only " +
                           std::to_string(lines_.BytesLeft()) + " bytes follow",
                       "The file is cut off or its size damaged");
    }
    RequireMemoryForSamples(file_.path(), cells);
    Scan scan;
    scan.path = file_.path();
    scan.num_columns = static_cast<int>(num_columns);
    scan.num_rows = static_cast<int>(num_rows);
    scan.scan_from_station = pose.scan_from_station;
    ParseSamples(pose, &scan);
    scan.up = FindUpAxis(scan);
    return scan;
  }

  void ParseSamples(const PtxPose& pose, Scan* scan) {
    scan->points.resize(static_cast<size_t>(scan->num_columns) * scan->num_rows);
    scan->intensity.resize(scan->points.size());
    const double scale = options_.meters_per_unit;
    const bool apply =
        !pose.scan_from_file_rotation.isIdentity(0) || !pose.scan_from_file_translation.isZero(0);
    std::string_view line;
    double v[7];
    for (int column = 0; column < scan->num_columns; ++column) {
      for (int row = scan->num_rows - 1; row >= 0; --row) {
        if (!lines_.Next(&line)) {
          throw CutOff("the file ends in column " + std::to_string(column) + " of " +
                       std::to_string(scan->num_columns));
        }
        const int count = ParseNumbers(line, v, 7);
        if (count != 4 && count != 7) {
          throw Error("is " + Quoted(line) +
                      ", expected \"x y z intensity\" or \"x y z intensity " + "r g b\"");
        }
        const int cell = scan->Index(column, row);
        Eigen::Vector3d point = scale * Eigen::Vector3d(v[0], v[1], v[2]);
        const bool missing = (v[0] == 0 && v[1] == 0 && v[2] == 0) || !std::isfinite(point.sum());
        if (!missing && apply) {
          point = pose.scan_from_file_rotation * point + pose.scan_from_file_translation;
        }
        if (missing || IsTooFar(point, *scan)) {
          scan->points[cell] = Scan::MissingPoint();
          scan->intensity[cell] = 0;
        } else {
          if (options_.colors && count == 7) {
            if (scan->colors.empty()) scan->colors.assign(scan->points.size(), {0, 0, 0});
            scan->colors[cell] = color_scale_.Bytes({v[4], v[5], v[6]}, &scan->colors);
          }
          scan->points[cell] = point;
          scan->intensity[cell] = std::isfinite(v[3]) ? static_cast<float>(v[3]) : 0.0f;
        }
      }
    }
  }

  bool IsTooFar(const Eigen::Vector3d& point, const Scan& scan) const {
    return options_.max_range > 0 && (point - scan.Station()).norm() > options_.max_range;
  }

  const FileReader& file_;
  PtxOptions options_;
  LineReader lines_;
  ColorScale color_scale_{255};
};

// Appends numbers with the given digits after the point.
class Line {
 public:
  void Add(double number, int digits, char after) {
    char text[352];  // the longest double without exponent has 309 digits before the point
    const auto result =
        std::to_chars(text, text + sizeof(text), number, std::chars_format::fixed, digits);
    text_.append(text, result.ptr);
    text_ += after;
  }
  // The shortest text that reads back as the same number.
  void Add(double number, char after) {
    char text[64];
    text_.append(text, std::to_chars(text, text + sizeof(text), number).ptr);
    text_ += after;
  }
  void FlushTo(std::ostream& stream, size_t above = 0) {
    if (text_.size() <= above) return;
    stream << text_;
    text_.clear();
  }
  void Text(const std::string& text) { text_ += text; }

 private:
  std::string text_;
};

// Rotations with 12 decimals, so that writing what was read gives the same text.
void WritePtxHeader(const Scan& scan, Line* line) {
  line->Text(std::to_string(scan.num_columns) + "\n" + std::to_string(scan.num_rows) + "\n");
  const Eigen::Matrix3d axes_as_rows =
      scan.scan_from_station.rotation.toRotationMatrix().transpose();
  const Eigen::Vector3d& station = scan.scan_from_station.translation;
  const auto add_axis = [&](int axis, char last) {
    for (int i = 0; i < 3; ++i) line->Add(axes_as_rows(axis, i), 12, i < 2 ? ' ' : last);
  };
  for (int i = 0; i < 3; ++i) line->Add(station[i], i < 2 ? ' ' : '\n');
  for (int axis = 0; axis < 3; ++axis) add_axis(axis, '\n');
  for (int axis = 0; axis < 3; ++axis) {
    add_axis(axis, ' ');
    line->Text("0\n");
  }
  for (int i = 0; i < 3; ++i) line->Add(station[i], ' ');
  line->Text("1\n");
}

}  // namespace

double IntensityDivisor(const Scan& scan, double* offset) {
  double low = 0, high = 0;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (scan.IsMissing(static_cast<int>(i)) || !std::isfinite(scan.intensity[i])) continue;
    low = std::min<double>(low, scan.intensity[i]);
    high = std::max<double>(high, scan.intensity[i]);
  }
  *offset = low;
  if (low < 0) return high - low;
  for (const double divisor : {1.0, 255.0, 4095.0, 65535.0}) {
    if (high <= divisor) return divisor;
  }
  return high;
}

std::vector<Scan> ReadPtx(const std::string& path, const PtxOptions& options,
                          std::vector<std::string>* notes, const ScanVisitor& visit) {
  std::vector<std::string> ignored;
  const FileReader file(path);
  return PtxParser(file, options).Parse(notes == nullptr ? &ignored : notes, visit);
}

void WritePtx(const std::vector<Scan>& scans, const std::string& path) {
  for (const Scan& scan : scans) {
    if (!scan.organised) throw std::invalid_argument("WritePtx needs organised scans");
  }
  OutputFile output(path);
  Line line;
  for (const Scan& scan : scans) {
    WritePtxHeader(scan, &line);
    double offset = 0;
    const double divisor = IntensityDivisor(scan, &offset);
    const Rigid station_from_scan = scan.scan_from_station.Inverse();
    for (int column = 0; column < scan.num_columns; ++column) {
      for (int row = scan.num_rows - 1; row >= 0; --row) {
        const int cell = scan.Index(column, row);
        if (scan.IsMissing(cell)) {
          line.Text(scan.colors.empty() ? "0 0 0 0.500000\n" : "0 0 0 0.500000 0 0 0\n");
          continue;
        }
        const Eigen::Vector3d point = station_from_scan * scan.points[cell];
        for (int i = 0; i < 3; ++i) line.Add(point[i], 6, ' ');
        const double intensity = scan.intensity[cell];
        line.Add(std::isfinite(intensity) ? (intensity - offset) / divisor : 0, 6,
                 scan.colors.empty() ? '\n' : ' ');
        for (size_t k = 0; k < 3 && !scan.colors.empty(); ++k) {
          line.Add(scan.colors[static_cast<size_t>(cell)][k], 0, k < 2 ? ' ' : '\n');
        }
        line.FlushTo(output.stream(), 1 << 20);
      }
    }
    line.FlushTo(output.stream());
  }
  output.Commit();
}

}  // namespace roomtex
