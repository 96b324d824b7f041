#include "core/image_tiles.h"

#include <algorithm>
#include <condition_variable>
#include <stdexcept>
#include <utility>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/option_fields.h"

namespace roomtex {
namespace {

// ceil(size / 2^level), as repeated halving gives it.
int LevelSize(int size, int level) {
  return static_cast<int>((static_cast<int64_t>(size) + (int64_t{1} << level) - 1) >> level);
}

cv::Mat Halved(const cv::Mat& image) {
  cv::Mat even = image;
  if (image.cols % 2 != 0 || image.rows % 2 != 0) {
    cv::copyMakeBorder(image, even, 0, image.rows % 2, 0, image.cols % 2, cv::BORDER_REPLICATE);
  }
  cv::Mat half;
  cv::resize(even, half, cv::Size(even.cols / 2, even.rows / 2), 0, 0, cv::INTER_AREA);
  return half;
}

int64_t BytesOf(const cv::Mat& image) {
  return static_cast<int64_t>(image.total() * image.elemSize());
}

}  // namespace

struct ImageTiles::Picture {
  std::string id;
  int64_t generation = 0;
  TilePyramid pyramid;
  Format format = Format::kJpeg;
  Loader loader;
  std::mutex making;  // one thread makes the levels, the others wait for them
};

// Lets max_decodes in at a time: a strip of thumbnails must not decode all photos at once.
struct ImageTiles::Decodes {
  std::mutex mutex;
  std::condition_variable freed;
  int num_free = 0;

  void Enter() {
    std::unique_lock<std::mutex> lock(mutex);
    freed.wait(lock, [&] { return num_free > 0; });
    --num_free;
  }
  void Leave() {
    {
      const std::lock_guard<std::mutex> lock(mutex);
      ++num_free;
    }
    freed.notify_one();
  }
};

void ImageTilesOptions::Declare(OptionFields* fields) {
  fields->Int("tile_size", &tile_size, "Pixels, both ways.")
      .Within(16, 4096)
      .Says("must be between 16 and 4096 pixels")
      .Internal();
  fields->Int("jpeg_quality", &jpeg_quality, "Larger = finer.")
      .Within(1, 100)
      .Says("must be between 1 and 100")
      .Internal();
  fields->Int("max_megabytes", &max_megabytes, "Of levels and tiles kept.").Positive().Internal();
  fields->Int("max_decodes", &max_decodes, "Pictures decoded side by side.").Positive().Internal();
}

std::vector<std::string> ImageTilesOptions::Problems() const { return ProblemsOf(*this); }

int TilePyramid::LevelWidth(int level) const { return LevelSize(width, level); }
int TilePyramid::LevelHeight(int level) const { return LevelSize(height, level); }

ImageTiles::ImageTiles(const ImageTilesOptions& options)
    : options_(options), decodes_(std::make_shared<Decodes>()) {
  ThrowIfProblems(options.Problems());
  decodes_->num_free = options.max_decodes;
}

void ImageTiles::Add(const std::string& id, int width, int height, Format format, Loader loader) {
  if (width < 1 || height < 1) {
    throw InputError(id, "", "the picture has no pixels", "Check that its file is an image");
  }
  auto picture = std::make_shared<Picture>();
  picture->pyramid = {width, height, options_.tile_size, 1};
  while (LevelSize(std::max(width, height), picture->pyramid.num_levels - 1) > options_.tile_size) {
    ++picture->pyramid.num_levels;
  }
  picture->id = id;
  picture->format = format;
  picture->loader = std::move(loader);
  const std::lock_guard<std::mutex> lock(mutex_);
  picture->generation = next_generation_++;
  pictures_[id] = std::move(picture);
}

std::shared_ptr<ImageTiles::Picture> ImageTiles::Find(const std::string& id) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto found = pictures_.find(id);
  return found == pictures_.end() ? nullptr : found->second;
}

TilePyramid ImageTiles::Pyramid(const std::string& id) const {
  const auto picture = Find(id);
  return picture ? picture->pyramid : TilePyramid();
}

ImageTiles::Format ImageTiles::FormatOf(const std::string& id) const {
  const auto picture = Find(id);
  if (!picture) throw std::out_of_range("there is no picture " + id);
  return picture->format;
}

const char* ImageTiles::ContentType(Format format) {
  return format == Format::kJpeg ? "image/jpeg" : "image/png";
}

int64_t ImageTiles::cached_bytes() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return cached_bytes_;
}

