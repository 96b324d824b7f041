// An own reader, because pcl::PLYReader (1.13) does not tell bad files from good ones. Measured on
// 96 damaged files (cut off, wrong counts, indices and types, trailing bytes; ascii and both byte
// orders): it refused 72, ended the program on 9 (negative counts, and counts of a billion under a
// limit of 6 GB) and read 15 as good, some with faces that name vertices the mesh does not have.

#include "importers/ply.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <sstream>
#include <string_view>

#include "core/error.h"
#include "core/output_file.h"
#include "core/resource_limits.h"
#include "core/text.h"
#include "importers/file_reader.h"
#include "importers/mesh_scan.h"
#include "importers/ply_header.h"

namespace roomtex {
namespace {

// Words of the comments in which our writers say more of a scan than PLY has properties for.
constexpr char kCommentOwner[] = "roomtex", kUpComment[] = "up", kStationComment[] = "station";

std::string VectorComment(const char* what, const Eigen::Vector3d& v) {
  return std::string("comment ") + kCommentOwner + " " + what + " " + Exact(v[0]) + " " +
         Exact(v[1]) + " " + Exact(v[2]) + "\n";
}

// The values of the body one after the other.
class ValueSource {
 public:
  virtual ~ValueSource() = default;
  virtual void BeginEntry() = 0;
  virtual double Next(PlyType type) = 0;
  virtual void EndEntry() = 0;
  virtual void EndFile() = 0;
  virtual int64_t BytesLeft() const = 0;
  virtual std::string Position() const = 0;  // of the entry read last
};

class AsciiSource : public ValueSource {
 public:
  AsciiSource(const FileReader& file, const PlyHeader& header)
      : path_(file.path()), lines_(file, header.body_offset), header_lines_(header.num_lines) {}

  void BeginEntry() override {
    do {
      if (!lines_.Next(&rest_)) {
        throw InputError(path_, LinePosition(header_lines_ + lines_.line_number() + 1),
                         "the file ends, expected another line of numbers",
                         "The file is cut off: copy it again");
      }
      line_ = rest_;
      SkipBlanks();
    } while (rest_.empty());
  }
  double Next(PlyType) override {
    SkipBlanks();
    const size_t size = std::min(rest_.find_first_of(" \t"), rest_.size());
    double value = 0;
    if (!ParseReal(rest_.substr(0, size), &value)) {
      throw InputError(path_, Position(),
                       "is " + Quoted(line_) + ", which lacks a number or holds something else",
                       kDamaged);
    }
    rest_.remove_prefix(size);
    return value;
  }
  void EndEntry() override {
    SkipBlanks();
    if (!rest_.empty()) {
      throw InputError(path_, Position(),
                       "is " + Quoted(line_) +
                           ", which has more numbers than the "
                           "header says",
                       kDamaged);
    }
  }
  void EndFile() override {
    std::string_view line;
    while (lines_.Next(&line)) {
      if (line.find_first_not_of(" \t") != std::string_view::npos) {
        throw InputError(path_, Position(), "is " + Quoted(line) + ", expected the end of the file",
                         kDamaged);
      }
    }
  }
  int64_t BytesLeft() const override {
    return lines_.BytesLeft() + static_cast<int64_t>(rest_.size());
  }
  std::string Position() const override {
    return LinePosition(header_lines_ + lines_.line_number());
  }

 private:
  void SkipBlanks() { rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t"), rest_.size())); }

  std::string path_;
  LineReader lines_;
  long header_lines_;
  std::string_view line_, rest_;
};

class BinarySource : public ValueSource {
 public:
  BinarySource(const FileReader& file, const PlyHeader& header)
      : file_(file), swap_(header.format == "big"), block_offset_(header.body_offset) {}

  void BeginEntry() override { entry_offset_ = Offset(); }
  double Next(PlyType type) override {
    const size_t size = static_cast<size_t>(PlyTypeSize(type));
    if (end_ - begin_ < size) Refill(size);
    char bytes[8];
    std::memcpy(bytes, block_.data() + begin_, size);
    if (swap_) std::reverse(bytes, bytes + size);
    begin_ += size;
    const auto as = [&bytes](auto value) {
      std::memcpy(&value, bytes, sizeof(value));
      return static_cast<double>(value);
    };
    switch (type) {
      case PlyType::kInt8:
        return as(int8_t{});
      case PlyType::kUint8:
        return as(uint8_t{});
      case PlyType::kInt16:
        return as(int16_t{});
      case PlyType::kUint16:
        return as(uint16_t{});
      case PlyType::kInt32:
        return as(int32_t{});
      case PlyType::kUint32:
        return as(uint32_t{});
      case PlyType::kFloat:
        return as(float{});
      default:
        return as(double{});
    }
  }
  void EndEntry() override {}
  void EndFile() override {
    if (BytesLeft() == 0) return;
    throw InputError(file_.path(), BytePosition(Offset()),
                     std::to_string(BytesLeft()) +
                         " bytes follow the last element, expected the end "
                         "of the file",
                     kDamaged);
  }
  int64_t BytesLeft() const override { return file_.size() - Offset(); }
  std::string Position() const override { return BytePosition(entry_offset_); }

