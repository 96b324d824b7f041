// Shuffling blocks so that no neighbours are alike.

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include <opencv2/imgproc.hpp>

#include "capture/pattern_steps.h"
#include "capture/random_stream.h"

namespace roomtex {
namespace {

constexpr int kThumb = 8;  // a block as a whole is compared at 8 x 8

enum Side { kLeft, kRight, kTop, kBottom };

struct Block {
  std::array<std::vector<float>, 4> sides;  // the outermost lines of pixels
  std::vector<float> thumb;
};

std::vector<float> ToVector(const cv::Mat& grey) {
  cv::Mat1f values;
  grey.convertTo(values, CV_32F);
  return {values.begin(), values.end()};
}

Block Describe(const cv::Mat1b& block) {
  Block result;
  result.sides[kLeft] = ToVector(block.col(0));
  result.sides[kRight] = ToVector(block.col(block.cols - 1));
  result.sides[kTop] = ToVector(block.row(0));
  result.sides[kBottom] = ToVector(block.row(block.rows - 1));
  cv::Mat thumb;
  cv::resize(block, thumb, {kThumb, kThumb}, 0, 0, cv::INTER_AREA);
  result.thumb = ToVector(thumb);
  return result;
}

// margin: share by which they must differ more than kLeastStep and kMostCorrelation ask.
bool AreAlike(const std::vector<float>& a, const std::vector<float>& b, double margin) {
  // A block that is cut off meets its neighbour along its own length.
  const size_t count = std::min(a.size(), b.size());
  if (count == 0) return false;
  const auto n = static_cast<double>(count);
  double step = 0, sum_a = 0, sum_b = 0, aa = 0, bb = 0, ab = 0;
  for (size_t i = 0; i < count; ++i) {
    step += std::abs(a[i] - b[i]);
    sum_a += a[i];
    sum_b += b[i];
    aa += a[i] * a[i];
    bb += b[i] * b[i];
    ab += a[i] * b[i];
  }
  if (step / n < kLeastStep * (1 + margin)) return true;
  const double var_a = aa - sum_a * sum_a / n, var_b = bb - sum_b * sum_b / n;
  const double cov = ab - sum_a * sum_b / n;
  return cov > kMostCorrelation * (1 - margin) * std::sqrt(std::max(var_a * var_b, 0.0)) && cov > 0;
}

// a is left of b, or above it.
bool AreAlike(const Block& a, const Block& b, bool beside, double margin) {
  return AreAlike(a.sides[beside ? kRight : kBottom], b.sides[beside ? kLeft : kTop], margin) ||
         AreAlike(a.thumb, b.thumb, margin);
}

class Board {
 public:
  Board(std::vector<Block> blocks, int size, std::vector<int> order, double margin)
      : blocks_(std::move(blocks)), size_(size), order_(std::move(order)), margin_(margin) {}

  // Alike neighbours of one place.
  int CountAt(int place) const {
    const int x = place % size_, y = place / size_;
    const Block& here = At(place);
    int count = 0;
    if (x > 0) count += AreAlike(At(place - 1), here, true, margin_);
    if (x + 1 < size_) count += AreAlike(here, At(place + 1), true, margin_);
    if (y > 0) count += AreAlike(At(place - size_), here, false, margin_);
    if (y + 1 < size_) count += AreAlike(here, At(place + size_), false, margin_);
    return count;
  }
  int Count() const {
    int twice = 0;
    for (int place = 0; place < size_ * size_; ++place) twice += CountAt(place);
    return twice / 2;
  }
  // Exchanges what stands at alike neighbours with other places as long as that helps.
  void Improve(RandomStream* random) {
    const int places = size_ * size_;
    for (int round = 0; round < 30; ++round) {
      bool any = false;
      for (int place = 0; place < places; ++place) {
        for (int attempt = 0; attempt < 60 && CountAt(place) > 0; ++attempt) {
          any = true;
          TryExchange(place, random->Index(places));
        }
      }
      if (!any) return;
    }
  }
  const std::vector<int>& order() const { return order_; }

 private:
  const Block& At(int place) const { return blocks_[order_[place]]; }
  void TryExchange(int a, int b) {
    const int before = CountAt(a) + CountAt(b);
    std::swap(order_[a], order_[b]);
    if (CountAt(a) + CountAt(b) > before) std::swap(order_[a], order_[b]);
  }

  std::vector<Block> blocks_;
  int size_;
  std::vector<int> order_;
  double margin_;
};

// The block of a place; those of the last column and row may be cut off.
cv::Rect BlockAt(const cv::Mat1b& image, int blocks, int place) {
  const int width = (image.cols + blocks - 1) / blocks, height = (image.rows + blocks - 1) / blocks;
  return cv::Rect(place % blocks * width, place / blocks * height, width, height) &
         cv::Rect(0, 0, image.cols, image.rows);
}

std::vector<Block> DescribeBlocks(const cv::Mat1b& image, int blocks) {
  std::vector<Block> all;
  for (int i = 0; i < blocks * blocks; ++i) {
    const cv::Rect rect = BlockAt(image, blocks, i);
    all.push_back(rect.empty() ? Block() : Describe(image(rect)));
  }
  return all;
}

}  // namespace

BlockShuffle ShuffleBlocks(const cv::Mat1b& image, int blocks, uint64_t seed) {
  std::vector<int> order(static_cast<size_t>(blocks) * blocks);
  std::iota(order.begin(), order.end(), 0);
  RandomStream random(MixBits(seed, 0xb10c5));
  for (int i = static_cast<int>(order.size()) - 1; i > 0; --i) {
    std::swap(order[i], order[random.Index(i + 1)]);
  }
  // The last column and row will be cut off, which changes what their blocks are like a little.
  Board board(DescribeBlocks(image, blocks), blocks, std::move(order), 0.2);
  board.Improve(&random);
  return {board.order(), board.Count()};
}

cv::Mat1b ApplyShuffle(const cv::Mat1b& image, int blocks, const BlockShuffle& shuffle) {
  cv::Mat1b result(image.rows, image.cols);
  for (int place = 0; place < blocks * blocks; ++place) {
    image(BlockAt(image, blocks, shuffle.order[place]))
        .copyTo(result(BlockAt(image, blocks, place)));
  }
  return result;
}

int CountSimilarNeighbours(const cv::Mat1b& pattern, int blocks) {
  std::vector<int> order(static_cast<size_t>(blocks) * blocks);
  std::iota(order.begin(), order.end(), 0);
  return Board(DescribeBlocks(pattern, blocks), blocks, std::move(order), 0).Count();
}

}  // namespace roomtex
