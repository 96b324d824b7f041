#include "importers/e57_writer.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "core/command_line.h"
#include "core/decompositions.h"
#include "core/frames.h"
#include "importers/content_hash.h"
#include "importers/e57_pages.h"
#include "importers/ptx.h"

namespace roomtex {
namespace {

constexpr size_t kPageSize = 1024, kPayload = kPageSize - E57Pages::kChecksumSize;
constexpr double kUnit = 1e-6;  // metres of a raw coordinate
constexpr size_t kLargestPacket = 1 << 16;
constexpr double kPixel = 5e-6;  // metres; only ratios count

template <typename Number>
std::string LittleEndianBytes(Number number) {
  std::string bytes;
  for (size_t i = 0; i < sizeof(Number); ++i) {
    bytes += static_cast<char>(static_cast<uint64_t>(number) >> (8 * i));
  }
  return bytes;
}

// The shortest text that reads back as the same number.
std::string TextOf(double number) {
  char text[64];
  return {text, std::to_chars(text, text + sizeof(text), number).ptr};
}

std::string Element(const std::string& name, const std::string& type, const std::string& content,
                    const std::string& attributes = "") {
  return "<" + name + " type=\"" + type + "\"" + attributes + ">" + content + "</" + name + ">\n";
}
std::string Structure(const std::string& name, const std::string& content) {
  return Element(name, "Structure", "\n" + content);
}
std::string Float(const std::string& name, double value) {
  return Element(name, "Float", TextOf(value));
}
std::string Integer(const std::string& name, int64_t value) {
  return Element(name, "Integer", std::to_string(value));
}
std::string Text(const std::string& name, const std::string& text) {
  std::string safe;
  for (const char c : text) safe += static_cast<unsigned char>(c) < 32 ? '?' : c;
  for (size_t at; (at = safe.find("]]>")) != std::string::npos;) safe.replace(at, 3, "]]_");
  return Element(name, "String", "<![CDATA[" + safe + "]]>");
}

std::string PoseXml(const Rigid& pose) {
  const Eigen::Quaterniond& q = pose.rotation;
  const Eigen::Vector3d& t = pose.translation;
  return Structure("pose", Structure("rotation", Float("w", q.w()) + Float("x", q.x()) +
                                                     Float("y", q.y()) + Float("z", q.z())) +
                               Structure("translation", Float("x", t.x()) + Float("y", t.y()) +
                                                            Float("z", t.z())));
}

// By content, so that the same input gives the same file.
std::string Guid(const ContentHash& content, int number) {
  std::string digits;
  for (const char half : {'a', 'b'}) {
    ContentHash hash = content;
    hash.Add(half + std::to_string(number));
    for (int shift = 60; shift >= 0; shift -= 4) {
      digits += "0123456789ABCDEF"[hash.Value() >> shift & 15];
    }
  }
  return "{" + digits.substr(0, 8) + "-" + digits.substr(8, 4) + "-" + digits.substr(12, 4) + "-" +
         digits.substr(16, 4) + "-" + digits.substr(20) + "}";
}

// The values of one field, packed bit by bit.
class BitColumn {
 public:
  // Whole numbers from minimum to maximum, that many units each.
  BitColumn(std::string name, int64_t minimum, int64_t maximum)
      : name_(std::move(name)), minimum_(minimum), maximum_(maximum) {
    for (auto range = static_cast<uint64_t>(maximum - minimum); range != 0; range >>= 1) {
      ++num_bits_;
    }
  }
  // Single floats.
  explicit BitColumn(std::string name) : name_(std::move(name)), num_bits_(32), is_float_(true) {}