 private:
  int64_t Offset() const { return block_offset_ + static_cast<int64_t>(begin_); }
  void Refill(size_t wanted) {
    const int64_t offset = Offset();
    if (BytesLeft() < static_cast<int64_t>(wanted)) {
      throw InputError(file_.path(), BytePosition(file_.size()), "the file ends within the data",
                       "The file is cut off: copy it again");
    }
    block_ = file_.ReadSome(offset, 1 << 20);
    block_offset_ = offset;
    begin_ = 0;
    end_ = block_.size();
  }

  const FileReader& file_;
  bool swap_;
  std::string block_;
  size_t begin_ = 0, end_ = 0;
  int64_t block_offset_ = 0, entry_offset_ = 0;
};

class PlyParser {
 public:
  // wanted: may be null.
  PlyParser(const FileReader& file, const PlyHeader& header, const PlyOptions& options,
            PlyVertexValues* wanted, PlyVisitor* visitor)
      : file_(file), header_(header), options_(options), wanted_(wanted), visitor_(*visitor) {
    if (header.format == "ascii") {
      source_ = std::make_unique<AsciiSource>(file, header);
    } else {
      source_ = std::make_unique<BinarySource>(file, header);
    }
  }

  void Parse() {
    CheckElements();
    ReadComments();
    FindProperties();
    visitor_.Begin(facts_);
    for (const PlyElement& element : header_.elements) {
      if (element.properties.empty()) continue;
      if (&element == vertex_) {
        ReadVertices();
      } else if (&element == face_) {
        ReadFaces();
      } else {
        for (int64_t i = 0; i < element.count; ++i) SkipEntry(element);
      }
    }
    source_->EndFile();
  }

 private:
  bool HasFaces() const { return face_ != nullptr && face_->count > 0; }

  void CheckElements() {
    for (const PlyElement& element : header_.elements) {
      const bool is_vertex = element.name == "vertex", is_face = element.name == "face";
      const PlyElement*& known = is_vertex ? vertex_ : face_;
      if (!is_vertex && !is_face) continue;
      if (known != nullptr) {
        throw InputError(file_.path(), LinePosition(element.line),
                         "is a second element " + element.name, kDamaged);
      }
      known = &element;
    }
    if (vertex_ == nullptr) throw InputError(file_.path(), "", "has no element vertex", kDamaged);
    for (int k = 0; k < 3; ++k) {
      const std::string name(1, "xyz"[k]);
      coordinate_[k] = vertex_->Find({name});
      if (coordinate_[k] < 0 || vertex_->properties[coordinate_[k]].is_list) {
        throw InputError(file_.path(), LinePosition(vertex_->line),
                         "the vertices have no property " + name, kDamaged);
      }
    }
    const bool has_strips =
        std::any_of(header_.elements.begin(), header_.elements.end(),
                    [](const PlyElement& e) { return e.name == "tristrips" && e.count > 0; });
    if (!HasFaces() && has_strips) {
      throw InputError(file_.path(), "",
                       "has its triangles as strips (tristrips), which are not read",
                       "Write it again with faces, by MeshLab or CloudCompare for example");
    }
    if (!HasFaces() && !options_.clouds) {
      throw InputError(
          file_.path(), "",
          "is a point cloud of " + std::to_string(vertex_->count) +
              " points without faces, expected a triangle mesh",
          "Triangulate it, or give the scan with its grid (RTPI, PTX or organised PCD)");
    }
    if (HasFaces()) list_ = face_->Find({"vertex_indices", "vertex_index"});
    if (HasFaces() && (list_ < 0 || !face_->properties[list_].is_list)) {
      throw InputError(file_.path(), LinePosition(face_->line),
                       "the faces have no list vertex_indices", kDamaged);
    }
    if (vertex_->count > std::numeric_limits<int>::max()) {
      throw InputError(file_.path(), LinePosition(vertex_->line), "says more than 2^31 vertices",
                       "Divide the mesh");
    }
  }

