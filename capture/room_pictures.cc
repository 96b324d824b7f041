#include "capture/room_pictures.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "capture/random_stream.h"

namespace roomtex {
namespace {

using Pixels = std::vector<cv::Point>;

int Round(double x) { return static_cast<int>(std::lround(x)); }
cv::Scalar Bgr(double red, double green, double blue) { return {blue, green, red}; }
cv::Scalar Blend(const cv::Scalar& a, const cv::Scalar& b, double t) { return a * (1 - t) + b * t; }

// hue 0..360, saturation and value 0..1.
cv::Scalar FromHsv(double hue, double saturation, double value) {
  hue = std::fmod(std::fmod(hue, 360) + 360, 360) / 60;
  const auto channel = [&](double shift) {
    const double k = std::fmod(shift + hue, 6);
    return 255 * (value - value * saturation * std::max(0.0, std::min({k, 4 - k, 1.0})));
  };
  return Bgr(channel(5), channel(3), channel(1));
}
cv::Scalar AnyColor(RandomStream* random, double saturation_low = 0.35,
                    double saturation_high = 0.85, double value_low = 0.3,
                    double value_high = 0.95) {
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
           const cv::Scalar& color, int font = cv::FONT_HERSHEY_DUPLEX, double weight = 1) {
  const double scale = letter_height / 22;
  cv::putText(*image, text, {Round(x), Round(baseline)}, font, scale, color,
              std::max(1, Round(letter_height / 9 * weight)), cv::LINE_AA);
}
// The same, as wide as asked.
void WriteFitted(cv::Mat* image, const std::string& text, const cv::Rect& box,
                 const cv::Scalar& color, int font = cv::FONT_HERSHEY_DUPLEX) {
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

void Fir(cv::Mat* image, double x, double foot, double height, const cv::Scalar& color) {
  for (int tier = 0; tier < 4; ++tier) {
    const double top = foot - height + tier * height * 0.2;
    const double half = height * (0.10 + 0.055 * tier), bottom = top + height * 0.36;
    Polygon(image,
            {{Round(x), Round(top)},
             {Round(x - half), Round(bottom)},
             {Round(x + half), Round(bottom)}},
            color * (1 - 0.12 * (tier % 2)));
  }
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

}  // namespace

cv::Mat DrawLandscape(int width, int height, uint64_t seed) {
  RandomStream random(MixBits(seed, 1));
  cv::Mat image(height, width, CV_8UC3);
  const double hue = random.Uniform(190, 230);
  const bool evening = random.Uniform() < 0.5;
  const cv::Scalar horizon = evening ? Bgr(245, 190, 140) : Bgr(215, 228, 235);
  FillGradient(&image, {0, 0, width, height}, FromHsv(hue, 0.55, 0.8), horizon);
  cv::circle(image, {Round(width * random.Uniform(0.15, 0.85)), Round(height * 0.22)}, height / 14,
             Bgr(255, 240, 205), cv::FILLED, cv::LINE_AA);
  for (int i = 0; i < 12; ++i) {
    cv::ellipse(
        image, {Round(random.Uniform(0, width)), Round(height * random.Uniform(0.05, 0.35))},
        {Round(width * random.Uniform(0.03, 0.12)), Round(height * random.Uniform(0.005, 0.02))}, 0,
        0, 360, Blend(horizon, Bgr(255, 255, 255), random.Uniform()), cv::FILLED, cv::LINE_AA);
  }
  const int shore = Round(height * 0.68);
  for (int range = 0; range < 4; ++range) {
    const double far = 1 - range / 4.0;
    const cv::Scalar color = Blend(FromHsv(hue - 20 * range, 0.55, 0.32), horizon, 0.7 * far);
    Polygon(&image,
            Ridge(width, shore, height * (0.36 + 0.085 * range), height * 0.16 * (0.5 + far / 2),
                  &random),
            color);
  }
  FillGradient(&image, {0, shore, width, height - shore},
               Blend(horizon, FromHsv(hue, 0.5, 0.6), 0.5), FromHsv(hue, 0.7, 0.35));
  for (int i = 0; i < 160; ++i) {
    const double x = random.Uniform(0, width), y = random.Uniform(shore, height);
    const double length = width * random.Uniform(0.01, 0.06);
    cv::line(image, {Round(x), Round(y)}, {Round(x + length), Round(y)},
             Blend(horizon, FromHsv(hue, 0.6, 0.4), random.Uniform()), 1, cv::LINE_AA);
  }
  for (int i = 0; i < 45; ++i) {
    const double foot = height * random.Uniform(0.7, 0.98);
    Fir(&image, random.Uniform(0, 1) * width, foot, foot * random.Uniform(0.12, 0.3),
        FromHsv(random.Uniform(95, 160), 0.6, random.Uniform(0.15, 0.4)));
  }
  Mottle(&image, 3, 0.08, &random);
  Frame(&image, width / 28, FromHsv(random.Uniform(15, 40), 0.5, random.Uniform(0.2, 0.5)));
  return image;
}

cv::Mat DrawAbstract(int width, int height, uint64_t seed) {
  RandomStream random(MixBits(seed, 2));
  const double unit = std::min(width, height);
  cv::Mat image(height, width, CV_8UC3, FromHsv(random.Uniform(25, 60), 0.18, 0.92));
  const auto any = [&] {
    return cv::Point(Round(random.Uniform(0, width)), Round(random.Uniform(0, height)));
  };
  for (int i = 0; i < 7; ++i) {
    Pixels corners;
    for (int k = 0; k < 4; ++k) corners.push_back(any());
    std::vector<cv::Point> hull;
    cv::convexHull(corners, hull);
    cv::Mat layer = image.clone();
    Polygon(&layer, hull, AnyColor(&random, 0.2, 0.7, 0.5, 0.95));
    cv::addWeighted(image, 0.45, layer, 0.55, 0, image);
  }
  for (int i = 0; i < 26; ++i) {
    const cv::Point centre = any();
    double radius = unit * random.Uniform(0.02, 0.16);
    for (int ring = 0; ring < 4 && radius > 3; ++ring, radius *= random.Uniform(0.45, 0.85)) {
      cv::circle(image, centre, Round(radius), AnyColor(&random), cv::FILLED, cv::LINE_AA);
    }
  }
  for (int i = 0; i < 40; ++i) {
    cv::line(image, any(), any(), AnyColor(&random, 0.2, 0.8, 0.05, 0.6),
             1 + random.Index(std::max(2, Round(unit * 0.012))), cv::LINE_AA);
  }
  for (int i = 0; i < 60; ++i) {
    const cv::Point at = any();
    const int side = Round(unit * random.Uniform(0.01, 0.06));
    const cv::RotatedRect box(at, cv::Size2f(side, side * 0.6f),
                              static_cast<float>(random.Uniform(0, 180)));
    cv::Point2f p[4];
    box.points(p);
    Polygon(&image, {p[0], p[1], p[2], p[3]}, AnyColor(&random, 0.3, 0.9, 0.1, 0.9));
  }
  Mottle(&image, 2.5, 0.07, &random);
  Frame(&image, width / 30, Bgr(35, 32, 30));
  return image;
}

cv::Mat DrawTextPoster(int width, int height, const std::string& title, uint64_t seed) {
  RandomStream random(MixBits(seed, 3));
  const double hue = random.Uniform(0, 360);
  cv::Mat image(height, width, CV_8UC3, FromHsv(hue + 180, 0.08, 0.95));
  const int margin = width / 16;
  const cv::Scalar ink = FromHsv(hue, 0.5, 0.2);
  cv::rectangle(image, cv::Rect(0, 0, width, Round(height * 0.2)), FromHsv(hue, 0.7, 0.6),
                cv::FILLED);
  WriteFitted(&image, title,
              {margin, Round(height * 0.03), width - 2 * margin, Round(height * 0.12)},
              Bgr(250, 248, 240), cv::FONT_HERSHEY_TRIPLEX);
  Write(&image, Words(22, &random), margin, height * 0.185, width / 32.0, Bgr(240, 235, 220));
  // A diagram on one side, paragraphs beside and beneath it.
  const cv::Rect chart(width / 2 + margin / 2, Round(height * 0.24), width / 2 - 3 * margin / 2,
                       Round(height * 0.3));
  cv::rectangle(image, chart, FromHsv(hue + 40, 0.15, 0.98), cv::FILLED);
  cv::rectangle(image, chart, ink, 2, cv::LINE_AA);
  for (int bar = 0; bar < 9; ++bar) {
    const int tall = Round(chart.height * random.Uniform(0.15, 0.9)), wide = chart.width / 11;
    cv::rectangle(image,
                  cv::Rect(chart.x + wide / 2 + bar * chart.width / 9 - bar,
                           chart.y + chart.height - tall, wide, tall),
                  FromHsv(hue + 30 * bar, 0.65, 0.8), cv::FILLED);
  }
  cv::Point last(chart.x, chart.y + chart.height / 2);
  for (int i = 1; i <= 12; ++i) {
    const cv::Point next(chart.x + i * chart.width / 12,
                         chart.y + Round(chart.height * random.Uniform(0.1, 0.9)));
    cv::line(image, last, next, ink, 2, cv::LINE_AA);
    cv::circle(image, next, 4, Bgr(200, 40, 40), cv::FILLED, cv::LINE_AA);
    last = next;
  }
  const double letter = width / 48.0;
  WriteParagraph(&image, {margin, Round(height * 0.24), width / 2 - margin, Round(height * 0.3)},
                 letter, ink, &random);
  Write(&image, Words(14, &random), margin, height * 0.6, width / 20.0, FromHsv(hue, 0.8, 0.5));
  WriteParagraph(&image, {margin, Round(height * 0.63), width - 2 * margin, Round(height * 0.3)},
                 letter, ink, &random);
  Frame(&image, 4, ink);
  Mottle(&image, 2.5, 0.04, &random);
  return image;
}

cv::Mat DrawMap(int width, int height, const std::string& title, uint64_t seed) {
  RandomStream random(MixBits(seed, 4));
  cv::Mat image(height, width, CV_8UC3, Bgr(150, 190, 215));
  // Countries: the nearest of random capitals, with a wobbling border.
  struct Country {
    double x, y;
    cv::Scalar color;
  };
  std::vector<Country> countries(46);
  for (Country& country : countries) {
    country = {random.Uniform(0, width), random.Uniform(0, height),
               random.Uniform() < 0.3 ? Bgr(150, 190, 215)
                                      : FromHsv(random.Uniform(15, 130), random.Uniform(0.2, 0.5),
                                                random.Uniform(0.7, 0.93))};
  }
  const double p = random.Uniform(0, 6), wave = width / 40.0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double u =
          x + wave * (std::sin(y / wave / 1.7 + p) + 0.5 * std::sin(x / wave / 0.8 + y / wave));
      const double v = y + wave * (std::cos(x / wave / 1.9) +
                                   0.5 * std::sin(y / wave / 0.7 - x / wave / 1.3 + p));
      double best = 1e18, second = 1e18;
      const Country* nearest = nullptr;
      for (const Country& country : countries) {
        const double d = (country.x - u) * (country.x - u) + (country.y - v) * (country.y - v);
        if (d < best) {
          second = best;
          best = d;
          nearest = &country;
        } else if (d < second) {
          second = d;
        }
      }
      const bool border = std::sqrt(second) - std::sqrt(best) < width / 250.0;
      const cv::Scalar& color = nearest->color;
      image.at<cv::Vec3b>(y, x) =
          border ? cv::Vec3b(70, 60, 90)
                 : cv::Vec3b(static_cast<uchar>(color[0]), static_cast<uchar>(color[1]),
                             static_cast<uchar>(color[2]));
    }
  }
  for (int road = 0; road < 16; ++road) {
    cv::Point2d at(random.Uniform(0, width), random.Uniform(0, height));
    double heading = random.Uniform(0, 2 * kPi);
    for (int step = 0; step < 30; ++step) {
      heading += random.Uniform(-0.5, 0.5);
      const cv::Point2d next =
          at + width / 50.0 * cv::Point2d(std::cos(heading), std::sin(heading));
      cv::line(image, at, next, road % 2 ? Bgr(190, 60, 50) : Bgr(60, 90, 160), 2, cv::LINE_AA);
      at = next;
    }
  }
  for (const Country& country : countries) {
    cv::circle(image, {Round(country.x), Round(country.y)}, 4, Bgr(30, 30, 30), cv::FILLED,
               cv::LINE_AA);
    Write(&image, Word(&random), country.x - width / 30.0, country.y - 6, width / 60.0,
          Bgr(30, 25, 40));
  }
  const cv::Rect cartouche(width / 20, height - height / 7, width * 2 / 5, height / 10);
  cv::rectangle(image, cartouche, Bgr(240, 230, 200), cv::FILLED);
  cv::rectangle(image, cartouche, Bgr(80, 50, 30), 3);
  WriteFitted(&image, title, cartouche - cv::Size(12, 12) + cv::Point(6, 6), Bgr(80, 40, 20),
              cv::FONT_HERSHEY_TRIPLEX);
  Frame(&image, width / 40, Bgr(105, 75, 50));
  Mottle(&image, 4, 0.05, &random);
  return image;
}

cv::Mat DrawCity(int width, int height, uint64_t seed) {
  RandomStream random(MixBits(seed, 5));
  cv::Mat image(height, width, CV_8UC3);
  FillGradient(&image, {0, 0, width, height}, Bgr(35, 40, 85), Bgr(240, 140, 90));
  cv::circle(image, {Round(width * 0.72), Round(height * 0.2)}, height / 18, Bgr(245, 240, 220),
             cv::FILLED, cv::LINE_AA);
  for (int i = 0; i < 70; ++i) {
    cv::circle(image, {Round(random.Uniform(0, width)), Round(random.Uniform(0, height * 0.45))},
               1 + random.Index(2), Bgr(230, 230, 240), cv::FILLED, cv::LINE_AA);
  }
  for (int row = 0; row < 3; ++row) {
    for (double x = -10; x < width;) {
      const double wide = width * random.Uniform(0.05, 0.13);
      const double top = height * (random.Uniform(0.28, 0.6) + 0.11 * row);
      const cv::Scalar wall =
          FromHsv(random.Uniform(200, 290), 0.4, 0.42 - 0.13 * row + random.Uniform(0, 0.06));
      cv::rectangle(image, cv::Rect(Round(x), Round(top), Round(wide), height), wall, cv::FILLED);
      if (random.Uniform() < 0.3) {
        cv::line(image, {Round(x + wide / 2), Round(top)},
                 {Round(x + wide / 2), Round(top - height * 0.06)}, wall, 3);
      }
      const double pane = std::max(5.0, width / 80.0);
      for (double wy = top + pane; wy < height - pane; wy += pane * 1.9) {
        for (double wx = x + pane; wx < x + wide - pane; wx += pane * 1.7) {
          if (random.Uniform() < 0.45) continue;
          cv::rectangle(
              image, cv::Rect(Round(wx), Round(wy), Round(pane * 0.9), Round(pane * 1.1)),
              FromHsv(random.Uniform(30, 60), random.Uniform(0.2, 0.7), random.Uniform(0.5, 1.0)),
              cv::FILLED);
        }
      }
      x += wide * random.Uniform(0.9, 1.3);
    }
  }
  Frame(&image, width / 26, Bgr(225, 222, 215));
  return image;
}

cv::Mat DrawFlowers(int width, int height, uint64_t seed) {
  RandomStream random(MixBits(seed, 6));
  cv::Mat image(height, width, CV_8UC3);
  const double hue = random.Uniform(0, 360);
  FillGradient(&image, {0, 0, width, height}, FromHsv(hue, 0.35, 0.45),
               FromHsv(hue + 25, 0.5, 0.22));
  Mottle(&image, width / 9.0, 0.25, &random);
  for (int i = 0; i < 40; ++i) {
    const cv::Point2d foot(width * random.Uniform(0.3, 0.7), height * 0.95);
    const cv::Point2d head(width * random.Uniform(0.02, 0.98), height * random.Uniform(0.1, 0.85));
    cv::line(image, foot, head, FromHsv(random.Uniform(85, 130), 0.6, random.Uniform(0.25, 0.5)),
             2 + random.Index(3), cv::LINE_AA);
    const cv::Point2d mid = 0.4 * foot + 0.6 * head;
    cv::ellipse(image, mid, {Round(width * 0.06), Round(width * 0.018)}, random.Uniform(0, 180), 0,
                360, FromHsv(random.Uniform(85, 130), 0.6, random.Uniform(0.3, 0.6)), cv::FILLED,
                cv::LINE_AA);
  }
  for (int i = 0; i < 26; ++i) {
    Flower(&image, {width * random.Uniform(0.05, 0.95), height * random.Uniform(0.06, 0.8)},
           width * random.Uniform(0.05, 0.15),
           FromHsv(hue + 150 + random.Uniform(-70, 70), random.Uniform(0.3, 0.8),
                   random.Uniform(0.75, 1)),
           &random);
  }
  Mottle(&image, 3, 0.06, &random);
  Frame(&image, width / 24, FromHsv(38, 0.55, 0.62));
  Frame(&image, width / 60, FromHsv(38, 0.6, 0.42));
  return image;
}

cv::Mat DrawCalendar(int width, int height, uint64_t seed) {
  RandomStream random(MixBits(seed, 7));
  cv::Mat image(height, width, CV_8UC3, Bgr(246, 244, 238));
  const cv::Mat picture = DrawLandscape(width, height * 9 / 20, seed + 5);
  picture.copyTo(image(cv::Rect(0, 0, picture.cols, picture.rows)));
  WriteFitted(&image, "MAY 2008", {width / 8, height * 9 / 20, width * 3 / 4, height / 10},
              Bgr(170, 40, 40));
  const double cell_x = width / 7.6, cell_y = height * 0.4 / 6;
  for (int day = 1; day <= 31; ++day) {
    const int slot = day + 2;
    const double x = 0.3 * cell_x + (slot % 7) * cell_x, y = height * 0.57 + (slot / 7) * cell_y;
    const cv::Rect cell(Round(x), Round(y), Round(cell_x * 0.94), Round(cell_y * 0.94));
    if (random.Uniform() < 0.25)
      cv::rectangle(image, cell, AnyColor(&random, 0.15, 0.5, 0.8, 1), cv::FILLED);
    cv::rectangle(image, cell, Bgr(150, 150, 150), 1);
    Write(&image, std::to_string(day), x + 4, y + cell_y * 0.55, cell_y * 0.34,
          slot % 7 == 6 ? Bgr(190, 30, 30) : Bgr(30, 30, 40));
    if (random.Uniform() < 0.3)
      Write(&image, Word(&random), x + 3, y + cell_y * 0.88, cell_y * 0.16, Bgr(40, 60, 140));
  }
  return image;
}

cv::Mat DrawClock(int size, uint64_t seed) {
  RandomStream random(MixBits(seed, 8));
  cv::Mat image(size, size, CV_8UC3, Bgr(70, 48, 35));
  const cv::Point centre(size / 2, size / 2);
  const double r = size * 0.46;
  cv::circle(image, centre, Round(r), Bgr(243, 240, 228), cv::FILLED, cv::LINE_AA);
  cv::circle(image, centre, Round(r), Bgr(150, 115, 60), size / 30, cv::LINE_AA);
  for (int minute = 0; minute < 60; ++minute) {
    const double angle = 2 * kPi * minute / 60, inner = r * (minute % 5 == 0 ? 0.82 : 0.88);
    const cv::Point2d d(std::sin(angle), -std::cos(angle));
    cv::line(image, cv::Point2d(centre) + inner * d, cv::Point2d(centre) + 0.93 * r * d,
             Bgr(30, 30, 30), minute % 5 == 0 ? 3 : 1, cv::LINE_AA);
    if (minute % 5 == 0) {
      const cv::Point2d at = cv::Point2d(centre) + 0.68 * r * d;
      Write(&image, std::to_string(minute == 0 ? 12 : minute / 5), at.x - size * 0.04,
            at.y + size * 0.03, size * 0.07, Bgr(30, 30, 30));
    }
  }
  const double hour = random.Uniform(0, 12);
  for (const bool large : {false, true}) {
    const double angle = large ? 2 * kPi * (hour - std::floor(hour)) : 2 * kPi * hour / 12;
    cv::line(image, centre,
             cv::Point2d(centre) +
                 (large ? 0.75 : 0.5) * r * cv::Point2d(std::sin(angle), -std::cos(angle)),
             Bgr(25, 25, 25), large ? size / 60 : size / 35, cv::LINE_AA);
  }
  return image;
}

cv::Mat DrawScreen(int width, int height, uint64_t seed) {
  RandomStream random(MixBits(seed, 9));
  cv::Mat image(height, width, CV_8UC3, Bgr(28, 32, 42));
  cv::rectangle(image, cv::Rect(0, 0, width, height / 16), Bgr(70, 80, 100), cv::FILLED);
  cv::rectangle(image, cv::Rect(0, height / 16, width / 5, height), Bgr(40, 45, 58), cv::FILLED);
  for (double y = height * 0.12; y < height * 0.97; y += height / 22.0) {
    Write(&image, Word(&random), width * 0.02, y, height / 45.0, Bgr(150, 160, 180));
    double x = width * (0.23 + 0.04 * random.Index(4));
    for (int words = 1 + random.Index(5); words > 0 && x < width * 0.85; --words) {
      const std::string word = Word(&random);
      Write(&image, word, x, y, height / 38.0, FromHsv(random.Uniform(0, 360), 0.45, 0.95));
      x += static_cast<double>(word.size() + 1) * height / 38.0 * 0.9;
    }
  }
  Frame(&image, std::max(3, height / 45), Bgr(15, 15, 17));
  return image;
}

cv::Mat DrawBookSpine(int width, int height, uint64_t seed) {
  RandomStream random(MixBits(seed, 10));
  // Drawn lying, then turned.
  cv::Mat lying(width, height, CV_8UC3, AnyColor(&random, 0.25, 0.85, 0.25, 0.85));
  const cv::Scalar ink = random.Uniform() < 0.5 ? Bgr(235, 215, 150) : Bgr(240, 240, 235);
  const cv::Scalar dark = AnyColor(&random, 0.3, 0.8, 0.08, 0.35);
  for (int band = 0, bands = random.Index(4); band < bands; ++band) {
    const int at = Round(height * random.Uniform(0.03, 0.94));
    cv::rectangle(lying, cv::Rect(at, 0, 2 + random.Index(12), width),
                  random.Uniform() < 0.5 ? ink : dark, cv::FILLED);
  }
  if (random.Uniform() < 0.4) {
    cv::rectangle(lying,
                  cv::Rect(Round(height * 0.1), width / 8, Round(height * 0.55), width * 3 / 4),
                  dark, cv::FILLED);
  }
  const double letter = std::min(width * 0.5, 26.0);
  Write(&lying, Words(9 + random.Index(10), &random), height * random.Uniform(0.06, 0.14),
        width * 0.5 + letter / 2, letter, ink,
        random.Uniform() < 0.5 ? cv::FONT_HERSHEY_TRIPLEX : cv::FONT_HERSHEY_DUPLEX);
  cv::circle(lying, {Round(height * 0.93), width / 2}, std::max(2, width / 5), ink,
             random.Uniform() < 0.5 ? cv::FILLED : 2, cv::LINE_AA);
  Mottle(&lying, 4, 0.12, &random);
  cv::Mat image;
  cv::rotate(lying, image, cv::ROTATE_90_CLOCKWISE);
  return image;
}

cv::Mat DrawCardboard(int width, int height, uint64_t seed) {
  RandomStream random(MixBits(seed, 11));
  cv::Mat image(height, width, CV_8UC3,
                FromHsv(random.Uniform(27, 35), 0.42, random.Uniform(0.6, 0.75)));
  Mottle(&image, 30, 0.1, &random);
  cv::rectangle(image, cv::Rect(0, height * 9 / 20, width, height / 10), Bgr(200, 175, 125),
                cv::FILLED);
  const cv::Rect label(Round(width * random.Uniform(0.05, 0.4)),
                       Round(height * random.Uniform(0.08, 0.3)), width / 2, height / 3);
  cv::rectangle(image, label, Bgr(245, 245, 242), cv::FILLED);
  WriteParagraph(&image, label - cv::Size(16, height / 8) + cv::Point(8, 4), label.height / 11.0,
                 Bgr(20, 20, 25), &random);
  for (int x = label.x + 8; x < label.x + label.width - 12;) {
    const int bar = 1 + random.Index(4);
    cv::rectangle(image, cv::Rect(x, label.y + label.height * 2 / 3, bar, label.height / 4),
                  Bgr(15, 15, 15), cv::FILLED);
    x += bar + 1 + random.Index(5);
  }
  Write(&image, Word(&random), width * 0.06, height * 0.8, height / 9.0, Bgr(90, 45, 30),
        cv::FONT_HERSHEY_DUPLEX, 1.3);
  const cv::Point arrow(Round(width * 0.85), Round(height * 0.7));
  Polygon(&image,
          {arrow, arrow + cv::Point(-width / 16, height / 12),
           arrow + cv::Point(width / 16, height / 12)},
          Bgr(160, 30, 30));
  cv::rectangle(image,
                cv::Rect(arrow.x - width / 50, arrow.y + height / 12, width / 25, height / 9),
                Bgr(160, 30, 30), cv::FILLED);
  Mottle(&image, 3, 0.08, &random);
  return image;
}

cv::Mat DrawRug(int width, int height, uint64_t seed) {
  RandomStream random(MixBits(seed, 12));
  cv::Mat image(height, width, CV_8UC3, Bgr(128, 32, 38));
  const cv::Scalar palette[] = {Bgr(205, 170, 110), Bgr(40, 55, 95), Bgr(165, 60, 45),
                                Bgr(225, 210, 175), Bgr(70, 90, 70), Bgr(90, 25, 35)};
  const auto pick = [&] { return palette[random.Index(6)]; };
  for (int i = 0; i < 420; ++i) {
    const cv::Point at(Round(random.Uniform(0, width)), Round(random.Uniform(0, height)));
    const double size = width * random.Uniform(0.006, 0.026);
    if (i % 3 == 0) {
      Flower(&image, at, size * 1.6, pick(), &random);
    } else {
      cv::ellipse(image, at, {Round(size * 1.6), Round(size * 0.5)}, random.Uniform(0, 180), 0, 360,
                  pick(), cv::FILLED, cv::LINE_AA);
    }
  }
  const cv::Point centre(width / 2, height / 2);
  for (int ring = 0; ring < 6; ++ring) {
    const double r = 0.4 - 0.06 * ring;
    Pixels star;
    for (int k = 0; k < 24; ++k) {
      const double angle = 2 * kPi * k / 24, reach = r * (k % 2 ? 0.82 : 1.0) * height;
      star.emplace_back(Round(centre.x + 1.3 * reach * std::cos(angle)),
                        Round(centre.y + reach * std::sin(angle)));
    }
    Polygon(&image, star, palette[(ring * 5 + 1) % 6]);
    for (int k = 0; k < 20; ++k) {
      const double angle = random.Uniform(0, 2 * kPi), reach = r * 0.75 * height;
      cv::circle(image,
                 {Round(centre.x + 1.3 * reach * std::cos(angle)),
                  Round(centre.y + reach * std::sin(angle))},
                 Round(width * random.Uniform(0.004, 0.01)), pick(), cv::FILLED, cv::LINE_AA);
    }
  }
  // Two borders of lozenges, every one in its own colours.
  for (int border = 0; border < 2; ++border) {
    const int inset = width / 60 + border * width / 17, wide = width / 19;
    cv::rectangle(image, cv::Rect(inset, inset, width - 2 * inset, height - 2 * inset),
                  palette[border + 1], 0);
    const cv::Rect outer(inset, inset, width - 2 * inset, height - 2 * inset);
    const cv::Rect inner = outer - cv::Size(2 * wide, 2 * wide) + cv::Point(wide, wide);
    const cv::Mat inside = image(inner).clone();
    cv::rectangle(image, outer, border ? Bgr(40, 50, 85) : Bgr(95, 28, 32), cv::FILLED);
    const double step = wide * 1.15;
    const auto lozenge = [&](double x, double y) {
      const double a = wide * random.Uniform(0.28, 0.45), b = wide * random.Uniform(0.28, 0.45);
      Polygon(&image,
              {{Round(x - a), Round(y)},
               {Round(x), Round(y - b)},
               {Round(x + a), Round(y)},
               {Round(x), Round(y + b)}},
              pick());
      cv::circle(image, {Round(x + random.Uniform(-2, 2)), Round(y)},
                 Round(wide * random.Uniform(0.06, 0.17)), pick(), cv::FILLED, cv::LINE_AA);
    };
    for (double x = outer.x + wide / 2.0; x < outer.x + outer.width; x += step) {
      lozenge(x, outer.y + wide / 2.0);
      lozenge(x, outer.y + outer.height - wide / 2.0);
    }
    for (double y = outer.y + wide / 2.0 + step; y < outer.y + outer.height - step; y += step) {
      lozenge(outer.x + wide / 2.0, y);
      lozenge(outer.x + outer.width - wide / 2.0, y);
    }
    inside.copyTo(image(inner));
    cv::rectangle(image, inner, palette[3], 3);
  }
  Mottle(&image, 4, 0.14, &random);
  return image;
}

cv::Mat DrawOutside(int width, int height, uint64_t seed) {
  RandomStream random(MixBits(seed, 13));
  cv::Mat image(height, width, CV_8UC3);
  const int meadow = height * 52 / 100;
  FillGradient(&image, {0, 0, width, meadow}, Bgr(120, 168, 222), Bgr(218, 230, 238));
  for (int i = 0; i < 90; ++i) {
    cv::ellipse(
        image, {Round(random.Uniform(0, width)), Round(height * random.Uniform(0.03, 0.4))},
        {Round(width * random.Uniform(0.01, 0.04)), Round(height * random.Uniform(0.005, 0.015))},
        0, 0, 360, Blend(Bgr(205, 218, 232), Bgr(250, 250, 250), random.Uniform()), cv::FILLED,
        cv::LINE_AA);
  }
  cv::GaussianBlur(image, image, {0, 0}, width / 500.0);
  for (int range = 0; range < 3; ++range) {
    Polygon(&image, Ridge(width, meadow, height * (0.41 + 0.03 * range), height * 0.05, &random),
            FromHsv(190 - 35 * range, 0.22 + 0.1 * range, 0.66 - 0.09 * range));
  }
  FillGradient(&image, {0, meadow, width, height - meadow}, Bgr(150, 172, 96), Bgr(84, 112, 52));
  // Fields, a row of houses far off, trees nearer and nearer.
  for (int i = 0; i < 2500; ++i) {
    const double y = random.Uniform(meadow, height),
                 length = (y - meadow + 20) * random.Uniform(0.05, 0.3);
    const int x = Round(random.Uniform(0, width));
    cv::line(image, {x, Round(y)}, {x + Round(length), Round(y + random.Uniform(-3, 3))},
             FromHsv(random.Uniform(60, 110), 0.5, random.Uniform(0.3, 0.7)), 1 + random.Index(3),
             cv::LINE_AA);
  }
  for (int house = 0; house < 16; ++house) {
    const double wide = width * random.Uniform(0.025, 0.045),
                 x = width * (0.01 + 0.0625 * house + random.Uniform(0, 0.015));
    const double top = meadow + height * random.Uniform(-0.03, 0.02);
    cv::rectangle(image, cv::Rect(Round(x), Round(top), Round(wide), Round(height * 0.06)),
                  AnyColor(&random, 0.08, 0.4, 0.75, 0.95), cv::FILLED);
    Polygon(&image,
            {{Round(x - wide * 0.1), Round(top)},
             {Round(x + wide / 2), Round(top - wide * 0.55)},
             {Round(x + wide * 1.1), Round(top)}},
            FromHsv(random.Uniform(5, 25), 0.6, random.Uniform(0.4, 0.65)));
    for (int pane = 0; pane < 6; ++pane) {
      cv::rectangle(image,
                    cv::Rect(Round(x + wide * (0.12 + 0.3 * (pane % 3))),
                             Round(top + height * (0.01 + 0.025 * (pane / 3))), Round(wide * 0.16),
                             Round(height * 0.014)),
                    Bgr(60, 75, 95), cv::FILLED);
    }
  }
  for (int tree = 0; tree < 60; ++tree) {
    const double near = (tree + 1) / 60.0, tall = height * (0.03 + 0.09 * near * near);
    const double x = random.Uniform(0, width), foot = meadow + height * (0.05 + 0.12 * near);
    cv::rectangle(image,
                  cv::Rect(Round(x - tall * 0.04), Round(foot - tall * 0.4), Round(tall * 0.08),
                           Round(tall * 0.4)),
                  Bgr(84, 62, 44), cv::FILLED);
    const double hue = random.Uniform(70, 125);
    for (int leaf = 0; leaf < 90; ++leaf) {
      const double angle = random.Uniform(0, 2 * kPi),
                   reach = tall * 0.36 * std::sqrt(random.Uniform());
      const cv::Point2d at(x + reach * std::cos(angle),
                           foot - tall * 0.62 + reach * std::sin(angle));
      cv::circle(
          image, {Round(at.x), Round(at.y)}, std::max(2, Round(tall * random.Uniform(0.03, 0.09))),
          FromHsv(hue + random.Uniform(-12, 12), 0.55,
                  (0.32 + 0.3 * (foot - tall * 0.3 - at.y) / tall) * random.Uniform(0.8, 1.2)),
          cv::FILLED, cv::LINE_AA);
    }
  }
  Mottle(&image, 2.5, 0.06, &random);
  return image;
}

cv::Mat DrawDoor(int width, int height, uint64_t seed) {
  RandomStream random(MixBits(seed, 14));
  cv::Mat image(height, width, CV_8UC3, Bgr(112, 138, 128));
  for (int i = 0; i < 260; ++i) {  // brush strokes
    const int x = Round(random.Uniform(0, width)), y = Round(random.Uniform(0, height));
    cv::line(image, {x, y},
             {x + random.Index(5) - 2, y + Round(height * random.Uniform(0.03, 0.2))},
             Bgr(112, 138, 128) * random.Uniform(0.9, 1.1), 2 + random.Index(5), cv::LINE_AA);
  }
  const double panels[4][4] = {{0.12, 0.06, 0.33, 0.4},
                               {0.55, 0.06, 0.33, 0.4},
                               {0.12, 0.54, 0.33, 0.39},
                               {0.55, 0.54, 0.33, 0.39}};
  for (const auto& p : panels) {
    const cv::Rect panel(Round(p[0] * width), Round(p[1] * height), Round(p[2] * width),
                         Round(p[3] * height));
    cv::rectangle(image, panel, Bgr(70, 88, 82), 7, cv::LINE_AA);
    cv::rectangle(image, panel - cv::Size(24, 24) + cv::Point(12, 12), Bgr(140, 165, 155), 4,
                  cv::LINE_AA);
  }
  for (int i = 0; i < 40; ++i) {  // scratches and marks
    const cv::Point at(Round(random.Uniform(0, width)), Round(random.Uniform(0, height)));
    cv::line(image, at, at + cv::Point(random.Index(60) - 30, random.Index(60) - 30),
             Bgr(80, 100, 92), 1, cv::LINE_AA);
  }
  const cv::Rect note(Round(width * 0.3), Round(height * 0.2), Round(width * 0.36),
                      Round(height * 0.15));
  cv::rectangle(image, note, Bgr(245, 225, 120), cv::FILLED);
  WriteParagraph(&image, note - cv::Size(16, 16) + cv::Point(8, 8), note.height / 8.0,
                 Bgr(40, 40, 90), &random);
  Mottle(&image, 6, 0.08, &random);
  return image;
}

}  // namespace roomtex
