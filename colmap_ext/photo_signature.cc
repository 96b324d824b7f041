#include "colmap_ext/photo_signature.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Eigenvalues>

#include "colmap_ext/database.h"
#include "colmap_ext/ransac.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

constexpr int kWordIterations = 10;
// 1/2 whitens, 0 leaves the axes as they are. Chosen on rooms, docs/pairs.md.
constexpr float kWhitening = 0.25f;
// Blocks of photos are compared with tiles of all: products of a thread take 1 MB.
constexpr int kPhotosPerBlock = 64, kPhotosPerTile = 4096;

// The nearest word of every descriptor.
std::vector<int> NearestWords(const Eigen::MatrixXf& descriptors, const Eigen::MatrixXf& words) {
  const Eigen::VectorXf half_squares = 0.5f * words.colwise().squaredNorm().transpose();
  std::vector<int> nearest(static_cast<size_t>(descriptors.cols()));
  constexpr Eigen::Index kBlock = 1024;
  for (Eigen::Index first = 0; first < descriptors.cols(); first += kBlock) {
    const Eigen::Index count = std::min(kBlock, descriptors.cols() - first);
    const Eigen::MatrixXf products = words.transpose() * descriptors.middleCols(first, count);
    for (Eigen::Index i = 0; i < count; ++i) {
      Eigen::Index word = 0;
      (products.col(i) - half_squares).maxCoeff(&word);
      nearest[static_cast<size_t>(first + i)] = static_cast<int>(word);
    }
  }
  return nearest;
}

void Normalise(Eigen::Ref<Eigen::VectorXf> vector) {
  const float length = vector.norm();
  if (length > 0) vector /= length;
}

// Puts the next one, whose number is larger than those before, among the best if it belongs there.
void KeepBest(const SimilarPhoto& next, size_t count, std::vector<SimilarPhoto>* best) {
  if (best->size() == count) best->pop_back();
  best->insert(std::upper_bound(best->begin(), best->end(), next,
                                [](const SimilarPhoto& a, const SimilarPhoto& b) {
                                  return a.similarity > b.similarity;
                                }),
               next);
}

}  // namespace

Eigen::MatrixXf UnitDescriptors(const std::vector<uint8_t>& bytes) {
  const auto count = static_cast<Eigen::Index>(bytes.size() / kSiftSize);
  Eigen::MatrixXf descriptors =
      Eigen::Map<const Eigen::Matrix<uint8_t, Eigen::Dynamic, Eigen::Dynamic>>(bytes.data(),
                                                                               kSiftSize, count)
          .cast<float>();
  for (Eigen::Index i = 0; i < count; ++i) Normalise(descriptors.col(i));
  return descriptors;
}

Eigen::MatrixXf LearnWords(const Eigen::MatrixXf& descriptors, int num_words, uint64_t seed) {
  const std::vector<int> chosen =
      RandomSubset(static_cast<int>(descriptors.cols()), num_words, seed);
  Eigen::MatrixXf words(descriptors.rows(), static_cast<Eigen::Index>(chosen.size()));
  for (size_t i = 0; i < chosen.size(); ++i) {
    words.col(static_cast<Eigen::Index>(i)) = descriptors.col(chosen[i]);
  }
  for (int iteration = 0; iteration < kWordIterations; ++iteration) {
    const std::vector<int> nearest = NearestWords(descriptors, words);
    Eigen::MatrixXf sums = Eigen::MatrixXf::Zero(words.rows(), words.cols());
    Eigen::VectorXf counts = Eigen::VectorXf::Zero(words.cols());
    for (size_t i = 0; i < nearest.size(); ++i) {
      sums.col(nearest[i]) += descriptors.col(static_cast<Eigen::Index>(i));
      counts[nearest[i]] += 1;
    }
    for (Eigen::Index word = 0; word < words.cols(); ++word) {
      if (counts[word] > 0) words.col(word) = sums.col(word) / counts[word];
    }
  }
  return words;
}