  // What our own writers say about the scan: VectorComment().
  void ReadComments() {
    for (const std::string& comment : header_.comments) {
      std::istringstream words(comment);
      std::string who, what;
      Eigen::Vector3d v;
      if (!(words >> who >> what >> v[0] >> v[1] >> v[2]) || who != kCommentOwner || !v.allFinite())
        continue;
      if (what == kUpComment && v.norm() > 0.5) {
        facts_.up = v.normalized();
        facts_.up_is_assumed = false;
      }
      if (what == kStationComment) {
        facts_.station = options_.meters_per_unit * v;
        facts_.station_is_assumed = false;
      }
    }
  }

  double ListCount(const PlyProperty& property) {
    const double count = source_->Next(property.count_type);
    const int64_t smallest = header_.format == "ascii" ? 1 : PlyTypeSize(property.type);
    if (!(count >= 0) || count != std::floor(count) ||
        count * static_cast<double>(smallest) > static_cast<double>(source_->BytesLeft())) {
      throw InputError(file_.path(), source_->Position(),
                       "a list of " +
                           std::to_string(static_cast<int64_t>(std::clamp(count, -1e15, 1e15))) +
                           " items does not fit into the rest of the file",
                       kDamaged);
    }
    return count;
  }

  void SkipProperty(const PlyProperty& property) {
    const double count = property.is_list ? ListCount(property) : 1;
    for (double i = 0; i < count; ++i) source_->Next(property.type);
  }

  void SkipEntry(const PlyElement& element) {
    source_->BeginEntry();
    for (const PlyProperty& property : element.properties) SkipProperty(property);
    source_->EndEntry();
  }

  // Where the values of each vertex property go; null = nowhere.
  std::vector<std::vector<float>*> WantedByProperty() {
    std::vector<std::vector<float>*> targets(vertex_->properties.size(), nullptr);
    if (wanted_ == nullptr) return targets;
    wanted_->values.assign(wanted_->names.size(), {});
    for (size_t i = 0; i < wanted_->names.size(); ++i) {
      const int property = vertex_->Find({wanted_->names[i]});
      if (property < 0 || vertex_->properties[property].is_list) continue;
      targets[property] = &wanted_->values[i];
      wanted_->values[i].reserve(static_cast<size_t>(vertex_->count));
    }
    return targets;
  }

  // Three properties of the vertices that go together.
  struct Triple {
    int property[3] = {-1, -1, -1};
    bool found = false;
  };
  Triple FindTriple(const std::vector<std::vector<std::string>>& names) const {
    Triple triple;
    for (int k = 0; k < 3; ++k) {
      triple.property[k] = vertex_->Find(names[static_cast<size_t>(k)]);
      if (triple.property[k] < 0 || vertex_->properties[triple.property[k]].is_list) return {};
    }
    triple.found = true;
    return triple;
  }
  // Floats may go to 1, bytes go to 255.
  double ColorScaleOf(const Triple& color) const {
    if (!color.found) return 255;
    switch (vertex_->properties[color.property[0]].type) {
      case PlyType::kFloat:
      case PlyType::kDouble:
        return 1;
      case PlyType::kUint16:
      case PlyType::kInt16:
        return 65535;
      default:
        return 255;
    }
  }

  void FindProperties() {
    intensity_ = vertex_->Find({"intensity", "scalar_intensity", "scalar_Intensity"});
    color_ = FindTriple({{"red", "r", "diffuse_red"},
                         {"green", "g", "diffuse_green"},
                         {"blue", "b", "diffuse_blue"}});
    if (!HasFaces()) {
      normal_ = FindTriple({{"nx", "normal_x"}, {"ny", "normal_y"}, {"nz", "normal_z"}});
    }
    facts_.num_vertices = static_cast<size_t>(vertex_->count);
    facts_.num_faces = HasFaces() ? static_cast<size_t>(face_->count) : 0;
    facts_.has_intensity = intensity_ >= 0;
    facts_.has_color = color_.found;
    facts_.has_normal = normal_.found;
    facts_.color_scale = ColorScaleOf(color_);
  }

