#pragma once
// A large mesh in pieces that a browser takes one by one: near pieces whole, far ones coarse
// (levels of detail, by meshoptimizer's quadric error: Garland and Heckbert 1997, "Surface
// Simplification Using Quadric Error Metrics"). Whole pieces lie on disk.

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "texture/view/view_model.h"
#include "texture/view/view_spool.h"

namespace roomtex {

struct ViewChunkOptions {
  int max_triangles = 1 << 16;  // of a chunk
  int max_vertices = 65535;     // so that indices fit into 16 bits
  // Triangles that are simplified together. Their border is kept, so that neighbours of any level
  // fit; and the coarse triangles stay so small that the texture does not swim on them.
  int patch_triangles = 2048;
  // The levels below the whole: share of the triangles that each aims at, and metres that it may be
  // off by meshoptimizer's measure, a mean over the neighbourhood; nothing is off by more than six
  // times that (tested).
  double coarse_share = 1.0 / 16, coarse_error = 0.01;
  double middle_share = 1.0 / 4, middle_error = 0.0025;
};

// Triangles of one image that lie close together.
struct ViewChunk {
  int page = -1;  // index into ViewModel::images; -1 = colours of the points
  bool is_supplement = false;
  size_t num_triangles = 0;
  int num_vertices = 0;
  // Box, relative to ViewModel::origin.
  Eigen::Vector3f low = Eigen::Vector3f::Zero(), high = Eigen::Vector3f::Zero();
  float spacing = 0;           // metres, a typical edge of its triangles
  ViewSpool::Piece full = {};  // the whole of it
};

class ViewChunks {
 public:
  enum Level { kCoarse = 0, kMiddle = 1, kFull = 2 };

  // Cuts the mesh, puts its pieces aside and frees the model's arrays; coarser levels are made when
  // asked for. Once `stop` says so it is given up; the chunks are then of no use. Throws InputError
  // if the disk is full.
  explicit ViewChunks(
      ViewModel model, const ViewChunkOptions& options = {}, int num_threads = 1,
      const std::function<bool()>& stop = [] { return false; });

  const std::vector<ViewChunk>& chunks() const { return chunks_; }

  // Points of a chunk, relative to ViewModel::origin, and its triangles: three indices into them
  // each.
  struct Mesh {
    std::vector<Eigen::Vector3f> points;
    std::vector<uint16_t> corners;
  };
  Mesh Read(int chunk) const;
  // What each of its points shows, relative to ViewModel::origin: itself, or the middle of its
  // disc.
  std::vector<Eigen::Vector3f> Shown(int chunk) const;

  // One level of a chunk. May be called from several threads.
  struct Geometry {
    std::vector<uint16_t> points;   // indices into those of the chunk, in the order of their use
    std::vector<uint16_t> corners;  // three per triangle, into points
    double error = 0;               // metres, as in the options
    float disc_size = 1;            // of a cloud: times that of its discs, where some are left out
  };
  std::shared_ptr<const Geometry> Make(int chunk, Level level) const;

  // What the page loads, little-endian: uint32 "RTC1", number of points, number of corners, 1 =
  // with texture coordinates, 2 = with colours; per point x y z (float, metres relative to the
  // origin); per point u v (uint16, 65535 = 1) or r g b 255 (bytes); per point the
  // normal x y z 0 (int8, 127 = 1); corners (uint16).
  std::string Encode(int chunk, Level level) const;

 private:
  Geometry Simplify(const Mesh& mesh, double share, double tolerance) const;
  // Of a cloud: every second, third ... disc, as much larger.
  static Geometry Thin(const Mesh& mesh, double share);

  const ViewChunkOptions options_;
  bool is_cloud_ = false;
  std::vector<ViewChunk> chunks_;
  ViewSpool spool_;
  mutable std::mutex mutex_;
  // Made before; [level][chunk].
  mutable std::vector<std::shared_ptr<const Geometry>> made_[kFull];
};

}  // namespace roomtex
