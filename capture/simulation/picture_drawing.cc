#include "capture/simulation/picture_drawing.h"

#include <algorithm>
#include <iterator>

#include "core/frames.h"

namespace roomtex {
namespace drawing {

// hue 0..360, saturation and value 0..1.
cv::Scalar FromHsv(double hue, double saturation, double value) {
  hue = std::fmod(std::fmod(hue, 360) + 360, 360) / 60;
  const auto channel = [&](double shift) {
    const double k = std::fmod(shift + hue, 6);
    return 255 * (value - value * saturation * std::max(0.0, std::min({k, 4 - k, 1.0})));
  };
  return Bgr(channel(5), channel(3), channel(1));
}
cv::Scalar AnyColor(RandomStream* random, double saturation_low, double saturation_high,
                    double value_low, double value_high) {
  return FromHsv(random->Uniform(0, 360), random->Uniform(saturation_low, saturation_high),
                 random->Uniform(value_low, value_high));
}

void FillGradient(cv::Mat* image, const cv::Rect& area, const cv::Scalar& top,
                  const cv::Scalar& bottom) {
  const cv::Rect inside = area & cv::Rect(0, 0, image->cols, image->rows);
  for (int y = inside.y; y < inside.y + inside.height; ++y) {
    (*image)(cv::Rect(inside.x, y, inside.width, 1)) =
        Blend(top, bottom, static_cast<double>(y - area.y) / std::max(1, area.height - 1));
  }
}

// Brightness times 1 + amplitude * smooth noise of this wavelength (pixels).
void Mottle(cv::Mat* image, double wavelength, double amplitude, RandomStream* random) {
  cv::Mat coarse(Round(image->rows / wavelength) + 3, Round(image->cols / wavelength) + 3, CV_32F);
  for (int y = 0; y < coarse.rows; ++y) {
    for (int x = 0; x < coarse.cols; ++x) {
      coarse.at<float>(y, x) = static_cast<float>(1 + amplitude * random->Uniform(-1, 1));
    }
  }
  cv::Mat factor;
  cv::resize(coarse, factor, image->size(), 0, 0, cv::INTER_CUBIC);
  for (int y = 0; y < image->rows; ++y) {
    for (int x = 0; x < image->cols; ++x) {
      cv::Vec3b& pixel = image->at<cv::Vec3b>(y, x);
      const float f = factor.at<float>(y, x);
      for (int k = 0; k < 3; ++k)
        pixel[k] = cv::saturate_cast<uchar>(static_cast<float>(pixel[k]) * f);
    }
  }
}

void Polygon(cv::Mat* image, const Pixels& corners, const cv::Scalar& color) {
  cv::fillPoly(*image, std::vector<Pixels>{corners}, color, cv::LINE_AA);
}

// Height of letters in pixels, thickness to match.
void Write(cv::Mat* image, const std::string& text, double x, double baseline, double letter_height,
           const cv::Scalar& color, int font, double weight) {
  const double scale = letter_height / 22;
  cv::putText(*image, text, {Round(x), Round(baseline)}, font, scale, color,
              std::max(1, Round(letter_height / 9 * weight)), cv::LINE_AA);
}
// The same, as wide as asked.
void WriteFitted(cv::Mat* image, const std::string& text, const cv::Rect& box,
                 const cv::Scalar& color, int font) {
  int baseline = 0;
  const cv::Size size = cv::getTextSize(text, font, 1, 1, &baseline);
  const double scale = std::min(static_cast<double>(box.width) / size.width,
                                static_cast<double>(box.height) / (size.height + baseline));
  const cv::Point start(box.x + Round((box.width - scale * size.width) / 2),
                        box.y + Round((box.height + scale * (size.height - 0.3 * baseline)) / 2));
  cv::putText(*image, text, start, font, scale, color, std::max(1, Round(scale * 2.2)),
              cv::LINE_AA);
}

std::string Word(RandomStream* random) {
  static const char* const kWords[] = {
      "range",   "light",  "stone",  "garden", "north", "camera", "silver", "window",
      "harbour", "paper",  "room",   "river",  "amber", "mirror", "scale",  "copper",
      "summer",  "plane",  "violin", "cloud",  "field", "winter", "corner", "bridge",
      "theory",  "island", "motion", "letter", "depth", "orange", "wood",   "signal",
      "valley",  "colour", "atlas",  "engine", "poem",  "salt",   "forest", "night"};
  std::string word = kWords[random->Index(std::size(kWords))];
  if (random->Uniform() < 0.15) word[0] = static_cast<char>(std::toupper(word[0]));
  return word;
}

std::string Words(int letters, RandomStream* random) {
  std::string line = Word(random);
  while (static_cast<int>(line.size()) < letters) line += " " + Word(random);
  return line;
}

// Lines of words.
void WriteParagraph(cv::Mat* image, const cv::Rect& box, double letter_height,
                    const cv::Scalar& color, RandomStream* random) {
  const int letters = static_cast<int>(box.width / (letter_height * 0.92)) - 6;
  for (double y = box.y + letter_height; y < box.y + box.height; y += letter_height * 1.9) {
    const int length = random->Uniform() < 0.15 ? letters / 2 : letters;
    if (length > 3) {
      Write(image, Words(length, random), box.x, y, letter_height, color, cv::FONT_HERSHEY_SIMPLEX);
    }
  }
}

void Frame(cv::Mat* image, int width, const cv::Scalar& color) {
  cv::rectangle(*image, {0, 0, image->cols, image->rows}, color, 2 * width);
}

// Ridge of a mountain range or a hill; heights by midpoint displacement.
Pixels Ridge(int width, int bottom, double mean, double rough, RandomStream* random) {
  std::vector<double> heights(129, mean);
  heights[0] += rough * random->Uniform(-1, 1);
  heights[128] += rough * random->Uniform(-1, 1);
  for (int step = 128; step > 1; step /= 2, rough *= 0.55) {
    for (int i = step / 2; i < 129; i += step) {
      heights[i] =
          (heights[i - step / 2] + heights[i + step / 2]) / 2 + rough * random->Uniform(-1, 1);
    }
  }
  Pixels corners = {{width, bottom}, {0, bottom}};
  for (int i = 0; i < 129; ++i) corners.emplace_back(i * width / 128, Round(heights[i]));
  return corners;
}

void Flower(cv::Mat* image, const cv::Point2d& centre, double size, const cv::Scalar& color,
            RandomStream* random) {
  const int petals = 5 + random->Index(7);
  const double turn = random->Uniform(0, 360);
  for (int ring = 0; ring < 2; ++ring) {
    for (int i = 0; i < petals; ++i) {
      const double angle = RadFromDeg(turn + 360.0 * (i + 0.5 * ring) / petals);
      const double reach = size * (ring == 0 ? 0.62 : 0.38);
      const cv::Point2d at = centre + reach * cv::Point2d(std::cos(angle), std::sin(angle));
      cv::ellipse(*image, {Round(at.x), Round(at.y)}, {Round(size * 0.42), Round(size * 0.19)},
                  DegFromRad(angle), 0, 360, color * random->Uniform(0.7, 1.1), cv::FILLED,
                  cv::LINE_AA);
    }
  }
  cv::circle(*image, {Round(centre.x), Round(centre.y)}, Round(size * 0.2), Bgr(225, 180, 50),
             cv::FILLED, cv::LINE_AA);
  for (int i = 0; i < 14; ++i) {
    const double angle = random->Uniform(0, 2 * kPi), radius = size * random->Uniform(0, 0.17);
    cv::circle(
        *image,
        {Round(centre.x + radius * std::cos(angle)), Round(centre.y + radius * std::sin(angle))},
        std::max(1, Round(size * 0.02)), Bgr(110, 70, 20), cv::FILLED, cv::LINE_AA);
  }
}

}  // namespace drawing
}  // namespace roomtex
