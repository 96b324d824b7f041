#pragma once
// What an E57 file says about its scans and photos: its XML section, checked.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/similarity.h"
#include "importers/e57_pages.h"

namespace roomtex {

// One field of a point record.
struct E57Field {
  enum class Type { kInteger, kScaledInteger, kSingle, kDouble, kString };
  std::string name;  // with the prefix of its extension, if it is of one
  Type type = Type::kDouble;
  // Integers: the smallest and largest raw value; value = raw * scale + offset.
  int64_t minimum = 0, maximum = 0;
  bool has_range = false;  // minimum and maximum are written in the file
  double scale = 1, offset = 0;
  int num_bits = 64;  // of one value; strings: at least
};

// A compressed vector of point records.
struct E57Points {
  int64_t section = 0;  // logical offset
  int64_t num_records = 0;
  std::vector<E57Field> fields;

  // Index of the field, -1 if there is none.
  int Find(const std::string& name) const;
};

// Smallest and largest value, both as they are meant: scaled.
struct E57Limits {
  double minimum = 0, maximum = 0;
};

struct E57Scan {
  std::string name, guid;
  Rigid file_from_scan;
  struct IndexBounds {
    int64_t first_row = 0, last_row = -1, first_column = 0, last_column = -1;
  };
  std::optional<IndexBounds> index_bounds;
  std::optional<E57Limits> intensity_limits;
  std::optional<E57Limits> color_limits[3];  // red, green, blue
  E57Points points;
};

struct E57Image {
  enum class Kind { kVisual, kPinhole, kSpherical, kCylindrical };
  std::string name, guid, scan_guid;      // scan_guid: of the scan that it belongs to, or ""
  std::optional<Rigid> file_from_camera;  // x right, y up, looks along -z
  Kind kind = Kind::kVisual;
  bool is_png = false;
  int64_t section = 0, num_bytes = 0;  // logical offset of the blob, size of the picture
  // The same of the mask, a PNG that is 0 where the picture shows nothing; 0 bytes = there is none.
  int64_t mask_section = 0, num_mask_bytes = 0;
  int64_t width = 0, height = 0;  // pixels
  // Pinhole: focal length, width and height of a pixel in metres, principal point in pixels.
  // Spherical and cylindrical: width and height of a pixel in radians.
  double focal_length = 0, pixel_width = 0, pixel_height = 0;
  double principal_point_x = 0, principal_point_y = 0;
  bool has_distortion = false;  // by an extension; it is not read
};

struct E57Document {
  std::vector<E57Scan> scans;
  std::vector<E57Image> images;
};

// Reads the XML section. Elements of extensions are passed over. Throws InputError with the byte.
E57Document ReadE57Document(const E57Pages& pages);

}  // namespace roomtex
