#include "tests/support/color_comparison.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/photo.h"
#include "core/picture_file.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

using Bytes = Eigen::Matrix<uint8_t, 3, 1>;

// Median of the ratios, so that wrong vertices do not pull it.
double FindGain(const std::vector<Bytes>& truth, const PlyVertices& model,
                const std::vector<size_t>& colored) {
  const auto& linear = LinearFromSrgbByte();
  std::vector<double> ratios;
  for (const size_t i : colored) {
    double want = 0, have = 0;
    for (int k = 0; k < 3; ++k) {
      want += linear[truth[i][k]];
      have += linear[model.colors[i][k]];
    }
    if (have > 0.05) ratios.push_back(want / have);
  }
  return ratios.empty() ? 1 : Median(ratios);
}

// Sums over vertices.
struct Errors {
  double squares = 0;
  size_t count = 0, wrong = 0;
  void Add(const Eigen::Vector3f& difference) {
    squares += difference.squaredNorm();
    ++count;
    wrong += difference.cwiseAbs().maxCoeff() > ColorMeasures::kWrong;
  }
  double Psnr() const { return -10 * std::log10(squares / (3.0 * static_cast<double>(count))); }
  double ShareWrong() const { return static_cast<double>(wrong) / static_cast<double>(count); }
};

// Gaussian mean over the samples where weight is 1.
cv::Mat MaskedMean(const cv::Mat3f& values, const cv::Mat1f& weight, double sigma) {
  cv::Mat weights3, sum, sum_of_weights;
  cv::merge(std::vector<cv::Mat>{weight, weight, weight}, weights3);
  cv::GaussianBlur(values.mul(weights3), sum, {0, 0}, sigma);
  cv::GaussianBlur(weights3, sum_of_weights, {0, 0}, sigma);
  return sum / cv::max(sum_of_weights, 1e-6);
}

// One scan's vertices on its grid.
struct GridOfColors {
  cv::Mat3f have, want;  // sRGB 0..1
  cv::Mat1f colored;     // 1 or 0
  cv::Mat1b near_edge;

  GridOfColors(int rows, int columns)
      : have(rows, columns, cv::Vec3f(0, 0, 0)),
        want(rows, columns, cv::Vec3f(0, 0, 0)),
        colored(rows, columns, 0.0f),
        near_edge(rows, columns, uint8_t{0}) {}
};

struct DetailSums {
  double tt = 0, tr = 0, rr = 0, low_squares = 0;
  size_t num_low = 0;

  void Add(const GridOfColors& grid) {
    cv::Mat1f smooth = grid.colored.clone();
    smooth.setTo(0, grid.near_edge);
    const cv::Mat3f want_high =
        grid.want - MaskedMean(grid.want, smooth, ColorMeasures::kDetailSigma);
    const cv::Mat3f have_high =
        grid.have - MaskedMean(grid.have, smooth, ColorMeasures::kDetailSigma);
    const cv::Mat3f low = MaskedMean(grid.have - grid.want, grid.colored, ColorMeasures::kLowSigma);
    for (int row = 0; row < smooth.rows; ++row) {
      for (int column = 0; column < smooth.cols; ++column) {
        if (grid.colored(row, column) == 0) continue;
        low_squares += low(row, column).dot(low(row, column));
        ++num_low;
        if (smooth(row, column) == 0) continue;
        const cv::Vec3f &t = want_high(row, column), &r = have_high(row, column);
        tt += t.dot(t);
        tr += t.dot(r);
        rr += r.dot(r);
      }
    }
  }
  double LowError() const { return std::sqrt(low_squares / (3.0 * static_cast<double>(num_low))); }
};

}  // namespace

std::vector<uint8_t> NearDepthEdges(const Scan& scan) {
  cv::Mat1b jumps(scan.num_rows, scan.num_columns, uint8_t{0});
  const auto range = [&scan](int index) { return (scan.points[index] - scan.Station()).norm(); };
  const auto mark = [&](int row, int column, int other_row, int other_column) {
    const double a = range(scan.Index(column, row)), b = range(scan.Index(other_column, other_row));
    if (std::abs(a - b) <= ColorMeasures::kJump * std::min(a, b)) return;  // false for NaN
    jumps(row, column) = jumps(other_row, other_column) = 1;
  };
  for (int row = 0; row < scan.num_rows; ++row) {
    for (int column = 0; column < scan.num_columns; ++column) {
      if (column + 1 < scan.num_columns) mark(row, column, row, column + 1);
      if (row + 1 < scan.num_rows) mark(row, column, row + 1, column);
    }
  }
  // The jump's own two samples are the first ones beside it.
  cv::dilate(jumps, jumps, cv::Mat(), {-1, -1}, ColorMeasures::kEdgeSamples - 1);
  return {jumps.begin(), jumps.end()};
}

