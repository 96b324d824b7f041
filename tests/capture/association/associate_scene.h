#pragma once
// Photos of a bare-walled simulated room as a team takes them: the same place with and without
// projected light, the camera bumped or not.

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "capture/pattern/pattern.h"
#include "capture/simulation/simulated_room.h"
#include "core/frames.h"
#include "core/photo.h"
#include "core/random_stream.h"

namespace roomtex {

struct Take {
  bool patterned = false;
  bool second_projector = false;    // throws its pattern as well
  double shift_x = 0, shift_y = 0;  // pixels by which the picture has moved
  double roll_deg = 0;              // about the middle
  double ev = 0;
  double noise = 1.5;  // grey levels
  uint64_t seed = 1;
};

class AssociateScene {
 public:
  static constexpr int kWidth = 720, kHeight = 480;
  static constexpr double kRoomLight = 0.45;

  // furnished = false: only edges of walls and floor.
  explicit AssociateScene(int num_places, bool furnished = true) {
    SimulatedRoomOptions options;
    options.random_seed = 4;
    options.bare_walls = true;
    options.furnished = furnished;
    options.shading = true;
    options.num_photos = num_places;
    // Twice as fine as the photos, so that they can be moved by parts of a pixel.
    options.photo_width = 2 * kWidth;
    options.photo_height = 2 * kHeight;
    options.photo_noise = 0;
    options.exposure_range_ev = 0;
    options.scan_columns = 60;
    options.scan_rows = 30;
    const SimulatedRoom room(options);
    for (int place = 0; place < num_places; ++place) {
      const cv::Mat3f room_light = Linear(room.RenderPhoto(place));
      plain_.push_back(kRoomLight * room_light);
      patterned_.push_back(plain_.back() + 1.6 * room_light.mul(ProjectedAt(place)));
    }
  }

  cv::Mat TakePhoto(int place, const Take& take) const {
    cv::Mat3f light = (take.patterned ? patterned_ : plain_)[place];
    if (take.second_projector) {
      const cv::Mat3f more = plain_[place].mul(ProjectedAt(1000 + place));
      light = cv::Mat3f(light + 1.6 / kRoomLight * more);
    }
    cv::Mat3f moved, small;
    if (take.shift_x != 0 || take.shift_y != 0 || take.roll_deg != 0) {
      const double c = std::cos(RadFromDeg(take.roll_deg)), s = std::sin(RadFromDeg(take.roll_deg));
      const double mx = kWidth - 0.5, my = kHeight - 0.5;
      const cv::Matx23d move(c, -s, mx - c * mx + s * my + 2 * take.shift_x,  //
                             s, c, my - s * mx - c * my + 2 * take.shift_y);
      cv::warpAffine(light, moved, move, light.size(), cv::INTER_LANCZOS4, cv::BORDER_REPLICATE);
    }
    cv::resize(moved.empty() ? light : moved, small, {kWidth, kHeight}, 0, 0, cv::INTER_AREA);
    cv::Mat3b photo(small.size());
    RandomStream random(MixBits(take.seed, static_cast<uint64_t>(place)));
    for (int i = 0; i < kWidth * kHeight; ++i) {
      for (int k = 0; k < 3; ++k) {
        const double value = SrgbFromLinear(
            std::clamp(static_cast<double>(small(i)[k]) * std::exp2(take.ev), 0.0, 1.0));
        photo(i)[k] = cv::saturate_cast<uchar>(255 * value + take.noise * random.Gaussian());
      }
    }
    return photo;
  }

  void Save(const std::string& path, int place, const Take& take,
            const std::string& date_time = "") const {
    const std::string bytes = Encoded(path.substr(path.rfind('.')), place, take);
    std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<long>(bytes.size()));
    if (date_time.empty()) return;
    ExposureData exposure;
    exposure.date_time = date_time;
    exposure.exposure_time = 0.02 * std::exp2(take.ev);
    exposure.f_number = 8;
    exposure.iso = 100;
    WriteExposureData(path, exposure);
  }

 private:
  // The photo's file. Most tests want the same photos.
  const std::string& Encoded(const std::string& extension, int place, const Take& take) const {
    std::string& bytes =
        encoded_[{extension, place, take.patterned, take.second_projector, take.shift_x,
                  take.shift_y, take.roll_deg, take.ev, take.noise, take.seed}];
    if (bytes.empty()) {
      std::vector<uchar> buffer;
      cv::imencode(extension, TakePhoto(place, take), buffer, {cv::IMWRITE_JPEG_QUALITY, 93});
      bytes.assign(buffer.begin(), buffer.end());
    }
    return bytes;
  }

  static cv::Mat3f Linear(const cv::Mat3b& photo) {
    cv::Mat3f linear(photo.size());
    for (int i = 0; i < static_cast<int>(photo.total()); ++i) {
      for (int k = 0; k < 3; ++k) linear(i)[k] = LinearFromSrgbByte()[photo(i)[k]];
    }
    return linear;
  }
  static const cv::Mat3f& Pattern() {
    static const cv::Mat3f light = [] {
      PatternOptions options;
      options.width = 1280;
      options.height = 720;
      cv::Mat3b pattern;
      cv::cvtColor(MakePattern(options), pattern, cv::COLOR_GRAY2BGR);
      return Linear(pattern);
    }();
    return light;
  }
  // The pattern lies differently in the photo of each place.
  static cv::Mat3f ProjectedAt(int place) {
    RandomStream random(MixBits(77, static_cast<uint64_t>(place)));
    const auto width = static_cast<float>(2 * kWidth), height = static_cast<float>(2 * kHeight);
    const auto any = [&](double low, double high) {
      return static_cast<float>(random.Uniform(low, high));
    };
    const std::vector<cv::Point2f> from = {{0, 0}, {1279, 0}, {1279, 719}, {0, 719}};
    const std::vector<cv::Point2f> to = {{width * any(-0.1, 0.2), height * any(-0.1, 0.2)},
                                         {width * any(0.8, 1.1), height * any(-0.1, 0.2)},
                                         {width * any(0.8, 1.1), height * any(0.8, 1.1)},
                                         {width * any(-0.1, 0.2), height * any(0.8, 1.1)}};
    cv::Mat3f light;
    cv::warpPerspective(Pattern(), light, cv::getPerspectiveTransform(from, to),
                        {2 * kWidth, 2 * kHeight});
    return light;
  }

  // Light of the room, and with the pattern, per place; twice as fine as the photos.
  std::vector<cv::Mat3f> plain_, patterned_;
  using TakeKey =
      std::tuple<std::string, int, bool, bool, double, double, double, double, double, uint64_t>;
  mutable std::map<TakeKey, std::string> encoded_;
};

// Five places, rendered once per process.
inline const AssociateScene& FurnishedScene() {
  static const AssociateScene scene(5);
  return scene;
}

}  // namespace roomtex
