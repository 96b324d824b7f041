#include "capture/simulation/stranger.h"

#include "capture/simulation/picture_drawing.h"
#include "core/random_stream.h"

namespace roomtex {

void DrawStranger(uint64_t seed, cv::Mat* photo) {
  using drawing::Round;
  RandomStream random(seed);
  const double width = 0.2 * photo->cols, height = random.Uniform(0.6, 0.85) * photo->rows;
  const double middle = random.Uniform(0.15, 0.85) * photo->cols, top = photo->rows - height;
  const cv::Scalar skin = drawing::Bgr(215, 170, 140);
  const cv::Scalar shirt = drawing::AnyColor(&random), trousers = drawing::AnyColor(&random);
  const double head = 0.13 * height, shoulders = top + 1.7 * head, waist = top + 0.55 * height;
  drawing::Polygon(photo,
                   {{Round(middle - 0.4 * width), photo->rows},
                    {Round(middle - 0.35 * width), Round(waist)},
                    {Round(middle + 0.35 * width), Round(waist)},
                    {Round(middle + 0.4 * width), photo->rows}},
                   trousers);
  drawing::Polygon(photo,
                   {{Round(middle - 0.5 * width), Round(waist)},
                    {Round(middle - 0.45 * width), Round(shoulders)},
                    {Round(middle + 0.45 * width), Round(shoulders)},
                    {Round(middle + 0.5 * width), Round(waist)}},
                   shirt);
  cv::ellipse(*photo, cv::Point(Round(middle), Round(top + head)),
              cv::Size(Round(0.75 * head), Round(head)), 0, 0, 360, skin, cv::FILLED, cv::LINE_AA);
}

}  // namespace roomtex
