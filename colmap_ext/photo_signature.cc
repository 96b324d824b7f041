#include "colmap_ext/photo_signature.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "colmap_ext/database.h"
#include "colmap_ext/ransac.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

constexpr int kWordIterations = 10;
// 1/2 whitens, 0 leaves the axes as they are. Chosen on rooms, docs/pairs.md.
constexpr float kWhitening = 0.25f;
constexpr int kPhotosPerBlock = 256;

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

std::vector<std::vector<SimilarPhoto>> MostSimilar(const Eigen::MatrixXf& signatures, int count,
                                                   int num_threads) {
  const auto num_photos = static_cast<int>(signatures.cols());
  std::vector<std::vector<SimilarPhoto>> similar(static_cast<size_t>(num_photos));
  const Eigen::VectorXf squares = signatures.colwise().squaredNorm().transpose();
  const int num_blocks = (num_photos + kPhotosPerBlock - 1) / kPhotosPerBlock;
  ParallelFor(num_threads, 0, num_blocks, [&](int block) {
    const int begin = block * kPhotosPerBlock;
    const int end = std::min(num_photos, begin + kPhotosPerBlock);
    const Eigen::MatrixXf products =
        signatures.transpose() * signatures.middleCols(begin, end - begin);
    for (int photo = begin; photo < end; ++photo) {
      if (squares[photo] == 0) continue;
      std::vector<SimilarPhoto> others;
      others.reserve(static_cast<size_t>(num_photos));
      for (int other = 0; other < num_photos; ++other) {
        if (other != photo && squares[other] > 0) {
          others.push_back({other, products(other, photo - begin)});
        }
      }
      const size_t kept = std::min(others.size(), static_cast<size_t>(std::max(0, count)));
      std::partial_sort(others.begin(), others.begin() + static_cast<std::ptrdiff_t>(kept),
                        others.end(), [](const SimilarPhoto& a, const SimilarPhoto& b) {
                          return a.similarity != b.similarity ? a.similarity > b.similarity
                                                              : a.photo < b.photo;
                        });
      others.resize(kept);
      others.shrink_to_fit();
      similar[static_cast<size_t>(photo)] = std::move(others);
    }
  });
  return similar;
}

}  // namespace roomtex
