#include "tests/benchmark/held_out/picture_sheet.h"

#include <algorithm>
#include <filesystem>

#include <opencv2/imgproc.hpp>

namespace roomtex {
namespace {

constexpr int kPlacesPerPhoto = 2;
constexpr int kPanel = 320, kGap = 6, kTitle = 28;  // pixels of the sheet
constexpr double kSeenShare = 0.9;

void Write(const std::string& text, int x, int y, cv::Mat3b* sheet) {
  cv::putText(*sheet, text, {x, y}, cv::FONT_HERSHEY_SIMPLEX, 0.55, {0, 0, 0}, 1, cv::LINE_AA);
}

cv::Mat1d GradientEnergies(const cv::Mat3b& photo) {
  cv::Mat1b grey;
  cv::cvtColor(photo, grey, cv::COLOR_BGR2GRAY);
  cv::Mat1d dx, dy;
  cv::Sobel(grey, dx, CV_64F, 1, 0);
  cv::Sobel(grey, dy, CV_64F, 0, 1);
  return dx.mul(dx) + dy.mul(dy);
}

}  // namespace

std::vector<cv::Rect> RichestSquares(const cv::Mat3b& photo, const cv::Mat1b& seen, int count) {
  const int size = std::min({photo.cols / 4, photo.rows, kPanel});
  const int step = std::max(1, size / 4);
  const cv::Mat1d energies = GradientEnergies(photo);
  std::vector<std::pair<double, cv::Rect>> squares;
  for (int y = 0; size > 0 && y + size <= photo.rows; y += step) {
    for (int x = 0; x + size <= photo.cols; x += step) {
      const cv::Rect square(x, y, size, size);
      if (cv::countNonZero(seen(square)) < kSeenShare * square.area()) continue;
      squares.emplace_back(cv::sum(energies(square))[0], square);
    }
  }
  std::stable_sort(squares.begin(), squares.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<cv::Rect> chosen;
  for (const auto& [energy, square] : squares) {
    if (static_cast<int>(chosen.size()) == count) break;
    const cv::Rect& here = square;
    if (std::none_of(chosen.begin(), chosen.end(),
                     [&](const cv::Rect& other) { return (other & here).area() > 0; })) {
      chosen.push_back(square);
    }
  }
  return chosen;
}

void PictureSheet::Add(const std::string& method, const std::string& photo_name,
                       const cv::Mat3b& photo, const Prediction& prediction) {
  if (std::find(methods_.begin(), methods_.end(), method) == methods_.end()) {
    methods_.push_back(method);
  }
  if (method == methods_.front()) {
    const cv::Mat1d energies = GradientEnergies(photo);
    int rank = 0;
    for (const cv::Rect& square : RichestSquares(photo, prediction.seen, kPlacesPerPhoto)) {
      places_.push_back({photo_name,
                         square,
                         cv::mean(energies(square))[0],
                         rank++,
                         {cv::Mat3b(photo(square).clone())}});
    }
  }
  const cv::Mat3b picture = WithPhotoGains(prediction, photo);
  for (Place& place : places_) {
    if (place.photo_name == photo_name) place.panels.push_back(picture(place.square).clone());
  }
}

cv::Mat3b PictureSheet::Draw(int count) const {
  std::vector<const Place*> order;
  for (const Place& place : places_) order.push_back(&place);
  std::stable_sort(order.begin(), order.end(), [](const Place* a, const Place* b) {
    return a->rank != b->rank ? a->rank < b->rank : a->energy > b->energy;
  });
  order.resize(std::min(order.size(), static_cast<size_t>(std::max(count, 0))));
  if (order.empty()) return {};
  const int num_columns = static_cast<int>(methods_.size()) + 1;
  cv::Mat3b sheet(static_cast<int>(order.size()) * (kPanel + kTitle) + kTitle,
                  num_columns * (kPanel + kGap) + kGap, cv::Vec3b(255, 255, 255));
  for (int column = 0; column < num_columns; ++column) {
    Write(column == 0 ? "photo" : methods_[column - 1], kGap + column * (kPanel + kGap), 20,
          &sheet);
  }
  for (size_t row = 0; row < order.size(); ++row) {
    const Place& place = *order[row];
    const int y = kTitle + static_cast<int>(row) * (kPanel + kTitle);
    for (size_t column = 0; column < place.panels.size(); ++column) {
      const int x = kGap + static_cast<int>(column) * (kPanel + kGap);
      cv::Mat target = sheet(cv::Rect(x, y, kPanel, kPanel));
      cv::resize(place.panels[column], target, target.size(), 0, 0, cv::INTER_CUBIC);
    }
    Write(std::filesystem::path(place.photo_name).filename().string() + ", " +
              std::to_string(place.square.width) + " pixels at " + std::to_string(place.square.x) +
              ", " + std::to_string(place.square.y),
          kGap, y + kPanel + 20, &sheet);
  }
  return sheet;
}

}  // namespace roomtex