Eigen::VectorXf AggregateDescriptors(const Eigen::MatrixXf& descriptors,
                                     const Eigen::MatrixXf& words) {
  Eigen::MatrixXf sums = Eigen::MatrixXf::Zero(words.rows(), words.cols());
  const std::vector<int> nearest = NearestWords(descriptors, words);
  for (size_t i = 0; i < nearest.size(); ++i) {
    sums.col(nearest[i]) += descriptors.col(static_cast<Eigen::Index>(i)) - words.col(nearest[i]);
  }
  for (Eigen::Index word = 0; word < words.cols(); ++word) Normalise(sums.col(word));
  Eigen::VectorXf vlad = Eigen::Map<const Eigen::VectorXf>(sums.data(), sums.size());
  vlad = vlad.array().sign() * vlad.array().abs().sqrt();
  Normalise(vlad);
  return vlad;
}

Eigen::VectorXf SignatureAxes::Shorten(const Eigen::VectorXf& vlad) const {
  if (vlad.isZero(0)) return Eigen::VectorXf::Zero(axes.rows());
  Eigen::VectorXf signature = axes * (vlad - mean);
  Normalise(signature);
  return signature;
}

SignatureAxes LearnAxes(const Eigen::MatrixXf& vlads, int max_dimensions) {
  SignatureAxes result;
  result.mean = vlads.rowwise().mean();
  const Eigen::MatrixXf centred = vlads.colwise() - result.mean;
  // The axes through the products of the photos, which are fewer than the numbers of a VLAD.
  const Eigen::MatrixXf products = centred.transpose() * centred;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXf> solver(products);
  const Eigen::VectorXf values = solver.eigenvalues();  // ascending
  const Eigen::Index most = std::min<Eigen::Index>(max_dimensions, values.size());
  const float least = 1e-5f * std::max(values.size() > 0 ? values[values.size() - 1] : 0.0f, 1e-9f);
  Eigen::Index count = 0;
  while (count < most && values[values.size() - 1 - count] > least) ++count;
  result.axes.resize(count, vlads.rows());
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::Index from = values.size() - 1 - i;
    const float whiten = std::pow(values[from], -0.5f - kWhitening);
    result.axes.row(i) = (centred * solver.eigenvectors().col(from)).transpose() * whiten;
  }
  return result;
}

std::vector<std::vector<SimilarPhoto>> MostSimilarOf(const std::vector<int>& columns,
                                                     const Eigen::MatrixXf& signatures, int count,
                                                     int num_threads,
                                                     const AcceptsSimilar& accepts) {
  const auto num_asking = static_cast<int>(columns.size());
  const auto num_photos = static_cast<int>(signatures.cols());
  std::vector<std::vector<SimilarPhoto>> similar(columns.size());
  if (count <= 0) return similar;
  const auto most = static_cast<size_t>(count);
  const int num_blocks = (num_asking + kPhotosPerBlock - 1) / kPhotosPerBlock;
  ParallelFor(num_threads, 0, num_blocks, [&](int block) {
    const int begin = block * kPhotosPerBlock;
    const int end = std::min(num_asking, begin + kPhotosPerBlock);
    Eigen::MatrixXf asking(signatures.rows(), end - begin);
    for (int i = begin; i < end; ++i) {
      asking.col(i - begin) = signatures.col(columns[static_cast<size_t>(i)]);
    }
    for (int first = 0; first < num_photos; first += kPhotosPerTile) {
      const int size = std::min(kPhotosPerTile, num_photos - first);
      const Eigen::MatrixXf products = signatures.middleCols(first, size).transpose() * asking;
      for (int i = begin; i < end; ++i) {
        const int column = columns[static_cast<size_t>(i)];
        std::vector<SimilarPhoto>& best = similar[static_cast<size_t>(i)];
        for (int k = 0; k < size; ++k) {
          const SimilarPhoto next{first + k, products(k, i - begin)};
          if (best.size() == most && !(next.similarity > best.back().similarity)) continue;
          if (next.photo == column || !accepts(column, next.photo)) continue;
          KeepBest(next, most, &best);
        }
      }
    }
  });
  return similar;
}

std::vector<std::vector<SimilarPhoto>> MostSimilar(const Eigen::MatrixXf& signatures, int count,
                                                   int num_threads) {
  const Eigen::VectorXf squares = signatures.colwise().squaredNorm().transpose();
  std::vector<int> all(static_cast<size_t>(signatures.cols()));
  std::iota(all.begin(), all.end(), 0);
  return MostSimilarOf(all, signatures, count, num_threads, [&](int column, int other) {
    return squares[column] > 0 && squares[other] > 0;
  });
}

}  // namespace roomtex
