#include "capture/simulation/room_pictures.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "capture/simulation/picture_drawing.h"
#include "core/frames.h"

namespace roomtex {

using namespace drawing;

namespace {

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

}  // namespace roomtex