  int num_bits() const { return num_bits_; }
  void Add(int64_t value) { AddBits(static_cast<uint64_t>(value - minimum_)); }
  void AddFloat(float value) {
    uint32_t bits;
    std::memcpy(&bits, &value, sizeof(bits));
    AddBits(bits);
  }
  // The bytes since the last call; a value that ends within a byte ends the stream.
  std::string Take() {
    if (num_pending_ > 0) bytes_ += static_cast<char>(pending_);
    pending_ = 0;
    num_pending_ = 0;
    return std::exchange(bytes_, std::string());
  }
  std::string Xml(bool is_length) const {
    if (is_float_) return Element(name_, "Float", "", " precision=\"single\"");
    const std::string range = " minimum=\"" + std::to_string(minimum_) + "\" maximum=\"" +
                              std::to_string(maximum_) + "\"";
    return is_length ? Element(name_, "ScaledInteger", "",
                               range + " scale=\"" + TextOf(kUnit) + "\" offset=\"0\"")
                     : Element(name_, "Integer", "", range);
  }

 private:
  void AddBits(uint64_t bits) {
    for (int left = num_bits_; left > 0;) {
      const int count = std::min(left, 8 - num_pending_);
      pending_ |= (bits & ((uint64_t{1} << count) - 1)) << num_pending_;
      num_pending_ += count;
      bits >>= count;
      left -= count;
      if (num_pending_ < 8) continue;
      bytes_ += static_cast<char>(pending_);
      pending_ = 0;
      num_pending_ = 0;
    }
  }

  std::string name_;
  int64_t minimum_ = 0, maximum_ = 0;
  int num_bits_ = 0;
  bool is_float_ = false;
  std::string bytes_;
  uint64_t pending_ = 0;
  int num_pending_ = 0;
};

// A scan as columns of bits: what is in it, and in which packets it goes.
class ScanColumns {
 public:
  ScanColumns(const Scan& scan, const CellColors* colors, const Rigid& station_from_scan)
      : scan_(scan), colors_(colors), station_from_scan_(station_from_scan) {
    FindBounds();
    const char* const kNames[] = {"cartesianX", "cartesianY", "cartesianZ"};
    for (int i = 0; i < 3; ++i) columns_.emplace_back(kNames[i], low_[i], high_[i]);
    columns_.emplace_back("intensity");
    if (colors != nullptr) {
      for (const char* name : {"colorRed", "colorGreen", "colorBlue"}) {
        columns_.emplace_back(name, 0, 255);
      }
    }
    if (scan.organised) {
      columns_.emplace_back("rowIndex", 0, scan.num_rows - 1);
      columns_.emplace_back("columnIndex", 0, scan.num_columns - 1);
    }
    header_size_ = 6 + 2 * columns_.size();
    size_t bits = 0;
    for (const BitColumn& column : columns_) bits += static_cast<size_t>(column.num_bits());
    // A multiple of 8 records ends all streams of a packet at whole bytes.
    records_per_packet_ =
        static_cast<int64_t>((kLargestPacket - header_size_ - 4) * 8 / bits) / 8 * 8;
  }

  int64_t num_records() const { return num_records_; }
  const ContentHash& content() const { return content_; }

  // Bytes of all packets together.
  uint64_t Size() const {
    const int64_t whole = num_records_ / records_per_packet_;
    const int64_t rest = num_records_ % records_per_packet_;
    return static_cast<uint64_t>(whole) * PacketSize(records_per_packet_) +
           (rest > 0 ? PacketSize(rest) : 0);
  }

  // Hands over packet after packet.
  template <typename Write>
  void ForEachPacket(const Write& write) {
    int64_t count = 0;
    for (int row = 0; row < scan_.num_rows; ++row) {
      for (int column = 0; column < scan_.num_columns; ++column) {
        if (scan_.IsMissing(scan_.Index(column, row))) continue;
        AddRecord(column, row);
        if (++count < records_per_packet_) continue;
        write(Packet());
        count = 0;
      }
    }
    if (count > 0) write(Packet());
  }

  std::string Prototype() const {
    std::string xml;
    for (size_t i = 0; i < columns_.size(); ++i) xml += columns_[i].Xml(i < 3);
    return xml;
  }

  std::string BoundsXml() const {
    std::string xml;
    const char* const kAxes[] = {"x", "y", "z"};
    for (int i = 0; i < 3; ++i) {
      xml += Float(std::string(kAxes[i]) + "Minimum", static_cast<double>(low_[i]) * kUnit) +
             Float(std::string(kAxes[i]) + "Maximum", static_cast<double>(high_[i]) * kUnit);
    }
    return Structure("cartesianBounds", xml);
  }

