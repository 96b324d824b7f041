#pragma once
// A photo on the picture of a scan (thesis figure 7.2), as tiles for the page.

#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "align/pick/pick_scene.h"

namespace roomtex {

// 8-bit BGRA, a pixel per sample of the scan's picture: the photo's colour where it sees the
// sample, alpha 0 where it does not (outside the photo, hidden by the scan's surface, not
// measured). projection: the photo's, or what its picks made of it. The photo is averaged over
// about a sample. Empty when give_up() became true. Throws InputError if the photo cannot be read.
cv::Mat DrawBackProjection(const PickScene& scene, const ScanRays& rays, const PickPhoto& photo,
                           const CameraProjection& projection, const Rigid& cam_from_scan, int scan,
                           const std::function<bool()>& give_up);

// The next smaller level of a pyramid (sizes as core/image_tiles.h), colours weighted by their
// alpha.
cv::Mat HalvedWithAlpha(const cv::Mat& image);

// Draws each picture once, when its first tile is asked for, and keeps the last few. Safe from
// several threads.
class BackProjections {
 public:
  struct Key {
    int photo = 0, scan = 0, solution_number = 0;
    bool operator==(const Key& other) const {
      return photo == other.photo && scan == other.scan && solution_number == other.solution_number;
    }
  };
  using Draw = std::function<cv::Mat()>;

  explicit BackProjections(int tile_size) : tile_size_(tile_size) {}

  // A PNG, or null if draw() gave nothing or there is no such tile. Pictures of other solutions are
  // forgotten.
  std::shared_ptr<const std::string> Tile(const Key& key, int level, int x, int y,
                                          const Draw& draw);

 private:
  struct Picture {
    Key key;
    std::mutex making;  // one thread draws, the others wait for it
    std::vector<cv::Mat> levels;
  };

  const int tile_size_;
  std::mutex mutex_;
  std::list<std::shared_ptr<Picture>> pictures_;  // most recently used first
};

}  // namespace roomtex
