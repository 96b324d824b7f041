#include "importers/e57.h"

#include <algorithm>
#include <charconv>
#include <limits>

#include "core/error.h"
#include "core/resource_limits.h"
#include "core/text.h"
#include "importers/e57_document.h"
#include "importers/e57_grid.h"
#include "importers/e57_points.h"
#include "importers/mesh_scan.h"

namespace roomtex {
namespace {

constexpr int kNamesShown = 5;  // in a message

std::string NamesOf(const std::vector<E57Scan>& scans) {
  std::string text;
  for (size_t i = 0; i < scans.size() && i < kNamesShown; ++i) {
    text += (i > 0 ? ", " : "") + std::to_string(i + 1) + " " + Quoted(scans[i].name);
  }
  return scans.size() > kNamesShown ? text + " ..." : text;
}

// Numbers (from 0) of the scans that are asked for.
std::vector<size_t> ChosenScans(const std::string& path, const std::vector<E57Scan>& scans,
                                const std::string& part) {
  std::vector<size_t> chosen;
  for (size_t i = 0; i < scans.size(); ++i) {
    if (part.empty() || scans[i].name == part || scans[i].guid == part) chosen.push_back(i);
  }
  if (part.empty()) return chosen;
  if (chosen.size() > 1) {
    throw InputError(path, "",
                     "has " + std::to_string(chosen.size()) + " scans of the name " + Quoted(part),
                     "Give the number of one behind #: " + std::to_string(chosen[0] + 1) + " or " +
                         std::to_string(chosen[1] + 1));
  }
  if (chosen.empty()) {
    size_t number = 0;
    const char* const end = part.data() + part.size();
    const auto [stop, error] = std::from_chars(part.data(), end, number);
    if (error == std::errc() && stop == end && number >= 1 && number <= scans.size()) {
      return {number - 1};
    }
    throw InputError(path, "", "has no scan " + Quoted(part) + "; it has " + NamesOf(scans),
                     "Give the name or the number of a scan behind #, or the file alone for all");
  }
  return chosen;
}

// Reads one scan into a grid, or as a cloud.
class E57ScanReader {
 public:
  E57ScanReader(const E57Pages& pages, const E57Scan& source, const E57Options& options,
                std::vector<std::string>* notes)
      : source_(source), options_(options), reader_(pages, source, options.colors) {
    scan_.path = pages.path();
    scan_.name = source.name;
    scan_.up = Eigen::Vector3d::UnitZ();
    scan_.scan_from_station = source.file_from_scan;
    scan_.scan_from_station.translation *= options.meters_per_unit;
    if (IsStructured(source)) grid_ = E57Grid::Find(pages, source, notes);
  }

  Scan Read() {
    if (grid_) {
      ReadGrid();
      StandUpright(&scan_);
    } else {
      ReadCloud();
    }
    return std::move(scan_);
  }

 private:
  // In the frame of the file, NaN if it does not count.
  Eigen::Vector3d PointInScan(int64_t i) const {
    const Eigen::Vector3d point = options_.meters_per_unit * reader_.Point(i);
    if (!(options_.max_range <= 0 || point.norm() <= options_.max_range)) {
      return Scan::MissingPoint();
    }
    return rotation_ * point + scan_.scan_from_station.translation;
  }

  bool HasColors() const { return options_.colors && reader_.HasColors(); }

  void ReadGrid() {
    scan_.num_rows = grid_->num_rows();
    scan_.num_columns = grid_->num_columns();
    const size_t cells = static_cast<size_t>(scan_.num_rows) * scan_.num_columns;
    // With many empty cells the grid takes more than its records, which were asked about before.
    const double cell_bytes = sizeof(Eigen::Vector3d) + sizeof(float) * (1 + reader_.HasReturns()) +
                              3.0 * static_cast<double>(HasColors());
    RequireMemory(scan_.path,
                  "a grid of " + std::to_string(scan_.num_columns) + " x " +
                      std::to_string(scan_.num_rows) + " cells",
                  static_cast<double>(cells) * cell_bytes, "Export the scan with a coarser grid");
    scan_.points.assign(cells, Scan::MissingPoint());
    scan_.intensity.assign(cells, 0.0f);
    if (HasColors()) scan_.colors.assign(cells, {0, 0, 0});
    std::vector<float> returns(reader_.HasReturns() ? cells : 0);
    while (const int64_t count = reader_.Next()) {
      for (int64_t i = 0; i < count; ++i) {
        const Eigen::Vector3d point = PointInScan(i);
        if (!(point.x() == point.x())) continue;
        const int column = grid_->ColumnOf(reader_.Column(i)), row = grid_->RowOf(reader_.Row(i));
        if (column < 0 || row < 0) continue;
        const int cell = scan_.Index(column, row);
        const float number = reader_.HasReturns() ? static_cast<float>(reader_.Return(i)) : 0;
        // Of two in one cell the first return stays.
        const bool is_free = scan_.IsMissing(cell);
        if (!is_free && (returns.empty() || !(number < returns[static_cast<size_t>(cell)]))) {
          continue;
        }
        scan_.points[static_cast<size_t>(cell)] = point;
        scan_.intensity[static_cast<size_t>(cell)] = reader_.Intensity(i);
        if (HasColors()) {
          scan_.colors[static_cast<size_t>(cell)] = scale_.Bytes(reader_.Color(i), &scan_.colors);
        }
        if (!returns.empty()) returns[static_cast<size_t>(cell)] = number;
      }
    }
  }

