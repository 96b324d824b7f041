#include "texture/output/evidence.h"

#include <cstring>

#include "core/error.h"
#include "core/output_file.h"
#include "importers/file_reader.h"
#include "importers/ply_header.h"
#include "texture/output/write_ply.h"

namespace roomtex {
namespace {

const char kRemedy[] = "Run roomtex-texture again";

template <typename T>
void Append(const T& value, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof value);
}

// Whether the header is that of WriteEvidence.
bool IsEvidence(const PlyHeader& header) {
  static const char* const kNames[] = {"x", "y", "z", "intensity", "views", "disagreement"};
  if (header.format != "little" || header.elements.size() != 1) return false;
  const std::vector<PlyProperty>& properties = header.elements[0].properties;
  if (header.elements[0].name != "vertex" || properties.size() != 6) return false;
  for (size_t i = 0; i < 6; ++i) {
    const PlyType type = i == 4 ? PlyType::kUint8 : PlyType::kFloat;
    const bool is_coordinate =
        i < 3 && properties[i].type == PlyType::kDouble && properties[0].type == PlyType::kDouble;
    if (properties[i].is_list || properties[i].name != kNames[i] ||
        (properties[i].type != type && !is_coordinate)) {
      return false;
    }
  }
  return true;
}

}  // namespace

void WriteEvidence(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                   const std::string& path) {
  size_t count = 0;
  for (const Scan& scan : scans) count += scan.points.size() - scan.NumMissing();
  const bool as_double = NeedsDoubleCoordinates(scans);
  const std::string type = as_double ? "double" : "float";
  OutputFile file(path);
  file.stream() << "ply\nformat binary_little_endian 1.0\ncomment roomtex-texture: the vertices of "
                   "model.ply in their order, scan frame, metres\ncomment disagreement: mean "
                   "absolute colour difference between the photos, 0-255; NaN = fewer than two\n"
                << "element vertex " << count << "\nproperty " << type << " x\nproperty " << type
                << " y\nproperty " << type
                << " z\nproperty float intensity\nproperty uchar views\n"
                   "property float disagreement\nend_header\n";
  std::string bytes;
  for (size_t s = 0; s < scans.size(); ++s) {
    const Scan& scan = scans[s];
    for (size_t i = 0; i < scan.points.size(); ++i) {
      if (scan.IsMissing(static_cast<int>(i))) continue;
      for (int k = 0; k < 3; ++k) {
        as_double ? Append(scan.points[i][k], &bytes)
                  : Append(static_cast<float>(scan.points[i][k]), &bytes);
      }
      Append(scan.intensity[i], &bytes);
      Append(colored[s].samples.views[i], &bytes);
      Append(colored[s].disagreement[i], &bytes);
      if (bytes.size() < (1u << 20)) continue;
      file.stream().write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
      bytes.clear();
    }
  }
  file.stream().write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.Commit();
}

Evidence ReadEvidence(const std::string& path) {
  const FileReader file(path);
  const PlyHeader header = ReadPlyHeader(file);
  if (!IsEvidence(header)) {
    throw InputError(path, "", "is not the evidence that roomtex-texture writes", kRemedy);
  }
  const bool as_double = header.elements[0].properties[0].type == PlyType::kDouble;
  const size_t point_size = as_double ? 24 : 12, stride = point_size + 9;
  const auto count = static_cast<size_t>(header.elements[0].count);
  if (count != static_cast<size_t>(file.size() - header.body_offset) / stride) {
    throw InputError(path, "", "holds another number of points than its header says", kRemedy);
  }
  std::string bytes(count * stride, '\0');
  file.Read(header.body_offset, bytes.data(), static_cast<int64_t>(bytes.size()));
  Evidence evidence;
  evidence.points.resize(count);
  evidence.intensity.resize(count);
  evidence.views.resize(count);
  evidence.disagreement.resize(count);
  for (size_t i = 0; i < count; ++i) {
    const char* at = bytes.data() + i * stride;
    if (as_double) {
      std::memcpy(evidence.points[i].data(), at, 24);
    } else {
      Eigen::Vector3f point;
      std::memcpy(point.data(), at, 12);
      evidence.points[i] = point.cast<double>();
    }
    std::memcpy(&evidence.intensity[i], at + point_size, 4);
    std::memcpy(&evidence.views[i], at + point_size + 4, 1);
    std::memcpy(&evidence.disagreement[i], at + point_size + 5, 4);
  }
  return evidence;
}

}  // namespace roomtex
