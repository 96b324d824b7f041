#pragma once
// The two file formats of COLMAP's sparse model, each parsed from and appended to bytes in memory.
// Use sparse_model.h everywhere else: what these give is checked there, file against file.

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "colmap_ext/sparse_model.h"

namespace roomtex {

// One entry of a file and where it begins: a byte of a binary file, a line (from 1) of a text file.
template <typename Entry>
struct Placed {
  long long position = 0;
  uint64_t id = 0;
  Entry entry;
};
template <typename Entry>
using PlacedList = std::vector<Placed<Entry>>;

// By image_id.
using FrameOfImage = std::map<uint32_t, uint32_t>;

// One way of writing a model. `path` is for messages only. Parsers throw InputError for everything
// that one file alone can show: truncated, impossible counts, unknown camera model, numbers that
// are not finite.
struct SparseModelFormat {
  const char* extension;  // ".bin"
  std::string (*position)(long long);
  PlacedList<Camera> (*parse_cameras)(const std::string& bytes, const std::string& path);
  PlacedList<SparseImage> (*parse_images)(const std::string& bytes, const std::string& path);
  PlacedList<SparsePoint> (*parse_points)(const std::string& bytes, const std::string& path);
  // Of COLMAP 4: frame by image.
  FrameOfImage (*parse_frames)(const std::string& bytes, const std::string& path);
  // Hand the file to `write` piece by piece.
  using Write = std::function<void(const std::string& piece)>;
  void (*write_cameras)(const SparseModel& model, const Write& write);
  void (*write_images)(const SparseModel& model, const Write& write);
  void (*write_points)(const SparseModel& model, const Write& write);
};

const SparseModelFormat& SparseModelBinary();
const SparseModelFormat& SparseModelText();

// Puts three parsed files together and checks them against each other: ids and names given twice,
// images without their camera, tracks and observations that do not answer each other. `folder` is
// for messages.
SparseModel AssembleSparseModel(const SparseModelFormat& format, const std::string& folder,
                                PlacedList<Camera> cameras, PlacedList<SparseImage> images,
                                PlacedList<SparsePoint> points);

// The pose of an image from the numbers in a file; InputError if they are none.
Rigid PoseFromNumbers(const double qvec_wxyz[4], const double tvec[3], const std::string& path,
                      const std::string& position);

}  // namespace roomtex
