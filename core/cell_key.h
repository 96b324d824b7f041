#pragma once
// Cubes of space as keys of a hash table.

#include <cstdint>

#include <Eigen/Core>

namespace roomtex {

// cell: whole numbers. 21 bits each: cells two million cells apart share a key.
inline uint64_t CellKey(const Eigen::Array3d& cell) {
  uint64_t key = 0;
  for (int k = 0; k < 3; ++k) {
    key = key << 21 | (static_cast<uint64_t>(static_cast<int64_t>(cell[k])) & 0x1fffff);
  }
  return key;
}

// Of the cube of this size that a point lies in.
inline uint64_t CellKey(const Eigen::Vector3d& x_in_scan, double cell_size) {
  return CellKey(Eigen::Array3d((x_in_scan / cell_size).array().floor()));
}

}  // namespace roomtex
