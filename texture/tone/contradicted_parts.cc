#include "texture/tone/contradicted_parts.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "core/cpu_stages.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

// Chosen on one simulated room with somebody in half of the photos (docs/texture.md).
constexpr int kCellsPerWidth = 128;
constexpr int kLeastCellPx = 8;
constexpr float kMinOfSquare = 4;   // of a square that says anything
constexpr int kMinOutvoted = 8;     // squares that hang together
constexpr double kMinShare = 0.01;  // of a photo; less is left to the blend

// Of every square of a photo: samples there at which it agrees with most photos, at which most
// contradict it, and at which nobody knows.
using Counts = cv::Mat_<cv::Vec3f>;

class PartFinder {
 public:
  PartFinder(const PhotoPassInput& input, const ObservationStore& store,
             const std::vector<std::vector<Vote>>& votes, const PhotoView& photo, int number)
      : input_(input), store_(store), votes_(votes), number_(number), projector_(photo) {
    const Camera& camera = projector_.camera().camera();
    const double spacing_px = input.angular_spacing * camera.MeanFocalLength();
    cell_px_ = std::max({kLeastCellPx, camera.width / kCellsPerWidth,
                         static_cast<int>(std::lround(2 * spacing_px))});
    counts_ = Counts((camera.height + cell_px_ - 1) / cell_px_,
                     (camera.width + cell_px_ - 1) / cell_px_, cv::Vec3f(0, 0, 0));
  }

  std::shared_ptr<const PhotoMask> Find() {
    for (size_t t = 0; t < input_.samples.size(); ++t) {
      const SampleTile& tile = input_.samples[t];
      if (projector_.MaySee(tile.points.origin, tile.points.radius)) Count(tile, votes_[t]);
    }
    const cv::Mat1b masked = MaskedCells();
    std::vector<uint8_t> cells(masked.begin(), masked.end());
    auto mask = std::make_shared<PhotoMask>(cell_px_, masked.cols, masked.rows, std::move(cells));
    return mask->Share() < kMinShare ? nullptr : mask;
  }

 private:
  void Count(const SampleTile& tile, const std::vector<Vote>& votes) {
    projector_.Project(tile.points, &projected_);
    size_t next = 0;
    for (int i = 0; i < tile.points.size(); ++i) {
      const size_t slot = static_cast<size_t>(tile.first_slot) + i;
      const Observation* const seen = store_.Begin(slot);
      const size_t first = next;
      next += store_.Count(slot);
      for (size_t k = first; k < next; ++k) {
        if (seen[k - first].photo != number_ || votes[k] == Vote::kNone) continue;
        const float x = projected_.x[i], y = projected_.y[i];
        const int row = std::clamp(static_cast<int>(y) / cell_px_, 0, counts_.rows - 1);
        const int column = std::clamp(static_cast<int>(x) / cell_px_, 0, counts_.cols - 1);
        const int kind = votes[k] == Vote::kAgrees ? 0 : votes[k] == Vote::kOutvoted ? 1 : 2;
        counts_(row, column)[kind] += 1;
      }
    }
  }

  // What hangs together with enough squares in which the photo is outvoted.
  cv::Mat1b MaskedCells() const {
    cv::Mat1b outvoted(counts_.size(), uint8_t{0}), doubtful(counts_.size(), uint8_t{0});
    for (int row = 0; row < counts_.rows; ++row) {
      for (int column = 0; column < counts_.cols; ++column) {
        const cv::Vec3f& n = counts_(row, column);
        if (n[0] + n[1] + n[2] < kMinOfSquare) continue;
        if (n[1] > n[0] && n[1] >= kMinOfSquare) outvoted(row, column) = 1;
        if (n[1] + n[2] > n[0]) doubtful(row, column) = 1;
      }
    }
    cv::morphologyEx(doubtful, doubtful, cv::MORPH_CLOSE,
                     cv::getStructuringElement(cv::MORPH_RECT, {3, 3}));
    cv::Mat1i labels;
    const int count = cv::connectedComponents(doubtful, labels, 4, CV_32S);
    std::vector<int> num_outvoted(count, 0);
    for (int row = 0; row < counts_.rows; ++row) {
      for (int column = 0; column < counts_.cols; ++column) {
        num_outvoted[labels(row, column)] += outvoted(row, column);
      }
    }
    cv::Mat1b masked(counts_.size(), uint8_t{0});
    for (int row = 0; row < counts_.rows; ++row) {
      for (int column = 0; column < counts_.cols; ++column) {
        const int label = labels(row, column);
        masked(row, column) = label > 0 && num_outvoted[label] >= kMinOutvoted;
      }
    }
    // A square on the outline shows a little of what stands there.
    cv::dilate(masked, masked, cv::getStructuringElement(cv::MORPH_RECT, {3, 3}));
    return masked;
  }

  const PhotoPassInput& input_;
  const ObservationStore& store_;
  const std::vector<std::vector<Vote>>& votes_;
  int number_, cell_px_;
  PhotoProjector projector_;
  ProjectedBlock projected_;
  Counts counts_;
};

}  // namespace

std::vector<std::shared_ptr<const PhotoMask>> FindContradictedParts(
    const PhotoPassInput& input, const ObservationStore& store,
    const std::vector<Eigen::Vector3f>& gains, const std::vector<PhotoView>& photos,
    const BlendOptions& blend, int num_threads) {
  const CpuTimer timer(CpuStage::kBlend, CpuTimer::Scope::kProcess);
  std::vector<std::shared_ptr<const PhotoMask>> masks(photos.size());
  if (blend.outlier == 0) return masks;
  // Tile by tile, of all observations of its samples one after the other.
  std::vector<std::vector<Vote>> votes(input.samples.size());
  ParallelFor(num_threads, 0, static_cast<int>(votes.size()), [&](int t) {
    const SampleTile& tile = input.samples[t];
    for (int i = 0; i < tile.points.size(); ++i) {
      const size_t slot = static_cast<size_t>(tile.first_slot) + i, first = votes[t].size();
      votes[t].resize(first + store.Count(slot));
      CastVotes(store.Begin(slot), store.Count(slot), gains, blend.outlier,
                votes[t].data() + first);
    }
  });
  ParallelFor(num_threads, 0, static_cast<int>(photos.size()),
              [&](int i) { masks[i] = PartFinder(input, store, votes, photos[i], i).Find(); });
  return masks;
}

}  // namespace roomtex
