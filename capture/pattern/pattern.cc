#include "capture/pattern/pattern.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "capture/pattern/pattern_steps.h"
#include "core/error.h"
#include "core/option_fields.h"
#include "core/random_stream.h"

namespace roomtex {
namespace {

constexpr double kFinest = 5.5;  // pixels: the smallest shapes

uint64_t SeedOf(const PatternOptions& options) {
  return MixBits(static_cast<uint64_t>(options.random_seed), 0x9a77e2);
}

// The smallest size that holds the projector's picture and falls into equal blocks.
cv::Size BlockedSize(const PatternOptions& options) {
  const auto up = [&](int pixels) {
    return (pixels + options.blocks - 1) / options.blocks * options.blocks;
  };
  return {up(options.width), up(options.height)};
}

// detail: 0 = black, 65535 = white.
cv::Mat1b FromDetail(const cv::Mat1w& detail, const PatternOptions& options) {
  // Thesis 5.1.2: the intensity is inverted, the blocks are re-arranged.
  const cv::Mat1w inverted = 65535 - detail;
  const cv::Mat1b spread = SpreadGrey(inverted, options.brightness);
  const std::vector<int> order =
      ShuffleBlocks(spread, options.blocks, {options.width, options.height}, SeedOf(options));
  return ApplyShuffle(spread, options.blocks, order)({0, 0, options.width, options.height}).clone();
}

cv::Mat1w Wide(const cv::Mat1b& grey) {
  cv::Mat1w wide;
  grey.convertTo(wide, CV_16U, 257);
  return wide;
}

// Grey, scaled so that it covers `size`, the overhang cut off.
cv::Mat1b Cover(const cv::Mat& photo, cv::Size size) {
  cv::Mat grey;
  if (photo.channels() == 3) {
    cv::cvtColor(photo, grey, cv::COLOR_BGR2GRAY);
  } else {
    grey = photo;
  }
  const double shape = static_cast<double>(size.width) / size.height;
  cv::Rect part(0, 0, grey.cols, grey.rows);
  if (grey.cols > grey.rows * shape) {
    part.width = std::max(1, static_cast<int>(std::lround(grey.rows * shape)));
    part.x = (grey.cols - part.width) / 2;
  } else {
    part.height = std::max(1, static_cast<int>(std::lround(grey.cols / shape)));
    part.y = (grey.rows - part.height) / 2;
  }
  cv::Mat covering;
  cv::resize(grey(part), covering, size, 0, 0,
             part.width > size.width ? cv::INTER_AREA : cv::INTER_CUBIC);
  return covering;
}

}  // namespace

void PatternOptions::Declare(OptionFields* fields) {
  const std::string size = "--width must lie in 320..16384 and --height in 240..16384 pixels";
  fields->Int("width", &width, "pixels of the projector").Within(320, 16384).SaysSentence(size);
  fields->Int("height", &height, "pixels of the projector").Within(240, 16384).SaysSentence(size);
  fields
      ->Int("blocks", &blocks,
            "the image is cut into this many blocks each way, which are shuffled")
      .Within(1, 64)
      .Says("must lie in 1..64");
  fields
      ->Number("brightness", &brightness,
               "mean grey value, 1 = white. Larger = more light for the room, less contrast")
      .Within(0.3, 0.9)
      .Says("must lie in 0.3..0.9");
}

std::vector<std::string> PatternOptions::Problems() const { return ProblemsOf(*this); }

cv::Mat1b MakePattern(const PatternOptions& options) {
  ThrowIfProblems(options.Problems());
  const cv::Size size = BlockedSize(options);
  const cv::Mat1b detail = DrawDetail(size.width, size.height, kFinest, SeedOf(options));
  return FromDetail(Wide(detail), options);
}

cv::Mat1b MakePattern(const cv::Mat& photo, const PatternOptions& options) {
  ThrowIfProblems(options.Problems());
  const cv::Size size = BlockedSize(options);
  const cv::Mat1b covering = Cover(photo, size);
  const cv::Mat1b detail = DrawDetail(size.width, size.height, kFinest, SeedOf(options));
  return FromDetail(0.5 * Wide(covering) + 0.5 * Wide(detail), options);
}

}  // namespace roomtex
