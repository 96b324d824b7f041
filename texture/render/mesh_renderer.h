#pragma once
// Pictures of a coloured mesh by ray casting, to look at results.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "core/camera_model.h"
#include "core/ray_caster.h"
#include "core/similarity.h"

namespace roomtex {

// `scan` frame; triangles are counter-clockwise from their front.
struct ColoredMesh {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Matrix<uint8_t, 3, 1>> colors;  // red, green, blue
  std::vector<Triangle> triangles;
  // With texture images (8-bit BGR): a position per vertex, (0, 0) is the upper-left corner of the
  // image, and the image per triangle, -1 = colours of the corners. Empty without.
  std::vector<Eigen::Vector2f> uv;
  std::vector<int> texture_of_triangle;
  std::vector<cv::Mat> textures;
  Eigen::Vector3d up = Eigen::Vector3d::Zero();  // unit; zero = the file does not say
};

// A PLY mesh with colours at the vertices. Throws InputError.
ColoredMesh ReadColoredMesh(const std::string& path);

// A model.glb of roomtex-texture. Throws InputError.
ColoredMesh ReadTexturedMesh(const std::string& path);

// Axis-aligned box that holds all but the outermost hundredth of the vertices on each side: what is
// seen through a window does not count.
struct RoomBox {
  Eigen::Vector3d low, high;
  Eigen::Vector3d Centre() const { return (low + high) / 2; }
};
RoomBox FindRoomBox(const ColoredMesh& mesh);

// Leaves out the triangles with a corner beyond `limit` along the unit vector `axis`.
ColoredMesh CutBeyond(const ColoredMesh& mesh, const Eigen::Vector3d& axis, double limit);

struct RenderSettings {
  int width = 0;                // pixels of the picture; the height follows from the camera
  int rays_per_side = 2;        // per pixel, each way
  bool front_only = false;      // look through surfaces from behind, e.g. from outside the room
  cv::Vec3b empty{48, 48, 48};  // colour where there is no surface, b g r
  int num_threads = -1;
};

class MeshRenderer {
 public:
  explicit MeshRenderer(const ColoredMesh& mesh);  // must outlive the renderer

  // 8-bit BGR: colours interpolated between a triangle's corners.
  cv::Mat Render(const Camera& camera, const Rigid& cam_from_scan,
                 const RenderSettings& settings) const;

  // Share of the picture that shows the front of something more than half a metre away: how good a
  // viewpoint is.
  double ShareInSight(const Camera& camera, const Rigid& cam_from_scan) const;

 private:
  cv::Vec3f ColorAlong(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                       const RenderSettings& settings) const;

  const ColoredMesh& mesh_;
  RayCaster caster_;
};

// A camera at `eye` that looks at `target`, upright.
Rigid LookAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target, const Eigen::Vector3d& up);

}  // namespace roomtex
