#include "importers/scan_reader.h"

#include <algorithm>
#include <cctype>
#include <numeric>
#include <optional>
#include <string_view>

#include "core/error.h"
#include "core/frames.h"
#include "core/option_fields.h"
#include "core/resource_limits.h"
#include "core/text.h"
#include "importers/e57.h"
#include "importers/e57_pages.h"
#include "importers/file_reader.h"
#include "importers/las.h"
#include "importers/las_unit.h"
#include "importers/length_unit.h"
#include "importers/obj.h"
#include "importers/pcd.h"
#include "importers/ply.h"
#include "importers/ptx.h"
#include "importers/rtpi.h"
#include "importers/scan_finish.h"
#include "importers/scan_path.h"
#include "importers/scan_poses.h"
#include "importers/up_axis.h"
#include "importers/xyz.h"

namespace roomtex {
namespace {

constexpr int64_t kLookAt = 1 << 16;  // bytes from the start that decide the format
const char kKnownFormats[] =
    "Give an RTPI, a PTX, an E57, a PCD, a PLY, a LAS, an OBJ mesh or points as text (the "
    "content counts, not the name)";

// The next line of the text, removed from it.
std::string_view TakeLine(std::string_view* text) {
  const size_t newline = std::min(text->find('\n'), text->size());
  std::string_view line = text->substr(0, newline);
  text->remove_prefix(std::min(newline + 1, text->size()));
  while (!line.empty() && std::isspace(static_cast<unsigned char>(line.back()))) {
    line.remove_suffix(1);
  }
  while (!line.empty() && std::isspace(static_cast<unsigned char>(line.front()))) {
    line.remove_prefix(1);
  }
  return line;
}

bool IsWholeNumber(std::string_view line) {
  return !line.empty() && line.size() < 16 &&
         std::all_of(line.begin(), line.end(), [](char c) { return c >= '0' && c <= '9'; });
}

// PCD files begin with comments and then one of the header's keywords.
bool LooksLikePcd(std::string_view bytes) {
  while (!bytes.empty()) {
    const std::string_view line = TakeLine(&bytes);
    if (line.empty() || BeginsWith(line, "#")) continue;
    for (const char* keyword : {"VERSION", "FIELDS", "COLUMNS"}) {
      if (BeginsWith(line, keyword)) return true;
    }
    return false;
  }
  return false;
}

// A PTX begins with two lines of one whole number each (also damaged ones: the reader says what is
// wrong).
bool LooksLikePtx(std::string_view bytes) {
  std::string_view line;
  while (!bytes.empty() && line.empty()) line = TakeLine(&bytes);
  if (!IsWholeNumber(line)) return false;
  line = TakeLine(&bytes);
  return line.empty() || IsWholeNumber(BeginsWith(line, "-") ? line.substr(1) : line);
}

// The name of a format in which a scan may lie packed, "" if it is none of these.
std::string PackedFormat(std::string_view bytes) {
  static const std::pair<std::string_view, const char*> kMagics[] = {
      {"PK\x03\x04", "a zip archive"},
      {"\x1f\x8b", "a gzip file"},
      {"BZh", "a bzip2 file"},
      {"\xfd"
       "7zXZ",
       "an xz file"},
      {"7z\xbc\xaf", "a 7z archive"}};
  for (const auto& [magic, name] : kMagics) {
    if (BeginsWith(bytes, magic)) return name;
  }
  return "";
}

// The name of a format that users may take for a scan, "" if it is none of these.
std::string ForeignFormat(std::string_view bytes) {
  static const std::pair<std::string_view, const char*> kMagics[] = {
      {"\x89PNG", "a PNG image"}, {"\xff\xd8", "a JPEG photo"}, {"glTF", "a glTF model"},
      {"OFF", "an OFF mesh"},     {"solid ", "an STL mesh"},    {"SQLite format", "a database"}};
  for (const auto& [magic, name] : kMagics) {
    if (BeginsWith(bytes, magic)) return name;
  }
  return "";
}

double MetersPerUnitOr(const std::string& units, double otherwise) {
  return units.empty() ? otherwise : MetersPerUnit(units).value_or(otherwise);
}

ScanFile ReadAsRtpi(const std::string& path, const ScanReaderOptions& options) {
  constexpr double kRtpiSampleBytes = 16;
  RequireMemoryForSamples(path, static_cast<double>(FileReader(path).size()) / kRtpiSampleBytes);
  const RtpiFile rtpi = ReadRtpi(path);
  ScanFile file;
  file.format = "RTPI";
  file.byte_order = rtpi.byte_order == ByteOrder::kBig ? "big" : "little";
  const std::string of_file = AzimuthOfFile(rtpi.header);
  const std::string of_scanner = AzimuthOfScanner(rtpi.header);
  const std::string by_default = !of_file.empty()      ? of_file
                                 : !of_scanner.empty() ? of_scanner
                                                       : "clockwise";
  file.azimuth = options.azimuth == "auto" ? by_default : options.azimuth;
  if (!of_scanner.empty()) {
    const std::string whose =
        path + " has the header of a DeltaSphere, whose azimuths are " + of_scanner + ": ";
    if (options.azimuth == "auto") {
      file.azimuth_note = whose + "it is read so (--azimuth says another).";
    } else if (options.azimuth != of_scanner) {
      file.azimuth_note = whose + "read " + options.azimuth + " the room is a mirror image.";
    }
  } else if (!of_file.empty() && file.azimuth != of_file) {
    file.azimuth_note = path + " says that its azimuths are " + of_file + ": read " + file.azimuth +
                        " the room is a mirror image.";
  }
  if (!file.azimuth_note.empty()) file.notes.push_back(file.azimuth_note);
  RtpiScanOptions scan_options;
  scan_options.counterclockwise = file.azimuth == "counterclockwise";
  scan_options.meters_per_unit = MetersPerUnitOr(options.units, 0);
  file.meters_per_unit = scan_options.meters_per_unit > 0 ? scan_options.meters_per_unit
                                                          : MetersPerUnitOr(rtpi.header.units, 1);
  scan_options.max_range = options.max_range;
  scan_options.colors = options.colors;
  file.scans.push_back(ScanFromRtpi(rtpi, scan_options, &file.notes));
  return file;
}

// What every scan goes through as soon as it is read.
class ScanFinish {
 public:
  ScanFinish(const ScanReaderOptions& options, const ScanVisitor& visit)
      : options_(options), visit_(visit) {}

