// Shuffling blocks so that no neighbours are alike.

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include <opencv2/imgproc.hpp>

#include "capture/pattern/pattern_steps.h"
#include "core/random_stream.h"

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

bool AreAlike(const std::vector<float>& a, const std::vector<float>& b) {
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
  if (step / n < kLeastStep) return true;
  const double var_a = aa - sum_a * sum_a / n, var_b = bb - sum_b * sum_b / n;
  const double cov = ab - sum_a * sum_b / n;
  return cov > 0 && cov > kMostCorrelation * std::sqrt(std::max(var_a * var_b, 0.0));
}

// a is left of b, or above it.
bool AreAlike(const Block& a, const Block& b, bool beside) {
  return AreAlike(a.sides[beside ? kRight : kBottom], b.sides[beside ? kLeft : kTop]) ||
         AreAlike(a.thumb, b.thumb);
}

// The block at a place of an image of this size; those of the last column and row may be cut off.
cv::Rect BlockAt(cv::Size size, int blocks, int place) {
  const int width = (size.width + blocks - 1) / blocks;
  const int height = (size.height + blocks - 1) / blocks;
  return cv::Rect(place % blocks * width, place / blocks * height, width, height) &
         cv::Rect({0, 0}, size);
}

// Blocks of an image on the places of a board, of which only `visible` is seen.
class Board {
 public:
  Board(const cv::Mat1b& image, int blocks, cv::Size visible, std::vector<int> order)
      : size_(blocks), order_(std::move(order)) {
    const int places = blocks * blocks;
    // What is left of a block in the last column and row.
    const cv::Size whole = BlockAt(image.size(), blocks, 0).size();
    const cv::Size last = BlockAt(visible, blocks, places - 1).size();
    for (int i = 0; i < places; ++i) {
      const cv::Rect block = BlockAt(image.size(), blocks, i);
      for (int cut = 0; cut < 4; ++cut) {
        const cv::Size left(cut & 1 ? last.width : whole.width,
                            cut & 2 ? last.height : whole.height);
        const cv::Rect seen = block & cv::Rect(block.tl(), left);
        described_[cut].push_back(seen.empty() ? Block() : Describe(image(seen)));
      }
    }
  }

  // Alike neighbours of one place.
  int CountAt(int place) const {
    const int x = place % size_, y = place / size_;
    const Block& here = At(place);
    int count = 0;
    if (x > 0) count += AreAlike(At(place - 1), here, true);
    if (x + 1 < size_) count += AreAlike(here, At(place + 1), true);
    if (y > 0) count += AreAlike(At(place - size_), here, false);
    if (y + 1 < size_) count += AreAlike(here, At(place + size_), false);
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
  const Block& At(int place) const {
    const int cut = (place % size_ == size_ - 1 ? 1 : 0) + (place / size_ == size_ - 1 ? 2 : 0);
    return described_[cut][order_[place]];
  }
  void TryExchange(int a, int b) {
    const int before = CountAt(a) + CountAt(b);
    std::swap(order_[a], order_[b]);
    if (CountAt(a) + CountAt(b) > before) std::swap(order_[a], order_[b]);
  }

  std::array<std::vector<Block>, 4> described_;  // whole, cut at the right, at the bottom, both
  int size_;
  std::vector<int> order_;
};

std::vector<int> InOrder(int blocks) {
  std::vector<int> order(static_cast<size_t>(blocks) * blocks);
  std::iota(order.begin(), order.end(), 0);
  return order;
}

}  // namespace

std::vector<int> ShuffleBlocks(const cv::Mat1b& image, int blocks, cv::Size visible,
                               uint64_t seed) {
  std::vector<int> order = InOrder(blocks);
  RandomStream random(MixBits(seed, 0xb10c5));
  for (int i = static_cast<int>(order.size()) - 1; i > 0; --i) {
    std::swap(order[i], order[random.Index(i + 1)]);
  }
  Board board(image, blocks, visible, std::move(order));
  board.Improve(&random);
  return board.order();
}

cv::Mat1b ApplyShuffle(const cv::Mat1b& image, int blocks, const std::vector<int>& order) {
  cv::Mat1b result(image.rows, image.cols);
  for (int place = 0; place < blocks * blocks; ++place) {
    image(BlockAt(image.size(), blocks, order[place]))
        .copyTo(result(BlockAt(image.size(), blocks, place)));
  }
  return result;
}

int CountSimilarNeighbours(const cv::Mat1b& pattern, int blocks) {
  return Board(pattern, blocks, pattern.size(), InOrder(blocks)).Count();
}

}  // namespace roomtex