  void ReadVertices() {
    const std::vector<std::vector<float>*> wanted = WantedByProperty();
    for (int64_t i = 0; i < vertex_->count; ++i) {
      PlyVertex vertex;
      source_->BeginEntry();
      for (int p = 0; p < static_cast<int>(vertex_->properties.size()); ++p) {
        const PlyProperty& property = vertex_->properties[p];
        if (property.is_list) {
          SkipProperty(property);
          continue;
        }
        const double value = source_->Next(property.type);
        for (int k = 0; k < 3; ++k) {
          if (p == coordinate_[k]) vertex.point[k] = options_.meters_per_unit * value;
          if (p == color_.property[k]) vertex.color[k] = value;
          if (p == normal_.property[k]) vertex.normal[k] = value;
        }
        if (p == intensity_) vertex.intensity = value;
        if (wanted[p] != nullptr) wanted[p]->push_back(static_cast<float>(value));
      }
      source_->EndEntry();
      visitor_.Vertex(vertex);
    }
  }

  void ReadFaces() {
    for (int64_t i = 0; i < face_->count; ++i) {
      source_->BeginEntry();
      for (int p = 0; p < static_cast<int>(face_->properties.size()); ++p) {
        const PlyProperty& property = face_->properties[p];
        if (p == list_) {
          ReadPolygon(property);
        } else {
          SkipProperty(property);
        }
      }
      source_->EndEntry();
    }
  }

  void ReadPolygon(const PlyProperty& property) {
    const double count = ListCount(property);
    if (count < 3) {  // no program writes these; they are what shifted data look like
      throw InputError(
          file_.path(), source_->Position(),
          "a face has " + std::to_string(static_cast<int>(count)) + " corners, expected at least 3",
          kDamaged);
    }
    Triangle fan = {0, 0, 0};
    for (double k = 0; k < count; ++k) {
      const double index = source_->Next(property.type);
      if (!(index >= 0) || !(index < static_cast<double>(vertex_->count)) ||
          index != std::floor(index)) {
        throw InputError(
            file_.path(), source_->Position(),
            "a face names a vertex that is none of the " + std::to_string(vertex_->count),
            kDamaged);
      }
      fan[k < 2 ? static_cast<int>(k) : 2] = static_cast<int>(index);
      if (k < 2) continue;
      if (fan[0] != fan[1] && fan[1] != fan[2] && fan[0] != fan[2]) visitor_.Face(fan);
      fan[1] = fan[2];
    }
  }

  const FileReader& file_;
  const PlyHeader& header_;
  PlyOptions options_;
  PlyVertexValues* wanted_;
  PlyVisitor& visitor_;
  PlyFacts facts_;
  std::unique_ptr<ValueSource> source_;
  const PlyElement* vertex_ = nullptr;
  const PlyElement* face_ = nullptr;
  int coordinate_[3] = {-1, -1, -1};
  int list_ = -1, intensity_ = -1;
  Triple color_, normal_;
};

// All of it as a scan.
class ScanMaker : public PlyVisitor {
 public:
  ScanMaker(const std::string& path, const PlyOptions& options) : path_(path), options_(options) {}

  void Begin(const PlyFacts& facts) override {
    facts_ = facts;
    scan_.up = facts.up;
    scan_.up_is_assumed = facts.up_is_assumed;
    scan_.scan_from_station.translation = facts.station;
    scan_.station_is_assumed = facts.station_is_assumed;
    color_scale_ = ColorScale(facts.color_scale);
    RequireMemoryForSamples(path_, static_cast<double>(facts.num_vertices));
    scan_.points.reserve(facts.num_vertices);
    scan_.intensity.reserve(facts.num_vertices);
    if (KeepsColors()) scan_.colors.reserve(facts.num_vertices);
    if (facts.has_normal) scan_.normals.reserve(facts.num_vertices);
  }
  void Vertex(const PlyVertex& vertex) override {
    const bool is_grey = options_.grey_as_intensity && facts_.has_color && !facts_.has_intensity;
    const double intensity = is_grey ? GreyOf(vertex.color) : vertex.intensity;
    if (KeepsColors()) scan_.colors.push_back(color_scale_.Bytes(vertex.color, &scan_.colors));
    if (facts_.has_normal) scan_.normals.emplace_back(vertex.normal.cast<float>());
    scan_.points.push_back(vertex.point);
    scan_.intensity.push_back(std::isfinite(intensity) ? static_cast<float>(intensity) : 0.0f);
  }
  void Face(const Triangle& triangle) override { scan_.triangles.push_back(triangle); }

  // Points that are not finite or too far are missing, and so are the triangles at them.
  Scan Finish() {
    (facts_.num_faces > 0 ? FinishMesh : FinishCloud)(path_, options_.max_range, &scan_);
    return std::move(scan_);
  }