  void ReadCloud() {
    if (reader_.num_records() > std::numeric_limits<int>::max()) {
      throw InputError(scan_.path, "",
                       "the scan " + Quoted(source_.name) + " has " +
                           std::to_string(reader_.num_records()) + " points",
                       "More than 2147483647 are not read: thin it out");
    }
    scan_.organised = false;
    while (const int64_t count = reader_.Next()) {
      for (int64_t i = 0; i < count; ++i) {
        const Eigen::Vector3d point = PointInScan(i);
        if (!(point.x() == point.x())) {
          ++scan_.num_left_out;
          continue;
        }
        scan_.points.push_back(point);
        scan_.intensity.push_back(reader_.Intensity(i));
        if (HasColors()) scan_.colors.push_back(scale_.Bytes(reader_.Color(i), &scan_.colors));
        if (reader_.HasNormals()) {
          const Eigen::Vector3d normal = rotation_ * reader_.Normal(i);
          const bool is_one = normal.allFinite() && normal.norm() > 0.5;
          scan_.normals.emplace_back(is_one ? normal.normalized().cast<float>()
                                            : Eigen::Vector3f::Zero().eval());
        }
      }
    }
    scan_.num_rows = 1;
    scan_.num_columns = static_cast<int>(scan_.points.size());
  }

  const E57Scan& source_;
  E57Options options_;
  E57PointReader reader_;
  std::optional<E57Grid> grid_;
  Scan scan_;
  ColorScale scale_{1};
  Eigen::Matrix3d rotation_ = source_.file_from_scan.rotation.toRotationMatrix();
};

// No more than the bytes of the file can hold; records without bits are read as one.
double MostRecords(const E57Points& points, int64_t num_bytes) {
  double bits = 0;
  for (const E57Field& field : points.fields) bits += field.num_bits;
  const double fit = bits > 0 ? 8 * static_cast<double>(num_bytes) / bits : 1;
  return std::min(static_cast<double>(points.num_records), fit);
}

}  // namespace

std::vector<Scan> ReadE57(const std::string& path, const std::string& part,
                          const E57Options& options, std::vector<std::string>* notes,
                          const ScanVisitor& visit) {
  std::vector<std::string> ignored;
  if (notes == nullptr) notes = &ignored;
  const E57Pages pages(path, options.check);
  const E57Document document = ReadE57Document(pages);
  if (document.scans.empty()) {
    throw InputError(path, "", "holds no scan", "Give an E57 file with a scan (data3D)");
  }
  double num_records = 0, largest = 0;
  for (const size_t i : ChosenScans(path, document.scans, part)) {
    const double records = MostRecords(document.scans[i].points, pages.logical_size());
    num_records += records;
    largest = std::max(largest, records);
  }
  RequireMemoryForSamples(path, num_records, largest);
  std::vector<Scan> scans;
  for (const size_t i : ChosenScans(path, document.scans, part)) {
    const E57Scan& source = document.scans[i];
    Scan scan;
    if (source.points.num_records > 0) {
      scan = E57ScanReader(pages, source, options, notes).Read();
    }
    scan.number_in_file = static_cast<int>(i) + 1;
    if (scan.NumMissing() < static_cast<int>(scan.points.size())) {
      scans.push_back(std::move(scan));
      if (visit) visit(&scans);
    } else {
      notes->push_back("scan " + std::to_string(i + 1) + " " + Quoted(source.name) +
                       " holds no measured point and is left out");
    }
  }
  if (scans.empty()) {
    throw InputError(path, "", "no scan in it holds a measured point",
                     options.max_range > 0 ? "Give a larger --max_range" : "Give another file");
  }
  return scans;
}

}  // namespace roomtex