 private:
  Eigen::Matrix<int64_t, 3, 1> RawPoint(int cell) const {
    const Eigen::Vector3d point = station_from_scan_ * scan_.points[static_cast<size_t>(cell)];
    Eigen::Matrix<int64_t, 3, 1> raw;
    for (int i = 0; i < 3; ++i) {
      // Beyond a thousand times the Earth's way round nobody scans.
      raw[i] = std::llround(std::clamp(point[i] / kUnit, -4e16, 4e16));
    }
    return raw;
  }

  void FindBounds() {
    low_.setConstant(std::numeric_limits<int64_t>::max());
    high_.setConstant(std::numeric_limits<int64_t>::min());
    for (int cell = 0; cell < static_cast<int>(scan_.points.size()); ++cell) {
      if (scan_.IsMissing(cell)) continue;
      const Eigen::Matrix<int64_t, 3, 1> raw = RawPoint(cell);
      low_ = low_.cwiseMin(raw);
      high_ = high_.cwiseMax(raw);
      content_.Add({reinterpret_cast<const char*>(raw.data()), 3 * sizeof(int64_t)});
      ++num_records_;
    }
    if (num_records_ == 0) low_.setZero(), high_.setZero();
  }

  size_t PacketSize(int64_t num_records) const {
    size_t size = header_size_;
    for (const BitColumn& column : columns_) {
      size += (static_cast<size_t>(num_records) * static_cast<size_t>(column.num_bits()) + 7) / 8;
    }
    return (size + 3) / 4 * 4;
  }

  void AddRecord(int column, int row) {
    const int cell = scan_.Index(column, row);
    const Eigen::Matrix<int64_t, 3, 1> raw = RawPoint(cell);
    size_t k = 0;
    for (int i = 0; i < 3; ++i) columns_[k++].Add(raw[i]);
    columns_[k++].AddFloat(scan_.intensity[static_cast<size_t>(cell)]);
    for (int i = 0; i < 3 && colors_ != nullptr; ++i) {
      columns_[k++].Add((*colors_)[static_cast<size_t>(cell)][static_cast<size_t>(i)]);
    }
    if (!scan_.organised) return;
    columns_[k++].Add(row);
    columns_[k].Add(column);
  }

  std::string Packet() {
    std::string lengths, streams;
    for (BitColumn& column : columns_) {
      const std::string stream = column.Take();
      lengths += LittleEndianBytes(static_cast<uint16_t>(stream.size()));
      streams += stream;
    }
    const size_t size = header_size_ + streams.size(), padded = (size + 3) / 4 * 4;
    return std::string("\1\0", 2) + LittleEndianBytes(static_cast<uint16_t>(padded - 1)) +
           LittleEndianBytes(static_cast<uint16_t>(columns_.size())) + lengths + streams +
           std::string(padded - size, '\0');
  }

