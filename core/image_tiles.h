#pragma once
// Large pictures for a page: a pyramid of tiles, made when asked for.

#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <tuple>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace roomtex {

class OptionFields;

struct ImageTilesOptions {
  int tile_size = 512;      // pixels, both ways
  int jpeg_quality = 90;    // 1..100, larger = finer
  int max_megabytes = 512;  // of decoded levels and tiles kept; a 20 MP photo with its levels: 80
  int max_decodes = 2;      // pictures decoded side by side, which come on top of max_megabytes

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// Level 0 is the picture itself. Pixel (x, y) of the next level is the mean of the 2 x 2 pixels
// (2x, 2y)..(2x+1, 2y+1); where an odd width or height lacks the second, the last counts twice. So
// a point at (u, v) of level l, upper-left corner 0, 0, lies at (2^l u, 2^l v) of the picture, to
// the border. The last level fits into one tile. Tiles at the right and lower border are smaller.
// A photo lies as it was taken (EXIF orientation not applied, see photo.h): picks are its pixels.
struct TilePyramid {
  int width = 0, height = 0;  // of level 0
  int tile_size = 0;
  int num_levels = 0;

  int LevelWidth(int level) const;
  int LevelHeight(int level) const;
};

// Everything may be called from several threads.
class ImageTiles {
 public:
  enum class Format { kJpeg, kPng };  // kPng: exact, for tests
  // Gives 8-bit grey or BGR of the size that was said. May be called again when the picture has
  // left the cache, and for several pictures side by side.
  using Loader = std::function<cv::Mat()>;

  // Throws UsageError with all problems of the options.
  explicit ImageTiles(const ImageTilesOptions& options);

  // Decodes nothing yet. An id that is there already gets the new picture.
  void Add(const std::string& id, int width, int height, Format format, Loader loader);

  // num_levels 0: no such picture.
  TilePyramid Pyramid(const std::string& id) const;

  // The encoded file, or null if there is no such picture, level or tile. Throws what the loader
  // throws, and InputError if the picture is not of the size that was said.
  std::shared_ptr<const std::string> Tile(const std::string& id, int level, int x, int y);
  // "image/jpeg" or "image/png".
  static const char* ContentType(Format format);
  Format FormatOf(const std::string& id) const;  // of a picture that is there

  int64_t cached_bytes() const;  // never above max_megabytes

 private:
  struct Picture;
  struct Decodes;
  // Generation of the picture, level, x, y; x = y = -1: the decoded level.
  using Key = std::tuple<int64_t, int, int, int>;
  struct Entry {
    Key key;
    int64_t bytes = 0;
    cv::Mat level;  // one of the two
    std::shared_ptr<const std::string> tile;
  };

  std::shared_ptr<Picture> Find(const std::string& id) const;
  bool Recall(const Key& key, Entry* entry);
  void Keep(Entry entry);
  cv::Mat Level(Picture* picture, int level);
  cv::Mat Decode(const Picture& picture);

  const ImageTilesOptions options_;
  std::shared_ptr<Decodes> decodes_;
  mutable std::mutex mutex_;  // of all that follows
  std::map<std::string, std::shared_ptr<Picture>> pictures_;
  int64_t next_generation_ = 0;
  std::list<Entry> entries_;  // most recently used first
  std::map<Key, std::list<Entry>::iterator> found_;
  int64_t cached_bytes_ = 0;
};

}  // namespace roomtex
