#pragma once
// A short vector per photo: photos that show the same things have similar ones. VLAD (Jegou et al.
// 2012: residuals of SIFT descriptors to visual words, aggregated) with words learned from the
// photos themselves, normalised per word (Arandjelovic and Zisserman 2013) and by the square root,
// centred, projected onto principal axes and whitened in part (Jegou and Chum 2012). Nothing is
// downloaded.

#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

namespace roomtex {

// 128 x n, columns are SIFT descriptors of length 1; bytes: 128 each.
Eigen::MatrixXf UnitDescriptors(const std::vector<uint8_t>& bytes);

// Visual words, 128 x num_words: k-means of the columns. Fewer words than asked for where there are
// fewer descriptors. Same seed, same words.
Eigen::MatrixXf LearnWords(const Eigen::MatrixXf& descriptors, int num_words, uint64_t seed);

// The VLAD of one photo, words.size() numbers, length 1; all 0 without descriptors.
Eigen::VectorXf AggregateDescriptors(const Eigen::MatrixXf& descriptors,
                                     const Eigen::MatrixXf& words);

// What makes VLADs short.
struct SignatureAxes {
  Eigen::VectorXf mean;
  Eigen::MatrixXf axes;  // rows: principal axes, whitened in part
  // Length 1; 0 if vlad is.
  Eigen::VectorXf Shorten(const Eigen::VectorXf& vlad) const;
};
// From VLADs, columns; at most max_dimensions axes.
SignatureAxes LearnAxes(const Eigen::MatrixXf& vlads, int max_dimensions);

struct SimilarPhoto {
  int photo = 0;
  float similarity = 0;  // cosine, -1 .. 1
};

// Of every column the `count` most similar others that `accepts(column, other)`, best first (equal
// ones by their number); of `columns` only, in their order. signatures: columns of length 1 or 0.
// Costs the square of the number of columns, but 1 multiplication per dimension only: `accepts` is
// asked for those alone that would be among the best so far. It is called by several threads.
using AcceptsSimilar = std::function<bool(int column, int other)>;
std::vector<std::vector<SimilarPhoto>> MostSimilarOf(const std::vector<int>& columns,
                                                     const Eigen::MatrixXf& signatures, int count,
                                                     int num_threads,
                                                     const AcceptsSimilar& accepts);
// The same for all columns; those of length 0 have none and are nobody's.
std::vector<std::vector<SimilarPhoto>> MostSimilar(const Eigen::MatrixXf& signatures, int count,
                                                   int num_threads);

}  // namespace roomtex