  const Scan& scan_;
  const CellColors* colors_;
  Rigid station_from_scan_;
  Eigen::Matrix<int64_t, 3, 1> low_, high_;
  int64_t num_records_ = 0, records_per_packet_ = 0;
  size_t header_size_ = 0;
  std::vector<BitColumn> columns_;
  ContentHash content_;
};

std::string LimitsXml(const Scan& scan, bool has_colors) {
  double offset = 0;
  const double divisor = IntensityDivisor(scan, &offset);
  std::string xml = Structure("intensityLimits", Float("intensityMinimum", offset) +
                                                     Float("intensityMaximum", offset + divisor));
  if (!has_colors) return xml;
  std::string colors;
  for (const char* name : {"colorRed", "colorGreen", "colorBlue"}) {
    colors +=
        Integer(name + std::string("Minimum"), 0) + Integer(name + std::string("Maximum"), 255);
  }
  return xml + Structure("colorLimits", colors);
}

std::string IndexBoundsXml(const Scan& scan) {
  return Structure("indexBounds", Integer("rowMinimum", 0) +
                                      Integer("rowMaximum", scan.num_rows - 1) +
                                      Integer("columnMinimum", 0) +
                                      Integer("columnMaximum", scan.num_columns - 1) +
                                      Integer("returnMinimum", 0) + Integer("returnMaximum", 0));
}

// The standard's camera from COLMAP's: pinhole pictures have y up and look along -z; the middle of
// a panorama looks along x, its left along y (see e57_images.cc).
Eigen::Quaterniond CamFromStandard(const Camera& camera) {
  if (!camera.IsPanorama()) return {0, 1, 0, 0};
  Eigen::Matrix3d rotation;
  rotation << 0, -1, 0,  //
      0, 0, -1,          //
      1, 0, 0;
  return Eigen::Quaterniond(rotation);
}

}  // namespace

E57Writer::E57Writer(const std::string& path) : output_(path) {
  Write(std::string(E57Pages::kHeaderSize, '\0'));
}

void E57Writer::Write(const char* bytes, size_t count) {
  while (count > 0) {
    const size_t now = std::min(count, kPayload - page_.size());
    page_.append(bytes, now);
    bytes += now, count -= now;
    if (page_.size() == kPayload) FlushPage();
  }
}

void E57Writer::FlushPage() {
  if (num_pages_ == 0) first_page_ = page_;
  const uint32_t crc = Crc32c(page_);
  for (const int shift : {24, 16, 8, 0}) page_ += static_cast<char>(crc >> shift);
  output_.stream().write(page_.data(), static_cast<std::streamsize>(page_.size()));
  page_.clear();
  ++num_pages_;
}

void E57Writer::Align() { Write(std::string((4 - page_.size() % 4) % 4, '\0')); }

uint64_t E57Writer::PhysicalOffset() const { return num_pages_ * kPageSize + page_.size(); }

void E57Writer::AddScan(const Scan& scan, const CellColors* colors) {
  if (stations_.empty()) {
    file_from_scan_ = RotationBetween(scan.up, Eigen::Vector3d::UnitZ());
  }
  // The station's frame is turned like the file's: there, too, z is up.
  const Rigid turned{file_from_scan_, Eigen::Vector3d::Zero()};
  const Rigid file_from_station = turned * scan.scan_from_station * turned.Inverse();
  ScanColumns columns(scan, colors, file_from_station.Inverse() * turned);
  Align();
  const uint64_t offset = PhysicalOffset();
  // The data begin right behind the header of 32 bytes, over a checksum if one lies between.
  const uint64_t in_page = offset % kPageSize + 32;
  const uint64_t data = offset + 32 + (in_page >= kPayload ? E57Pages::kChecksumSize : 0);
  Write(std::string("\1\0\0\0\0\0\0\0", 8) + LittleEndianBytes(uint64_t{32} + columns.Size()) +
        LittleEndianBytes(data) + LittleEndianBytes(uint64_t{0}));
  columns.ForEachPacket([this](const std::string& packet) { Write(packet); });

  const int number = static_cast<int>(stations_.size()) + 1;
  const std::string guid = Guid(columns.content(), number);
  const std::string name = scan.name.empty() ? "scan " + std::to_string(number) : scan.name;
  scans_xml_ += Structure(
      "vectorChild",
      Text("guid", guid) + Text("name", name) + PoseXml(file_from_station) +
          (scan.organised ? IndexBoundsXml(scan) : "") + LimitsXml(scan, colors != nullptr) +
          columns.BoundsXml() +
          Element("points", "CompressedVector",
                  "\n" + Structure("prototype", columns.Prototype()) +
                      Element("codecs", "Vector", "", " allowHeterogeneousChildren=\"1\""),
                  " fileOffset=\"" + std::to_string(offset) + "\" recordCount=\"" +
                      std::to_string(columns.num_records()) + "\""));
  stations_.push_back({guid, file_from_station.translation});
}

void E57Writer::AddPhoto(const Photo& photo) {
  Align();
  const uint64_t offset = PhysicalOffset();
  const size_t padding = (4 - photo.bytes.size() % 4) % 4;
  Write(std::string(8, '\0') +
        LittleEndianBytes(static_cast<uint64_t>(16 + photo.bytes.size() + padding)));
  Write(photo.bytes);
  Write(std::string(padding, '\0'));

  const Camera& camera = photo.camera;
  const bool is_png = photo.bytes.compare(0, 4, "\x89PNG") == 0;
  std::string xml = Element(is_png ? "pngImage" : "jpegImage", "Blob", "",
                            " fileOffset=\"" + std::to_string(offset) + "\" length=\"" +
                                std::to_string(photo.bytes.size()) + "\"") +
                    Integer("imageHeight", camera.height) + Integer("imageWidth", camera.width);
  if (camera.IsPanorama()) {
    xml += Float("pixelHeight", kPi / camera.height) + Float("pixelWidth", 2 * kPi / camera.width);
  } else {
    const bool one = camera.model == CameraModel::kSimplePinhole;
    const double fx = camera.params[0], fy = camera.params[one ? 0 : 1];
    xml += Float("focalLength", fx * kPixel) + Float("pixelHeight", fx * kPixel / fy) +
           Float("pixelWidth", kPixel) + Float("principalPointX", camera.params[one ? 1 : 2]) +
           Float("principalPointY", camera.params[one ? 2 : 3]);
  }
  const Rigid file_from_camera = Rigid{file_from_scan_, Eigen::Vector3d::Zero()} *
                                 photo.cam_from_scan.Inverse() *
                                 Rigid{CamFromStandard(camera), Eigen::Vector3d::Zero()};
  ContentHash content;
  content.Add(photo.bytes);
  const auto nearest =
      std::min_element(stations_.begin(), stations_.end(), [&](const Station& a, const Station& b) {
        return (a.place - file_from_camera.translation).norm() <
               (b.place - file_from_camera.translation).norm();
      });
  images_xml_ += Structure(
      "vectorChild",
      Text("guid", Guid(content, ++num_photos_)) + Text("name", photo.name) +
          (nearest != stations_.end() ? Text("associatedData3DGuid", nearest->guid) : "") +
          PoseXml(file_from_camera) +
          Structure(camera.IsPanorama() ? "sphericalRepresentation" : "pinholeRepresentation",
                    xml));
}

void E57Writer::Commit() {
  Align();
  const uint64_t xml_offset = PhysicalOffset();
  ContentHash all;
  all.Add(scans_xml_ + images_xml_);
  const std::string xml =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<e57Root type=\"Structure\" "
      "xmlns=\"http://www.astm.org/COMMIT/E57/2010-e57-v1.0\">\n" +
      Text("formatName", "ASTM E57 3D Imaging Data File") + Text("guid", Guid(all, 0)) +
      Integer("versionMajor", 1) + Integer("versionMinor", 0) +
      Text("e57LibraryVersion", std::string("roomtex ") + Version()) +
      Element("data3D", "Vector", "\n" + scans_xml_, " allowHeterogeneousChildren=\"1\"") +
      Element("images2D", "Vector", "\n" + images_xml_, " allowHeterogeneousChildren=\"1\"") +
      "</e57Root>\n";
  Write(xml);
  if (!page_.empty()) Write(std::string(kPayload - page_.size(), ' '));
  // What the header says is known now.
  page_ = first_page_;
  page_.replace(0, E57Pages::kHeaderSize,
                "ASTM-E57" + LittleEndianBytes(uint32_t{1}) + LittleEndianBytes(uint32_t{0}) +
                    LittleEndianBytes(num_pages_ * kPageSize) + LittleEndianBytes(xml_offset) +
                    LittleEndianBytes(static_cast<uint64_t>(xml.size())) +
                    LittleEndianBytes(static_cast<uint64_t>(kPageSize)));
  output_.stream().seekp(0);
  FlushPage();
  output_.Commit();
}

void WriteE57(const std::vector<Scan>& scans, const std::string& path) {
  E57Writer writer(path);
  for (const Scan& scan : scans) writer.AddScan(scan, scan.colors.empty() ? nullptr : &scan.colors);
  writer.Commit();
}

}  // namespace roomtex