bool ImageTiles::Recall(const Key& key, Entry* entry) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto found = found_.find(key);
  if (found == found_.end()) return false;
  entries_.splice(entries_.begin(), entries_, found->second);
  *entry = entries_.front();
  return true;
}

void ImageTiles::Keep(Entry entry) {
  const int64_t max_bytes = static_cast<int64_t>(options_.max_megabytes) << 20;
  // What does not fit at all must not drive out everything else.
  if (entry.bytes > max_bytes) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  if (found_.count(entry.key)) return;
  while (cached_bytes_ + entry.bytes > max_bytes) {
    cached_bytes_ -= entries_.back().bytes;
    found_.erase(entries_.back().key);
    entries_.pop_back();
  }
  cached_bytes_ += entry.bytes;
  entries_.push_front(std::move(entry));
  found_[entries_.front().key] = entries_.begin();
}

cv::Mat ImageTiles::Decode(const Picture& picture) {
  struct Turn {
    explicit Turn(Decodes* d) : decodes(d) { decodes->Enter(); }
    ~Turn() { decodes->Leave(); }
    Decodes* decodes;
  } turn(decodes_.get());
  cv::Mat image = picture.loader();
  const TilePyramid& pyramid = picture.pyramid;
  if (image.cols != pyramid.width || image.rows != pyramid.height) {
    const auto size = [](int width, int height) {
      return std::to_string(width) + " x " + std::to_string(height);
    };
    throw InputError(picture.id, "",
                     "has " + size(image.cols, image.rows) + " pixels, expected " +
                         size(pyramid.width, pyramid.height),
                     "Use the photos that COLMAP was given");
  }
  if (image.type() != CV_8UC1 && image.type() != CV_8UC3) {
    throw std::invalid_argument("tiles are made of 8-bit grey or BGR");
  }
  return image;
}

// The caller holds picture->making.
cv::Mat ImageTiles::Level(Picture* picture, int level) {
  const auto key = [&](int l) { return Key{picture->generation, l, -1, -1}; };
  const auto keep = [&](int l, const cv::Mat& image) {
    Entry entry;
    entry.key = key(l);
    entry.bytes = BytesOf(image);
    entry.level = image;
    Keep(std::move(entry));
  };
  // The nearest finer level that is there, or the picture anew.
  Entry entry;
  int from = level;
  while (from >= 0 && !Recall(key(from), &entry)) --from;
  cv::Mat image = entry.level;
  if (from < 0) {
    image = Decode(*picture);
    keep(from = 0, image);
  }
  for (; from < level; keep(++from, image)) image = Halved(image);
  return image;
}

std::shared_ptr<const std::string> ImageTiles::Tile(const std::string& id, int level, int x,
                                                    int y) {
  const auto picture = Find(id);
  if (!picture || level < 0 || level >= picture->pyramid.num_levels || x < 0 || y < 0) {
    return nullptr;
  }
  const TilePyramid& pyramid = picture->pyramid;
  const int64_t left = int64_t{x} * options_.tile_size, top = int64_t{y} * options_.tile_size;
  const int64_t width = std::min<int64_t>(options_.tile_size, pyramid.LevelWidth(level) - left);
  const int64_t height = std::min<int64_t>(options_.tile_size, pyramid.LevelHeight(level) - top);
  if (width <= 0 || height <= 0) return nullptr;

  Entry entry;
  const Key key{picture->generation, level, x, y};
  if (Recall(key, &entry)) return entry.tile;
  cv::Mat image;
  {
    const std::lock_guard<std::mutex> lock(picture->making);
    image = Level(picture.get(), level);
  }
  const cv::Rect area(static_cast<int>(left), static_cast<int>(top), static_cast<int>(width),
                      static_cast<int>(height));
  const bool is_jpeg = picture->format == Format::kJpeg;
  std::vector<unsigned char> bytes;
  cv::imencode(is_jpeg ? ".jpg" : ".png", image(area), bytes,
               is_jpeg ? std::vector<int>{cv::IMWRITE_JPEG_QUALITY, options_.jpeg_quality}
                       : std::vector<int>{cv::IMWRITE_PNG_COMPRESSION, 3});
  entry.key = key;
  entry.bytes = static_cast<int64_t>(bytes.size());
  entry.tile = std::make_shared<const std::string>(bytes.begin(), bytes.end());
  const auto tile = entry.tile;
  Keep(std::move(entry));
  return tile;
}

}  // namespace roomtex
