#include "texture/tone/response_bracket.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <opencv2/imgproc.hpp>
#include <opencv2/photo.hpp>

#include "core/error.h"
#include "core/output_file.h"
#include "core/photo.h"
#include "core/photo_files.h"

namespace roomtex {
namespace {

struct Bracket {
  std::vector<cv::Mat> photos;  // thinned out: a grid of their pixels
  std::vector<float> seconds;   // relative: what an aperture and ISO of 1 would need
  std::vector<bool> smooth;     // per pixel
};

// Where the 5 x 5 pixels around are alike: a camera moves by a pixel between two exposures.
cv::Mat1b SmoothPlaces(const cv::Mat& photo) {
  cv::Mat grey, low, high, steps;
  cv::cvtColor(photo, grey, cv::COLOR_BGR2GRAY);
  cv::erode(grey, low, cv::Mat::ones(5, 5, CV_8U));
  cv::dilate(grey, high, cv::Mat::ones(5, 5, CV_8U));
  cv::subtract(high, low, steps);
  return steps <= 20;
}

// Single pixels of a grid, not means: a mean of levels is no level of the curve.
std::vector<cv::Point> GridPlaces(const cv::Size& size) {
  std::vector<cv::Point> places;
  const int step = std::max(1, static_cast<int>(std::sqrt(size.area() / 250000.0)));
  for (int y = step / 2; y < size.height; y += step) {
    for (int x = step / 2; x < size.width; x += step) places.emplace_back(x, y);
  }
  return places;
}

Bracket ReadBracket(const std::string& folder) {
  std::vector<std::string> paths = ListPhotoFiles(
      folder, "Give a folder of photos of one still scene, exposed differently", false);
  for (std::string& path : paths) path.insert(0, folder + "/");
  if (paths.size() < 3) {
    throw InputError(folder, "", "holds " + std::to_string(paths.size()) + " photos",
                     "A bracket needs at least three, from too dark to too light");
  }
  Bracket bracket;
  cv::Size size;
  std::vector<cv::Point> places;
  std::vector<bool> smooth;  // in all photos
  for (const std::string& path : paths) {
    const auto exposure = ReadExposureData(path).RelativeExposure();
    if (!exposure) {
      throw InputError(path, "", "notes no exposure time in EXIF",
                       "Take the photos as the camera wrote them, or remove this one");
    }
    const cv::Mat photo = ReadPhoto(path);
    if (places.empty()) {
      size = photo.size();
      places = GridPlaces(size);
      smooth.assign(places.size(), true);
    }
    if (photo.size() != size) {
      throw InputError(path, "", "has another size than the first photo of the bracket",
                       "All must be of one camera in one position");
    }
    const cv::Mat1b is_smooth = SmoothPlaces(photo);
    cv::Mat3b levels(1, static_cast<int>(places.size()));
    for (size_t i = 0; i < places.size(); ++i) {
      levels(0, static_cast<int>(i)) = photo.at<cv::Vec3b>(places[i]);
      smooth[i] = smooth[i] && is_smooth(places[i]) != 0;
    }
    bracket.photos.push_back(levels);
    bracket.seconds.push_back(static_cast<float>(*exposure));
  }
  bracket.smooth = smooth;
  return bracket;
}

// Places of all lightnesses alike: Debevec's method takes a few hundred of them.
void ChoosePlaces(Bracket* bracket) {
  constexpr int kPlaces = 300;
  const cv::Mat& middle = bracket->photos[bracket->photos.size() / 2];
  std::vector<std::pair<int, int>> order;
  for (int i = 0; i < middle.cols; ++i) {
    if (!bracket->smooth[i]) continue;
    int sum = 0;
    for (const cv::Mat& photo : bracket->photos) sum += photo.at<cv::Vec3b>(0, i)[1];
    order.emplace_back(sum, i);
  }
  std::sort(order.begin(), order.end());
  // Even in lightness, not in area: walls would take all.
  std::vector<int> chosen;
  if (!order.empty()) {
    const double low = order.front().first, high = order.back().first;
    size_t at = 0;
    for (int k = 0; k < kPlaces; ++k) {
      const double wanted = low + (high - low) * k / (kPlaces - 1);
      while (at + 1 < order.size() && order[at].first < wanted) ++at;
      chosen.push_back(order[at].second);
    }
    chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
  }
  for (cv::Mat& photo : bracket->photos) {
    cv::Mat3b few(1, static_cast<int>(chosen.size()));
    for (size_t i = 0; i < chosen.size(); ++i) {
      few(0, static_cast<int>(i)) = photo.at<cv::Vec3b>(0, chosen[i]);
    }
    photo = few;
  }
}

}  // namespace

ResponseCurve ResponseFromBracket(const std::string& folder) {
  Bracket bracket = ReadBracket(folder);
  const auto [shortest, longest] =
      std::minmax_element(bracket.seconds.begin(), bracket.seconds.end());
  if (!(*longest >= 3.9f * *shortest)) {
    throw InputError(folder, "", "the exposures in EXIF span less than two EV",
                     "A bracket goes from too dark to too light");
  }
  ChoosePlaces(&bracket);
  constexpr int kFewest = 50;
  if (bracket.photos[0].cols < kFewest) {
    throw InputError(folder, "", "the photos show too few smooth places of different lightness",
                     "Take a scene with dark and light even surfaces, in focus or not");
  }
  cv::Mat curve;
  constexpr float kSmoothness = 20;
  cv::createCalibrateDebevec(bracket.photos[0].cols, kSmoothness, false)
      ->process(bracket.photos, curve, bracket.seconds);
  // Cameras have one curve for all channels: its logarithm's mean.
  std::array<double, ResponseCurve::kLevels> logs{};
  for (int level = 0; level < ResponseCurve::kLevels; ++level) {
    const auto& bgr = curve.at<cv::Vec3f>(level);
    for (int k = 0; k < 3; ++k) logs[level] += std::log(std::max(bgr[k], 1e-9f)) / 3;
  }
  // The lightest levels are clipped light for the most part, of any amount: the curve goes on
  // straight.
  constexpr int kLast = 245, kBefore = 230;
  const double slope = (logs[kLast] - logs[kBefore]) / (kLast - kBefore);
  ResponseCurve::Table table{};
  for (int level = 0; level < ResponseCurve::kLevels; ++level) {
    const double log_light = level > kLast ? logs[kLast] + slope * (level - kLast) : logs[level];
    table[level].fill(static_cast<float>(std::exp(log_light)));
  }
  table[0].fill(0);
  return ResponseCurve(table);
}

}  // namespace roomtex
