#pragma once
// Brushes for room_pictures.h: colours, gradients, letters, ridges, flowers. Images are 8-bit BGR,
// sRGB; places and sizes are pixels.

#include <cmath>
#include <string>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "core/random_stream.h"

namespace roomtex {
namespace drawing {

using Pixels = std::vector<cv::Point>;

inline int Round(double x) { return static_cast<int>(std::lround(x)); }
// Colours 0..255.
inline cv::Scalar Bgr(double red, double green, double blue) { return {blue, green, red}; }
inline cv::Scalar Blend(const cv::Scalar& a, const cv::Scalar& b, double t) {
  return a * (1 - t) + b * t;
}
// hue in degrees, saturation and value 0..1.
cv::Scalar FromHsv(double hue, double saturation, double value);
cv::Scalar AnyColor(RandomStream* random, double saturation_low = 0.35,
                    double saturation_high = 0.85, double value_low = 0.3,
                    double value_high = 0.95);

void FillGradient(cv::Mat* image, const cv::Rect& area, const cv::Scalar& top,
                  const cv::Scalar& bottom);
// Brightness times 1 + amplitude * smooth noise of this wavelength.
void Mottle(cv::Mat* image, double wavelength, double amplitude, RandomStream* random);
void Polygon(cv::Mat* image, const Pixels& corners, const cv::Scalar& color);
// A border of this width.
void Frame(cv::Mat* image, int width, const cv::Scalar& color);

void Write(cv::Mat* image, const std::string& text, double x, double baseline, double letter_height,
           const cv::Scalar& color, int font = cv::FONT_HERSHEY_DUPLEX, double weight = 1);
// As large as the box allows.
void WriteFitted(cv::Mat* image, const std::string& text, const cv::Rect& box,
                 const cv::Scalar& color, int font = cv::FONT_HERSHEY_DUPLEX);
std::string Word(RandomStream* random);
std::string Words(int letters, RandomStream* random);
// Lines of words.
void WriteParagraph(cv::Mat* image, const cv::Rect& box, double letter_height,
                    const cv::Scalar& color, RandomStream* random);

// Outline of a mountain range or a hill, closed at the bottom; heights by midpoint displacement.
Pixels Ridge(int width, int bottom, double mean, double rough, RandomStream* random);
void Flower(cv::Mat* image, const cv::Point2d& centre, double size, const cv::Scalar& color,
            RandomStream* random);

}  // namespace drawing
}  // namespace roomtex