Json CompareColors(const PlyVertices& truth, const PlyVertices& model,
                   const std::vector<Scan>& scans, bool of_cells, const std::string& model_path,
                   const std::string& error_path) {
  if (truth.points.size() != model.points.size()) {
    throw InputError(model_path, "",
                     "has " + std::to_string(model.points.size()) + " vertices, the truth has " +
                         std::to_string(truth.points.size()),
                     "Both must come from the same scan, in grid order");
  }
  if (model.colors.empty())
    throw InputError(model_path, "", "has no colours", "Expected red, green, blue per vertex");
  const std::vector<Bytes>& true_colors = of_cells ? truth.cell_colors : truth.colors;
  double farthest = 0;
  std::vector<size_t> colored;
  size_t num_seen = 0, num_seen_colored = 0;
  for (size_t i = 0; i < truth.points.size(); ++i) {
    farthest = std::max(farthest, static_cast<double>((truth.points[i] - model.points[i]).norm()));
    const bool has_color = model.views.empty() || model.views[i] > 0;
    if (has_color) colored.push_back(i);
    if (truth.views.empty() || truth.views[i] == 0) continue;
    ++num_seen;
    num_seen_colored += has_color;
  }
  const double gain = FindGain(true_colors, model, colored);
  const auto& linear = LinearFromSrgbByte();
  std::array<std::array<float, 256>, 2> value;  // sRGB 0..1 of a byte: the model's, the truth's
  for (int byte = 0; byte < 256; ++byte) {
    value[0][byte] = static_cast<float>(SrgbFromLinear(std::min(1.0, gain * linear[byte])));
    value[1][byte] = static_cast<float>(byte) / 255.0f;
  }
  const auto values = [&value](int which, const Bytes& bytes) {
    return Eigen::Vector3f(value[which][bytes[0]], value[which][bytes[1]], value[which][bytes[2]]);
  };
  Errors all, unseen;
  double linear_squares = 0;
  std::vector<double> differences;
  for (const size_t i : colored) {
    const Eigen::Vector3f difference = values(0, model.colors[i]) - values(1, true_colors[i]);
    all.Add(difference);
    if (!truth.views.empty() && truth.views[i] == 0) unseen.Add(difference);
    differences.push_back(difference.cwiseAbs().maxCoeff());
    for (int k = 0; k < 3; ++k) {
      const double light = std::min(1.0, gain * linear[model.colors[i][k]]);
      linear_squares += std::pow(light - linear[true_colors[i][k]], 2);
    }
  }
  const auto count = static_cast<double>(colored.size());
  Json json = Json::object();
  json["num_vertices"] = truth.points.size();
  json["num_colored"] = colored.size();
  json["coverage"] = truth.points.empty() ? 0 : count / static_cast<double>(truth.points.size());
  if (num_seen > 0) {
    json["coverage_of_seen"] =
        static_cast<double>(num_seen_colored) / static_cast<double>(num_seen);
    json["colored_but_unseen"] = static_cast<double>(unseen.count) / count;
    json["wrong_and_unseen"] = static_cast<double>(unseen.wrong) / count;
  }
  json["gain"] = gain;
  json["psnr_db"] = all.Psnr();  // sRGB values, peak 1
  json["psnr_linear_db"] = -10 * std::log10(linear_squares / (3 * count));
  json["median_difference"] = Median(differences, std::nan(""));  // largest channel, sRGB 0..1
  json["share_wrong"] = all.ShareWrong();
  json["vertex_distance_max_m"] = farthest;
  if (scans.empty()) return json;

  Errors edges;
  DetailSums detail;
  size_t vertex = 0, next_colored = 0;
  for (const Scan& scan : scans) {
    const std::vector<uint8_t> near_edge = NearDepthEdges(scan);
    GridOfColors grid(scan.num_rows, scan.num_columns);
    cv::Mat1b error(scan.num_rows, scan.num_columns, uint8_t{0});
    std::copy(near_edge.begin(), near_edge.end(), grid.near_edge.begin());
    for (size_t i = 0; i < scan.points.size(); ++i) {
      if (scan.IsMissing(static_cast<int>(i))) continue;
      if (vertex >= truth.points.size())
        throw InputError(scan.path, "", "has more samples than the truth", "Give its own scan");
      const size_t v = vertex++;
      if (next_colored == colored.size() || colored[next_colored] != v) continue;
      ++next_colored;
      const Eigen::Vector3f have = values(0, model.colors[v]), want = values(1, true_colors[v]);
      if (near_edge[i] != 0) edges.Add(have - want);
      const int row = static_cast<int>(i) / scan.num_columns;
      const int column = static_cast<int>(i) % scan.num_columns;
      grid.have(row, column) = {have[0], have[1], have[2]};
      grid.want(row, column) = {want[0], want[1], want[2]};
      grid.colored(row, column) = 1;
      error(row, column) =
          cv::saturate_cast<uint8_t>(5 * 255 * (have - want).cwiseAbs().maxCoeff());
    }
    detail.Add(grid);
    if (!error_path.empty() && &scan == &scans[0]) WritePictureFile(error_path, error);
  }
  json["edge_share"] = static_cast<double>(edges.count) / count;
  json["edge_share_wrong"] = edges.ShareWrong();
  json["edge_psnr_db"] = edges.Psnr();
  json["detail_slope"] = detail.tr / detail.tt;
  json["detail_correlation"] = detail.tr / std::sqrt(detail.tt * detail.rr);
  json["low_frequency_error"] = detail.LowError();
  return json;
}

}  // namespace roomtex
