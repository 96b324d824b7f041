#include "texture/sampling/photo_tone.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <vector>

#include <opencv2/core.hpp>

#include "core/error.h"
#include "core/output_file.h"
#include "core/photo.h"

namespace roomtex {
namespace {

constexpr char kRemedy[] =
    "Expected one line per level 0 to 255: the linear light, one number or three for red, green "
    "and blue";

// The one or three numbers of a line; none for a blank one.
std::vector<float> ReadLevel(std::string line, const std::string& path, long number) {
  line = line.substr(0, line.find('#'));
  std::replace(line.begin(), line.end(), ',', ' ');
  std::istringstream words(line);
  std::vector<float> values;
  for (std::string word; words >> word;) {
    size_t used = 0;
    float value = -1;
    try {
      value = std::stof(word, &used);
    } catch (const std::exception&) {
      used = 0;
    }
    if (used != word.size() || !std::isfinite(value) || value < 0) {
      throw InputError(path, LinePosition(number), "\"" + word + "\" is no amount of light",
                       kRemedy);
    }
    values.push_back(value);
  }
  if (!values.empty() && values.size() != 1 && values.size() != 3) {
    throw InputError(path, LinePosition(number),
                     "holds " + std::to_string(values.size()) + " numbers", kRemedy);
  }
  if (values.size() == 1) values.assign(3, values[0]);
  return values;
}

void CheckCurve(const ResponseCurve::Table& table, const std::string& path) {
  for (int k = 0; k < 3; ++k) {
    for (int level = 1; level < ResponseCurve::kLevels; ++level) {
      if (table[level][k] >= table[level - 1][k]) continue;
      throw InputError(path, "level " + std::to_string(level), "is darker than the level before it",
                       "A response curve never falls");
    }
    if (!(table[ResponseCurve::kLevels - 1][k] > 0)) {
      throw InputError(path, "", "is all zero", kRemedy);
    }
  }
}

}  // namespace

ResponseCurve::ResponseCurve() : is_srgb_(true) {
  for (int level = 0; level < kLevels; ++level) table_[level].fill(LinearFromSrgbByte()[level]);
}

ResponseCurve::ResponseCurve(Table table) : table_(table) {
  const auto& last = table_[kLevels - 1];
  const float lightest = std::max({last[0], last[1], last[2]});
  for (int k = 0; k < 3; ++k) {
    float before = 0;
    for (auto& level : table_) {
      level[k] = before = std::max(before, level[k] / lightest);
    }
    // What is clipped stays clipped in all channels.
    table_[kLevels - 1][k] = 1;
  }
}

ResponseCurve ResponseCurve::Read(const std::string& path) {
  RequireFile(path, "Give srgb, estimate, or a file with one line per level");
  std::ifstream stream(path);
  Table table{};
  int count = 0;
  long number = 0;
  for (std::string line; std::getline(stream, line);) {
    const std::vector<float> values = ReadLevel(line, path, ++number);
    if (values.empty()) continue;
    if (count == kLevels) {
      throw InputError(path, LinePosition(number), "is a 257th level", kRemedy);
    }
    std::copy(values.begin(), values.end(), table[count++].begin());
  }
  if (count != kLevels) {
    throw InputError(path, "", "holds " + std::to_string(count) + " levels", kRemedy);
  }
  CheckCurve(table, path);
  return ResponseCurve(table);
}

void ResponseCurve::Write(const std::string& path) const {
  OutputFile file(path);
  file.stream() << "# Linear light of the byte values 0 to 255: red, green, blue.\n";
  file.stream().precision(6);
  for (const auto& level : table_) {
    file.stream() << level[0] << " " << level[1] << " " << level[2] << "\n";
  }
  file.Commit();
}

float ResponseCurve::Linear(float level, int channel) const {
  const float clamped = std::clamp(level, 0.0f, 255.0f);
  const int below = std::min(static_cast<int>(clamped), kLevels - 2);
  const float share = clamped - static_cast<float>(below);
  return table_[below][channel] + share * (table_[below + 1][channel] - table_[below][channel]);
}

float ResponseCurve::LinearFromSrgbLinear(float linear, int channel) const {
  if (is_srgb_) return linear;
  return Linear(static_cast<float>(255 * SrgbFromLinear(std::clamp(linear, 0.0f, 1.0f))), channel);
}

void ResponseCurve::ToSrgb(cv::Mat* photo) const {
  if (is_srgb_) return;
  cv::Mat table(1, kLevels, CV_8UC3);
  for (int level = 0; level < kLevels; ++level) {
    for (int k = 0; k < 3; ++k) {
      table.at<cv::Vec3b>(0, level)[2 - k] = SrgbByteFromLinear(table_[level][k]);
    }
  }
  cv::LUT(*photo, table, *photo);
}

LensRadius::LensRadius(const CameraProjection& camera) {
  const double width = camera.camera().width, height = camera.camera().height;
  const auto centre = camera.ImgFromCam(Eigen::Vector3d::UnitZ());
  centre_ = (centre ? *centre : Eigen::Vector2d(width / 2, height / 2)).cast<float>();
  scale_ = static_cast<float>(4 / (width * width + height * height));
}

VignettingFactor::VignettingFactor(const Vignetting& vignetting, const CameraProjection& camera)
    : radius_(camera) {
  for (int i = 0; i < kSteps + 2; ++i) {
    table_[i] = static_cast<float>(std::exp(vignetting.LogFactor(static_cast<double>(i) / kSteps)));
  }
}

float VignettingFactor::At(float x_in_img, float y_in_img) const {
  const float x = kSteps * std::min(radius_.Squared(x_in_img, y_in_img), 1.0f);
  const int step = static_cast<int>(x);
  return table_[step] + (x - static_cast<float>(step)) * (table_[step + 1] - table_[step]);
}

}  // namespace roomtex
