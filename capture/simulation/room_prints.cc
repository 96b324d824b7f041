// The smaller things of room_pictures.h, and what is to be seen through the window.

#include <algorithm>
#include <cmath>
#include <vector>

#include "capture/simulation/picture_drawing.h"
#include "capture/simulation/room_pictures.h"
#include "core/frames.h"

namespace roomtex {

using namespace drawing;

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
  // As many words as the spine has room for.
  std::string title = Word(&random);
  const double letter =
      std::min({width * 0.5, 26.0, 0.75 * height / (0.95 * static_cast<double>(title.size()))});
  const auto room = static_cast<size_t>(0.75 * height / (0.95 * letter));
  for (std::string word = Word(&random); title.size() + 1 + word.size() <= room;
       word = Word(&random)) {
    title += " " + word;
  }
  Write(&lying, title, height * random.Uniform(0.05, 0.1), width * 0.5 + letter / 2, letter, ink,
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
  WriteParagraph(&image, note - cv::Size(16, 16) + cv::Point(8, 8), note.height / 17.0,
                 Bgr(40, 40, 90), &random);
  Mottle(&image, 6, 0.08, &random);
  return image;
}

}  // namespace roomtex
