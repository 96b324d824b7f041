#include "texture/output/write_ply.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "core/output_file.h"
#include "core/scan_mesh.h"
#include "importers/ply.h"

namespace roomtex {
namespace {

// Gathers bytes and hands them on in large pieces.
class ByteSink {
 public:
  explicit ByteSink(std::ostream* stream) : stream_(stream) { bytes_.reserve(kPiece + 64); }
  ~ByteSink() { Flush(); }

  template <typename T>
  void Put(T value) {  // little-endian, as this machine
    const auto* raw = reinterpret_cast<const char*>(&value);
    bytes_.insert(bytes_.end(), raw, raw + sizeof value);
  }
  void EndOfRecord() {
    if (bytes_.size() >= kPiece) Flush();
  }
  void Flush() {
    stream_->write(bytes_.data(), static_cast<std::streamsize>(bytes_.size()));
    bytes_.clear();
  }

 private:
  static constexpr size_t kPiece = 1 << 20;
  std::ostream* stream_;
  std::vector<char> bytes_;
};

std::string CommentsOf(const std::vector<Scan>& scans) {
  return scans.empty() ? "" : PlyUpComment(scans[0]) + PlyStationComment(scans[0]);
}

}  // namespace

bool NeedsDoubleCoordinates(const std::vector<Scan>& scans) {
  return std::any_of(scans.begin(), scans.end(), NeedsDouble);
}

void WriteColoredPly(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                     const std::string& path, bool with_normals) {
  size_t num_vertices = 0, num_faces = 0;
  for (size_t s = 0; s < scans.size(); ++s) {
    num_vertices += scans[s].points.size() - scans[s].NumMissing();
    num_faces += colored[s].triangles.size();
  }
  const bool as_double = NeedsDoubleCoordinates(scans);
  const std::string type = as_double ? "double" : "float";
  OutputFile file(path);
  file.stream() << "ply\nformat binary_little_endian 1.0\ncomment roomtex-texture: scan frame, "
                   "metres; views = photos that see the vertex\n"
                << CommentsOf(scans) << "element vertex " << num_vertices << "\nproperty " << type
                << " x\nproperty " << type << " y\nproperty " << type << " z\nproperty uchar red\n"
                << "property uchar green\nproperty uchar blue\nproperty uchar views\n"
                << (with_normals ? "property float nx\nproperty float ny\nproperty float nz\n" : "")
                << "element face " << num_faces
                << "\nproperty list uchar int vertex_indices\nend_header\n";
  {
    ByteSink sink(&file.stream());
    std::vector<std::vector<int>> vertex_of(scans.size());
    int next = 0;
    for (size_t s = 0; s < scans.size(); ++s) {
      const Scan& scan = scans[s];
      vertex_of[s].assign(scan.points.size(), -1);
      std::vector<Eigen::Vector3f> normals;
      if (with_normals) normals = VertexNormals(scan, colored[s].triangles);
      for (size_t i = 0; i < scan.points.size(); ++i) {
        if (scan.IsMissing(static_cast<int>(i))) continue;
        vertex_of[s][i] = next++;
        for (int k = 0; k < 3; ++k) {
          as_double ? sink.Put(scan.points[i][k]) : sink.Put(static_cast<float>(scan.points[i][k]));
        }
        for (uint8_t value : colored[s].samples.rgb[i]) sink.Put(value);
        sink.Put(colored[s].samples.views[i]);
        for (int k = 0; with_normals && k < 3; ++k) sink.Put(normals[i][k]);
        sink.EndOfRecord();
      }
    }
    for (size_t s = 0; s < scans.size(); ++s) {
      for (const Triangle& t : colored[s].triangles) {
        sink.Put(uint8_t{3});
        for (int corner : t) sink.Put(static_cast<int32_t>(vertex_of[s][corner]));
        sink.EndOfRecord();
      }
    }
  }
  file.Commit();
}

}  // namespace roomtex
