#include "align/pick/scan_picture.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <opencv2/imgproc.hpp>

namespace roomtex {
namespace {

const cv::Scalar kMissing(70, 35, 20);  // as the overlays draw it
// "local": half the window over the height of the picture; grey levels per standard deviation; and
// the contrast below which differences are taken for noise, as a share of the picture's own.
constexpr double kWindowShare = 0.05;
constexpr double kContrast = 52;
constexpr double kNoiseShare = 0.15;
// "shaded": samples on either side that a normal rests on, and the light beside the viewer.
constexpr int kNormalReach = 2;
constexpr float kLightRight = 0.4f, kLightUp = 0.3f;
constexpr float kDarkest = 45, kBrightest = 245;

cv::Mat1b MeasuredMask(const ScanPlaces& places) {
  cv::Mat1b mask(places.height(), places.width());
  for (int row = 0; row < mask.rows; ++row) {
    for (int column = 0; column < mask.cols; ++column) {
      mask(row, column) = places.scan().IsMissing(places.SampleAt(column, row)) ? 0 : 255;
    }
  }
  return mask;
}

cv::Mat AsPicture(const cv::Mat& grey, const cv::Mat1b& mask) {
  cv::Mat grey8, picture;
  grey.convertTo(grey8, CV_8U);
  cv::cvtColor(grey8, picture, cv::COLOR_GRAY2BGR);
  picture.setTo(kMissing, mask == 0);
  return picture;
}

cv::Mat DrawIntensity(const ScanPlaces& places) {
  const std::vector<uint8_t> values = IntensityAsGrey(places.scan());
  cv::Mat1b grey(places.height(), places.width());
  for (int row = 0; row < grey.rows; ++row) {
    for (int column = 0; column < grey.cols; ++column) {
      grey(row, column) = values[places.SampleAt(column, row)];
    }
  }
  return AsPicture(grey, MeasuredMask(places));
}

// Mean over the measured samples of a window; around a closed picture.
cv::Mat1f LocalMean(const cv::Mat1f& values, const cv::Mat1f& weights, int reach, bool closed) {
  const auto sum_of = [&](const cv::Mat1f& addends) {
    cv::Mat1f padded, sum;
    cv::copyMakeBorder(addends, padded, 0, 0, reach, reach,
                       closed ? cv::BORDER_WRAP : cv::BORDER_REFLECT);
    cv::boxFilter(padded, sum, CV_32F, cv::Size(2 * reach + 1, 2 * reach + 1), {-1, -1}, true,
                  cv::BORDER_REFLECT);
    return cv::Mat1f(sum.colRange(reach, reach + addends.cols));
  };
  cv::Mat1f mean;
  cv::divide(sum_of(values.mul(weights)), cv::max(sum_of(weights), 1e-6), mean);
  return mean;
}

float Finite(float value) { return std::isfinite(value) ? value : 0; }

cv::Mat DrawLocal(const ScanPlaces& places) {
  // The root of the intensity itself: grey levels of 8 bits have too few steps in the dark.
  cv::Mat1f values(places.height(), places.width());
  for (int row = 0; row < values.rows; ++row) {
    for (int column = 0; column < values.cols; ++column) {
      values(row, column) =
          std::sqrt(std::max(0.0f, Finite(places.scan().intensity[places.SampleAt(column, row)])));
    }
  }
  const cv::Mat1b mask = MeasuredMask(places);
  cv::Mat1f weights;
  mask.convertTo(weights, CV_32F, 1 / 255.0);
  const int reach = std::min(std::max(4, static_cast<int>(kWindowShare * places.height())),
                             std::max(places.width() - 1, 0));
  const cv::Mat1f mean = LocalMean(values, weights, reach, places.closed());
  const cv::Mat1f difference = values - mean;
  cv::Mat1f deviation;
  cv::sqrt(LocalMean(difference.mul(difference), weights, reach, places.closed()), deviation);
  const double overall = cv::mean(deviation, mask)[0];
  const cv::Mat grey = 128 + kContrast * difference / (deviation + kNoiseShare * overall + 1e-9);
  return AsPicture(grey, mask);
}

// Unit normal towards the scanner from the samples around one; zero where it cannot be told.
Eigen::Vector3f NormalAt(const ScanPlaces& places, int column, int row) {
  const Scan& scan = places.scan();
  const auto difference = [&](int dc, int dr) -> Eigen::Vector3d {
    Eigen::Vector3d ends[2];
    for (int k = 0; k < 2; ++k) {
      const int sign = k == 0 ? -1 : 1;
      int c = column + sign * dc;
      if (places.closed()) c = (c + places.width()) % places.width();
      c = std::clamp(c, 0, places.width() - 1);
      const int r = std::clamp(row + sign * dr, 0, places.height() - 1);
      ends[k] = scan.points[places.SampleAt(c, r)];
    }
    return ends[1] - ends[0];
  };
  // x right, y down, towards the viewer = down x right.
  const Eigen::Vector3d normal = difference(0, kNormalReach).cross(difference(kNormalReach, 0));
  const double length = normal.norm();
  if (!(length > 0)) return Eigen::Vector3f::Zero();  // NaN as well
  return (normal / length).cast<float>();
}

// Beside a single sample that is missing a surface goes on: only where there is no such gap is a
// sample that is not smooth the rim of something.
bool IsBesideGap(const ScanPlaces& places, int column, int row) {
  for (int r = std::max(row - 1, 0); r <= std::min(row + 1, places.height() - 1); ++r) {
    for (int c = std::max(column - 1, 0); c <= std::min(column + 1, places.width() - 1); ++c) {
      if (places.scan().IsMissing(places.SampleAt(c, r))) return true;
    }
  }
  return false;
}

cv::Mat DrawShaded(const ScanPlaces& places) {
  const Scan& scan = places.scan();
  cv::Mat3f normals(places.height(), places.width());
  for (int row = 0; row < normals.rows; ++row) {
    for (int column = 0; column < normals.cols; ++column) {
      const int sample = places.SampleAt(column, row);
      const Eigen::Vector3f n =
          places.IsSmooth(sample) ? NormalAt(places, column, row) : Eigen::Vector3f::Zero();
      normals(row, column) = {n.x(), n.y(), n.z()};
    }
  }
  cv::boxFilter(normals, normals, CV_32F, {5, 5}, {-1, -1}, true, cv::BORDER_REPLICATE);
  const Eigen::Vector3f up = scan.up.cast<float>();
  cv::Mat1f grey(normals.size(), 0.0f);
  for (int row = 0; row < grey.rows; ++row) {
    for (int column = 0; column < grey.cols; ++column) {
      const int sample = places.SampleAt(column, row);
      if (scan.IsMissing(sample)) continue;
      if (!places.IsSmooth(sample) && !IsBesideGap(places, column, row)) continue;  // black
      const cv::Vec3f v = normals(row, column);
      const Eigen::Vector3f n(v[0], v[1], v[2]);
      const float length = n.norm();
      if (!(length > 0.1f)) continue;
      const Eigen::Vector3f view =
          (scan.Station() - scan.points[sample]).normalized().cast<float>();
      const Eigen::Vector3f right = up.cross(view).stableNormalized();
      const Eigen::Vector3f light = (view + kLightRight * right + kLightUp * up).normalized();
      const float shade = std::max(0.0f, n.dot(light) / length);
      grey(row, column) = kDarkest + (kBrightest - kDarkest) * shade;
    }
  }
  return AsPicture(grey, MeasuredMask(places));
}

}  // namespace

const std::vector<std::string>& ScanPictureNames() {
  static const std::vector<std::string> names = {"intensity", "local", "shaded"};
  return names;
}

std::vector<std::string> ScanPicturesOf(const Scan& scan) {
  float low = std::numeric_limits<float>::infinity(), high = -low;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (scan.IsMissing(static_cast<int>(i)) || !std::isfinite(scan.intensity[i])) continue;
    low = std::min(low, scan.intensity[i]);
    high = std::max(high, scan.intensity[i]);
  }
  if (!(low < high)) return {"shaded"};  // alike, or none
  return ScanPictureNames();
}

cv::Mat DrawScanPicture(const ScanPlaces& places, const std::string& name) {
  if (name == "intensity") return DrawIntensity(places);
  if (name == "local") return DrawLocal(places);
  if (name == "shaded") return DrawShaded(places);
  return {};
}

}  // namespace roomtex
