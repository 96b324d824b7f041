#include "align/trust/descriptors.h"

#include <algorithm>
#include <cmath>

namespace roomtex {
namespace {

constexpr int kColumns = 128, kFolded = 64;
constexpr int kBlock = 64;  // rows that stay in the first cache

// GCC makes one instruction of eight products and their sums in pairs; nothing overflows, since
// rows are no longer than kDescriptorLength.
template <int columns>
int32_t Dot(const int16_t* a, const int16_t* b) {
  int32_t sum = 0;
  for (int k = 0; k < columns; ++k) sum += static_cast<int32_t>(a[k]) * b[k];
  return sum;
}

int32_t Dot(const int16_t* a, const int16_t* b, int columns) {
  CV_Assert(columns == kColumns || columns == kFolded);
  return columns == kColumns ? Dot<kColumns>(a, b) : Dot<kFolded>(a, b);
}

int32_t SquareOf(const Descriptors& rows, int row) {
  return Dot(rows.ptr<int16_t>(row), rows.ptr<int16_t>(row), rows.cols);
}

float Distance(int32_t square) { return std::sqrt(static_cast<float>(square)) / kDescriptorLength; }

struct Candidate {
  int32_t square;
  int row;
};

void Offer(const Candidate& one, size_t count, std::vector<Candidate>* nearest) {
  if (nearest->size() == count && one.square >= nearest->back().square) return;
  if (nearest->size() == count) nearest->pop_back();
  const auto behind = [](const Candidate& a, const Candidate& b) { return a.square < b.square; };
  nearest->insert(std::upper_bound(nearest->begin(), nearest->end(), one, behind), one);
}

template <int columns>
std::vector<std::vector<Candidate>> Search(const Descriptors& of, const Descriptors& among,
                                           size_t count) {
  std::vector<int32_t> squares;
  for (int i = 0; i < among.rows; ++i) squares.push_back(SquareOf(among, i));
  std::vector<std::vector<Candidate>> nearest(of.rows);
  for (int first = 0; first < among.rows; first += kBlock) {
    const int end = std::min(among.rows, first + kBlock);
    for (int i = 0; i < of.rows; ++i) {
      const int16_t* const one = of.ptr<int16_t>(i);
      const int32_t square = Dot<columns>(one, one);
      for (int k = first; k < end; ++k) {
        const int32_t dot = Dot<columns>(one, among.ptr<int16_t>(k));
        Offer({square + squares[k] - 2 * dot, k}, count, &nearest[i]);
      }
    }
  }
  return nearest;
}

}  // namespace

Descriptors RootSift(const cv::Mat1f& sift) {
  Descriptors roots(sift.size());
  for (int i = 0; i < sift.rows; ++i) {
    double sum = 0;
    for (int k = 0; k < sift.cols; ++k) sum += sift(i, k);
    // Rounded down, so that no row is longer than said.
    for (int k = 0; k < sift.cols; ++k) {
      roots(i, k) = static_cast<int16_t>(
          kDescriptorLength * std::sqrt(std::max(0.0f, sift(i, k)) / std::max(sum, 1e-6)));
    }
  }
  return roots;
}

Descriptors FoldGradients(const Descriptors& root_sift) {
  Descriptors folded(root_sift.rows, kFolded);
  for (int i = 0; i < root_sift.rows; ++i) {
    for (int cell = 0; cell < 16; ++cell) {
      for (int k = 0; k < 4; ++k) {
        const float a = root_sift(i, 8 * cell + k), b = root_sift(i, 8 * cell + k + 4);
        folded(i, 4 * cell + k) = static_cast<int16_t>(std::sqrt(a * a + b * b));
      }
    }
  }
  return folded;
}

float DescriptorDistance(const Descriptors& of, int a, const Descriptors& among, int b) {
  const int32_t dot = Dot(of.ptr<int16_t>(a), among.ptr<int16_t>(b), of.cols);
  return Distance(SquareOf(of, a) + SquareOf(among, b) - 2 * dot);
}

std::vector<std::vector<NearDescriptor>> FindNearestDescriptors(const Descriptors& of,
                                                                const Descriptors& among,
                                                                int count) {
  CV_Assert(of.cols == among.cols && (of.cols == kColumns || of.cols == kFolded) && count > 0);
  const auto found =
      of.cols == kColumns ? Search<kColumns>(of, among, count) : Search<kFolded>(of, among, count);
  std::vector<std::vector<NearDescriptor>> nearest(found.size());
  for (size_t i = 0; i < found.size(); ++i) {
    for (const Candidate& one : found[i]) {
      nearest[i].push_back({one.row, Distance(one.square)});
    }
  }
  return nearest;
}

}  // namespace roomtex