 private:
  bool KeepsColors() const { return facts_.has_color && options_.colors; }

  const std::string path_;
  const PlyOptions options_;
  PlyFacts facts_;
  ColorScale color_scale_{255};
  Scan scan_;
};

void AppendVertices(const Scan& scan, bool as_double, bool has_colors, std::ostream& stream) {
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (scan.IsMissing(static_cast<int>(i))) continue;
    if (as_double) {
      stream.write(reinterpret_cast<const char*>(scan.points[i].data()), 3 * sizeof(double));
    } else {
      const Eigen::Vector3f point = scan.points[i].cast<float>();
      stream.write(reinterpret_cast<const char*>(point.data()), 3 * sizeof(float));
    }
    stream.write(reinterpret_cast<const char*>(&scan.intensity[i]), sizeof(float));
    if (!has_colors) continue;
    const std::array<uint8_t, 3> color =
        scan.colors.empty() ? std::array<uint8_t, 3>{0, 0, 0} : scan.colors[i];
    stream.write(reinterpret_cast<const char*>(color.data()), 3);
  }
}

// Vertex numbers count measured samples only. Gives the number of the scan's vertices.
int AppendFaces(const PlyPart& part, int first_vertex, std::ostream& stream) {
  std::vector<int> vertex_of_sample(part.scan->points.size(), -1);
  int next = first_vertex;
  for (size_t i = 0; i < vertex_of_sample.size(); ++i) {
    if (!part.scan->IsMissing(static_cast<int>(i))) vertex_of_sample[i] = next++;
  }
  const char three = 3;
  for (const Triangle& triangle : *part.triangles) {
    const int32_t face[3] = {vertex_of_sample[triangle[0]], vertex_of_sample[triangle[1]],
                             vertex_of_sample[triangle[2]]};
    stream.write(&three, 1);
    stream.write(reinterpret_cast<const char*>(face), sizeof(face));
  }
  return next - first_vertex;
}

}  // namespace

Scan ReadPly(const std::string& path, const PlyOptions& options, std::string* format,
             PlyVertexValues* values) {
  const FileReader file(path);
  const PlyHeader header = ReadPlyHeader(file);
  if (format != nullptr) *format = header.format;
  ScanMaker maker(path, options);
  PlyParser(file, header, options, values, &maker).Parse();
  return maker.Finish();
}

void VisitPly(const std::string& path, const PlyOptions& options, PlyVisitor* visitor) {
  const FileReader file(path);
  const PlyHeader header = ReadPlyHeader(file);
  PlyParser(file, header, options, nullptr, visitor).Parse();
}

std::string PlyUpComment(const Scan& scan) { return VectorComment(kUpComment, scan.up); }
std::string PlyStationComment(const Scan& scan) {
  return VectorComment(kStationComment, scan.Station());
}

void WritePly(const std::vector<PlyPart>& parts, const std::string& path) {
  size_t num_vertices = 0, num_faces = 0;
  bool as_double = false, has_colors = false;
  for (const PlyPart& part : parts) {
    has_colors = has_colors || !part.scan->colors.empty();
    num_vertices += part.scan->points.size() - static_cast<size_t>(part.scan->NumMissing());
    num_faces += part.triangles->size();
    as_double = as_double || NeedsDouble(*part.scan);
  }
  OutputFile output(path);
  std::ostream& stream = output.stream();
  stream.precision(17);
  stream << "ply\nformat binary_little_endian 1.0\n";
  if (!parts.empty()) {
    const Scan& scan = *parts.front().scan;
    stream << PlyUpComment(scan);
    if (!scan.station_is_assumed) stream << PlyStationComment(scan);
  }
  const char* const type = as_double ? "double" : "float";
  stream << "element vertex " << num_vertices << '\n';
  for (const char axis : {'x', 'y', 'z'}) stream << "property " << type << ' ' << axis << '\n';
  stream << "property float intensity\n";
  for (const char* name : {"red", "green", "blue"}) {
    if (has_colors) stream << "property uchar " << name << '\n';
  }
  stream << "element face " << num_faces
         << "\nproperty list uchar int vertex_indices\nend_header\n";
  for (const PlyPart& part : parts) AppendVertices(*part.scan, as_double, has_colors, stream);
  int first_vertex = 0;
  for (const PlyPart& part : parts) first_vertex += AppendFaces(part, first_vertex, stream);
  output.Commit();
}

}  // namespace roomtex