  ScanVisitor Of(ScanFile* file) const {
    return [this, file](std::vector<Scan>* scans) {
      FinishScan(options_, file, &scans->back());
      if (visit_) visit_(scans);
    };
  }

 private:
  const ScanReaderOptions& options_;
  const ScanVisitor& visit_;
};

// said: what the file says, one of LengthUnitNames() or ""; it counts, with a note, unless the
// option says another.
void TakeUnit(const std::string& said, const ScanReaderOptions& options, ScanFile* file) {
  file->unit_is_said = file->unit_is_said || !said.empty();
  if (said.empty() || said == "meters" || !options.units.empty()) return;
  file->notes.push_back("the file says that its unit is " + said +
                        "; coordinates become metres (--units says another)");
  file->meters_per_unit = *MetersPerUnit(said);
}

// Likewise, of its coordinate system, with what else that says.
void TakeUnitOfLas(const std::string& path, const ScanReaderOptions& options, ScanFile* file) {
  if (!options.units.empty()) return;
  const LasUnits units = ReadLasUnits(path);
  file->unit_is_said = units.projected;
  if (units.degrees) {
    throw InputError(path, "", "has coordinates of longitude and latitude",
                     "Project it (UTM, for example), by pdal translate with filters.reprojection; "
                     "or give --units if its coordinates are lengths all the same");
  }
  if (!units.vertical.empty() && !units.horizontal.empty() && units.vertical != units.horizontal) {
    file->notes.push_back("its heights are in " + units.vertical + ", the rest in " +
                          units.horizontal + ": they are read as " + units.horizontal +
                          " like the rest (export it anew)");
  }
  if (units.projected && units.horizontal.empty()) {
    file->notes.push_back(
        "its coordinate system does not say its unit in a way that is known" +
        (units.vertical.empty() ? std::string() : " (of its heights: " + units.vertical + ")") +
        ": its coordinates are taken for metres (--units says another)");
  }
  TakeUnit(units.horizontal, options, file);
  if (units.horizontal.empty() || units.horizontal == "meters") {
    file->coordinate_system = units.wkt;
  }
}

ScanFile ReadAsE57(const ScanPath& path, const ScanReaderOptions& options,
                   const ScanFinish& finish) {
  ScanFile file;
  file.format = "E57";
  file.byte_order = "little";
  file.meters_per_unit = MetersPerUnitOr(options.units, 1);
  file.scans = ReadE57(path.file, path.part,
                       {file.meters_per_unit, options.max_range, options.e57_check, options.colors},
                       &file.notes, finish.Of(&file));
  return file;
}

ScanFile ReadWith(const std::string& given_path, const ScanReaderOptions& options,
                  const ScanFinish& finish) {
  ThrowIfProblems(options.Problems());
  const ScanPath parts = SplitScanPath(given_path);
  const std::string& path = parts.file;
  std::string start;
  {
    const FileReader reader(path);
    if (reader.size() == 0) throw InputError(path, "", "is empty", kKnownFormats);
    start = reader.ReadSome(0, kLookAt);
    start.erase(0, SizeOfByteOrderMark(start));
    if (LineEndOf(start) == '\r') std::replace(start.begin(), start.end(), '\r', '\n');
  }
  if (BeginsWith(start, "\xff\xfe") || BeginsWith(start, "\xfe\xff")) {
    throw InputError(path, BytePosition(0), "is text in UTF-16, expected UTF-8",
                     "Save it as UTF-8 or ASCII, by a text editor for example");
  }
  if (const std::string packed = PackedFormat(start); !packed.empty()) {
    throw InputError(path, BytePosition(0), "is " + packed + ", expected a range scan",
                     "Unpack it, and give the file that is in it");
  }
  if (LooksLikeE57(start)) return ReadAsE57(parts, options, finish);
  if (!parts.part.empty()) {
    throw InputError(path, "", "is no E57: a single scan of it cannot be named",
                     "Leave out " + Quoted("#" + parts.part));
  }
  ScanFile file;
  const ScanVisitor visit = finish.Of(&file);
  if (LooksLikeRtpi(start)) {
    file = ReadAsRtpi(path, options);
    visit(&file.scans);
    return file;
  }
  const double meters_per_unit = MetersPerUnitOr(options.units, 1);
  file.meters_per_unit = meters_per_unit;
  const PlyOptions mesh_options{meters_per_unit, options.max_range, true, options.colors, true};
  if (BeginsWith(start, "ply\n") || BeginsWith(start, "ply\r")) {
    file.format = "PLY";
    file.scans.push_back(ReadPly(path, mesh_options, &file.byte_order));
  } else if (LooksLikePcd(start)) {
    file.format = "PCD";
    file.scans.push_back(ReadPcd(path, {meters_per_unit, options.max_range, true, options.colors},
                                 &file.byte_order));
    file.byte_order = file.byte_order == "ascii" ? "text" : "little";
  } else if (LooksLikePtx(start)) {
    file.format = "PTX";
    file.byte_order = "text";
    file.scans =
        ReadPtx(path, {meters_per_unit, options.max_range, options.colors}, &file.notes, visit);
  } else if (LooksLikeLas(start)) {
    file.format = "LAS";
    file.byte_order = "little";
    TakeUnitOfLas(path, options, &file);
    file.scans.push_back(ReadLas(path, {file.meters_per_unit, options.max_range, options.colors}));
  } else if (ForeignFormat(start).empty() && LooksLikeObj(start)) {
    file.format = "OBJ";
    file.byte_order = "text";
    file.scans.push_back(ReadObj(path, mesh_options));
    // The only one that does not say how many there are.
    RequireMemoryForSamples(path, static_cast<double>(file.scans[0].points.size()));
  } else if (ForeignFormat(start).empty() && LooksLikeXyz(start)) {
    file.format = "XYZ";
    file.byte_order = "text";
    TakeUnit(UnitOfXyz(start), options, &file);
    file.scans.push_back(ReadXyz(path, {file.meters_per_unit, options.max_range, options.colors}));
  } else {
    const std::string foreign = ForeignFormat(start);
    throw InputError(path, BytePosition(0),
                     foreign.empty() ? "begins with " + Quoted(start) + ", which is no scan format"
                                     : "is " + foreign + ", expected a range scan",
                     kKnownFormats);
  }
  if (file.byte_order == "ascii") file.byte_order = "text";
  if (file.format != "PTX") visit(&file.scans);
  return file;
}

}  // namespace

void ScanReaderOptions::Declare(OptionFields* fields) {
  fields->Choice("azimuth", &azimuth, {"auto", "clockwise", "counterclockwise"},
                 "RTPI: sense in which the azimuth grows, seen from above. clockwise is the "
                 "thesis' formula; files of real scanners are counterclockwise. The wrong one "
                 "mirrors the room. auto: as it is known (an aligned model remembers it, picks "
                 "show it, or the header is a DeltaSphere's own), else clockwise.");
  fields
      ->Choice("units", &units, LengthUnitNames(),
               "Unit of the lengths in the scan file; not given = what the file says, metres "
               "if it does not.")
      .Also(units.empty() || MetersPerUnit(units));
  fields
      ->Number("max_range", &max_range,
               "Metres; samples farther from the scanner count as missing. 0 = the limit "
               "that the file gives, if any.")
      .NotNegative()
      .Finite()
      .Says("must be 0 (no limit) or a number of metres");
  std::vector<std::string> axes = UpAxisNames();
  axes.insert(axes.begin(), "auto");
  fields->Choice(
      "up_axis", &up_axis, axes,
      "Axis of the file's coordinates that points up. auto: as the file says it (E57: z, "
      "RTPI: y); where it does not (PLY, OBJ, PCD, PTX, LAS, text), y if grid, floor and walls "
      "show it, else z.");
  fields->Bool("E57.check", &e57_check,
               "Compare the checksums of an E57 file before it is read; 0 = take a damaged file as "
               "it is.");
}

std::vector<std::string> ScanReaderOptions::Problems() const { return ProblemsOf(*this); }

ScanFile ReadScanFile(const std::string& path, const ScanReaderOptions& options,
                      const ScanVisitor& visit) {
  ScanReaderOptions wanted = options;
  wanted.colors = options.colors || options.colors_as_intensity;
  return ReadWith(path, wanted, ScanFinish(wanted, visit));
}

Scan ReadScan(const std::string& path, const ScanReaderOptions& options) {
  ScanFile file = ReadScanFile(path, options);
  if (file.scans.size() > 1) {
    throw InputError(path, "",
                     "holds " + std::to_string(file.scans.size()) + " scans, expected one",
                     file.format == "E57" ? "Name one of them behind #: " + path + "#1"
                                          : "Split it, or use a command that takes several scans");
  }
  return std::move(file.scans.front());
}

std::vector<size_t> PlacedScans::SortByPath() {
  std::vector<size_t> order(files.size()), back(files.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [this](size_t a, size_t b) { return files[a].path < files[b].path; });
  for (size_t i = 0; i < order.size(); ++i) back[order[i]] = i;
  Reorder(order);
  return back;
}

std::vector<size_t> PlacedScans::ScanOrder(const std::vector<size_t>& order) const {
  std::vector<size_t> first(files.size() + 1, 0), result;
  for (size_t i = 0; i < files.size(); ++i) first[i + 1] = first[i] + files[i].placed.size();
  for (const size_t i : order) {
    for (size_t k = first[i]; k < first[i + 1]; ++k) result.push_back(k);
  }
  for (size_t k = result.size(); k < scans.size(); ++k) result.push_back(k);
  return result;
}

void PlacedScans::Reorder(const std::vector<size_t>& order) {
  PlacedScans now;
  for (const size_t k : ScanOrder(order)) {
    now.scans.push_back(std::move(scans[k]));
    if (k < stations.size()) now.stations.push_back(stations[k]);
  }
  for (const size_t i : order) now.files.push_back(std::move(files[i]));
  files = std::move(now.files);
  scans = std::move(now.scans);
  stations = std::move(now.stations);
}

PlacedScans ReadPlacedScans(const std::vector<std::string>& paths, const std::string& poses_path,
                            const ScanReaderOptions& options, double max_samples) {
  if (paths.empty()) throw UsageError("--scan_path is missing");
  for (size_t i = 0; i < paths.size(); ++i) {
    if (std::count(paths.begin(), paths.begin() + static_cast<long>(i), paths[i]) > 0) {
      throw UsageError("--scan_path " + paths[i] + " is given twice");
    }
  }
  ScanPoses poses(poses_path);
  PlacedScans placed;
  placed.enu = poses.enu();
  ScanThinner thinner(max_samples, &placed.scans);
  const auto thin = [&thinner](std::vector<Scan>* of_file) { thinner.Take(of_file); };
  for (const std::string& path : paths) {
    ScanFile file = ReadScanFile(path, options, thin);
    const int count = static_cast<int>(file.scans.size());
    PlacedScans::File read{path, file.azimuth, file.up_axis, file.meters_per_unit, {}, options};
    if (!file.azimuth_note.empty()) placed.notes.push_back(file.azimuth_note);
    for (const std::string& note : file.notes) {
      if (note != file.azimuth_note) placed.notes.push_back(path + ": " + note + ".");
    }
    for (int k = 0; k < count; ++k) {
      Scan& scan = file.scans[k];
      const std::optional<ScanPoses::Placement> pose =
          poses.Take({path, scan.number_in_file, count, UpInStation(scan), file.CarriesPoses()});
      read.placed.push_back(pose.has_value());
      if (pose) {
        PlaceScan(pose->scan_from_station, &scan);
        if (pose->station) placed.stations.push_back(*pose->station);
      }
      placed.scans.push_back(std::move(scan));
    }
    placed.files.push_back(std::move(read));
  }
  placed.stride = thinner.stride();
  poses.RequireAllPlaced();
  return placed;
}

void ForEachFullScan(const PlacedScans& placed,
                     const std::function<void(size_t index, Scan scan)>& take) {
  size_t first = 0;
  for (const PlacedScans::File& file : placed.files) {
    ReadScanFile(file.path, file.options, [&](std::vector<Scan>* of_file) {
      const size_t k = of_file->size() - 1;
      if (k >= file.placed.size()) return;  // the file has grown meanwhile
      Scan scan = std::move(of_file->back());
      of_file->back() = Scan();
      if (file.placed[k]) PlaceScan(placed.scans[first + k].scan_from_station, &scan);
      take(first + k, std::move(scan));
    });
    first += file.placed.size();
  }
}

std::vector<Scan> ReadScans(const std::vector<std::string>& paths, const std::string& poses_path,
                            const ScanReaderOptions& options) {
  return ReadPlacedScans(paths, poses_path, options).scans;
}

const char* ScanPosesHelp() {
  return "Where the scanners stood, a line per scan: NAME and 4x4 matrix (row by row), NAME and "
         "quaternion w x y z and translation, or surveyed stations NAME geo LATITUDE LONGITUDE "
         "HEIGHT HEADING (degrees WGS84, metres above the ellipsoid, not above sea level; degrees "
         "clockwise from north to azimuth 0, the -z axis; of a z-up scan the y axis). NAME is the "
         "scan's path or file name; # starts a comment. With surveyed stations the scan frame is "
         "east-north-up about the first one.";
}

}  // namespace roomtex
