#pragma once
// PLY triangle meshes.

#include <string>
#include <vector>

#include "core/scan.h"

namespace roomtex {

struct PlyOptions {
  double meters_per_unit = 1;
  // Metres from the origin, or from the station that our own files name; 0 = no limit.
  double max_range = 0;
  // Also files without faces, which are refused otherwise.
  bool clouds = false;
  bool colors = false;  // keep them (Scan::colors)
  // The intensity of vertices without one is the grey of their colours.
  bool grey_as_intensity = false;
};

// Values of vertex properties that ReadPly itself has no use for, e.g. colours.
struct PlyVertexValues {
  std::vector<std::string> names;
  // Per name one value per vertex, as in the file; empty if the file has no such property.
  std::vector<std::vector<float>> values;
};

// Reads ascii and binary files of both byte orders: vertices x, y, z and, if there, intensity
// (also scalar_intensity, CloudCompare's name), faces of any size as fans of triangles, where
// there are none strips of triangles (tristrips); of clouds the normals nx, ny, nz. Other elements
// and properties are skipped. The scan is not organised;
// `up` and station come from our own files' comments, otherwise z and the origin. Throws InputError
// with line or byte; a cloud without faces is refused, or one of Scan::Kind::kCloud. format:
// "ascii", "little" or "big" endian; may be null. values: what else is wanted of the vertices; may
// be null.
Scan ReadPly(const std::string& path, const PlyOptions& options, std::string* format = nullptr,
             PlyVertexValues* values = nullptr);

// The same for those who do not hold all of it: what the file says, one after the other.
struct PlyFacts {
  size_t num_vertices = 0, num_faces = 0;  // faces or lists of strips: 0 = a cloud
  bool has_intensity = false, has_color = false, has_normal = false;
  double color_scale = 255;  // of the colours' type: 1, 255 or 65535 (ColorScale)
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ(), station = Eigen::Vector3d::Zero();
  bool up_is_assumed = true, station_is_assumed = true;
};
struct PlyVertex {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  // metres, `scan` frame; as it is, also NaN
  double intensity = 0;
  // As in the file.
  Eigen::Vector3d color = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
};
class PlyVisitor {
 public:
  virtual ~PlyVisitor() = default;
  virtual void Begin(const PlyFacts& facts) = 0;
  virtual void Vertex(const PlyVertex& vertex) = 0;
  // Each triangle of a fan or strip; its corners are indices of vertices, which may come later.
  virtual void Face(const Triangle& triangle) = 0;
};
void VisitPly(const std::string& path, const PlyOptions& options, PlyVisitor* visitor);

// What ReadPly wants to know of a scan, as lines of a header: "comment roomtex up 0 0 1\n".
std::string PlyUpComment(const Scan& scan);
std::string PlyStationComment(const Scan& scan);

// Binary little-endian: vertex x, y, z (float; double beyond kLargeCoordinate), intensity
// float, red, green, blue uchar where a scan has colours; faces. triangles index scan.points;
// missing samples are left out. Several scans become one mesh.
struct PlyPart {
  const Scan* scan;
  const std::vector<Triangle>* triangles;
};
void WritePly(const std::vector<PlyPart>& parts, const std::string& path);

}  // namespace roomtex
