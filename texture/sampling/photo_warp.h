#pragma once
// Where a photo shows what, beside its camera model: a smooth field of small shifts on a control
// lattice, as in Zhou and Koltun 2014, "Color Map Optimization for 3D Reconstruction with Consumer
// Depth Cameras". It takes up what pose, lens and scan leave over: drift, bends, rolling shutters.

#include <array>
#include <vector>

#include <Eigen/Core>

namespace roomtex {

class PhotoWarp {
 public:
  // Nodes `spacing` pixels apart, from one border of the photo to the other; all zero.
  PhotoWarp(int width, int height, double spacing);

  int columns() const { return columns_; }
  int rows() const { return rows_; }
  int num_nodes() const { return columns_ * rows_; }
  double spacing() const { return spacing_; }
  // Node (column, row) stands at spacing() * (column, row) in `img`. Pixels.
  Eigen::Vector2f& Shift(int node) { return shifts_[node]; }
  const Eigen::Vector2f& Shift(int node) const { return shifts_[node]; }
  Eigen::Vector2f Place(int node) const {
    return Eigen::Vector2i(node % columns_, node / columns_).cast<float>() *
           static_cast<float>(spacing_);
  }

  // What the camera model sees at (x, y) in `img` is shown at (x, y) + At(x, y). Linear between the
  // nodes.
  Eigen::Vector2f At(float x, float y) const;
  // The four nodes around, and the share that each has of At().
  void NodesAt(float x, float y, std::array<int, 4>* nodes, std::array<float, 4>* shares) const;

 private:
  int columns_, rows_;
  double spacing_;
  std::vector<Eigen::Vector2f> shifts_;
};

}  // namespace roomtex
