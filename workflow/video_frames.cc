#include "workflow/video_frames.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "core/child_program.h"
#include "core/error.h"
#include "core/output_file.h"
#include "core/output_set.h"
#include "core/partial_path.h"
#include "core/picture_file.h"

namespace roomtex {
namespace fs = std::filesystem;
namespace {

constexpr char kVideoRemedy[] = "Give a video that plays, e.g. .mp4, .mov or .avi";
constexpr double kMiscounted = 0.05;  // share
constexpr double kMiddle = 0.6;       // share of a stretch that a picture is taken from

cv::VideoCapture Open(const std::string& video) {
  cv::VideoCapture capture;
  for (const int backend : {cv::CAP_FFMPEG, cv::CAP_OPENCV_MJPEG}) {
    if (capture.open(video, backend)) break;
  }
  return capture;
}

// Videos whose header does not tell have to be run through.
long CountFrames(const std::string& video) {
  cv::VideoCapture capture = Open(video);
  const double told = capture.get(cv::CAP_PROP_FRAME_COUNT);
  if (told > 0) return std::lround(told);
  long count = 0;
  while (capture.grab()) ++count;
  return count;
}

void WriteFrame(const std::string& folder, long number, const cv::Mat& picture) {
  char name[32];
  std::snprintf(name, sizeof name, "/frame_%06ld.jpg", number);
  WritePictureFile(folder + name, picture, {cv::IMWRITE_JPEG_QUALITY, 95});
}

// Runs through the video as if it had `count` pictures; how many it has.
long WriteFrames(const std::string& video, const std::string& folder, long count, int wanted,
                 const std::function<void(double)>& share) {
  cv::VideoCapture capture = Open(video);
  if (!capture.isOpened()) throw InputError(video, "", "cannot be read as a video", kVideoRemedy);
  const double stretch = std::max(1.0, static_cast<double>(count) / wanted);
  const double margin = stretch < 3 ? 0 : (1 - kMiddle) / 2 * stretch;
  cv::Mat picture, best;
  double best_sharpness = -1;
  long best_number = 0, stretch_of_best = 0, number = 0;
  const auto finish = [&] {
    if (best_sharpness >= 0) WriteFrame(folder, best_number, best);
    best_sharpness = -1;
  };
  for (; capture.grab(); ++number) {
    ThrowIfInterrupted();
    const auto place = static_cast<long>(static_cast<double>(number) / stretch);
    if (place != stretch_of_best) finish();
    stretch_of_best = place;
    const double within = static_cast<double>(number) - static_cast<double>(place) * stretch;
    if (within < margin || within > stretch - margin) continue;
    if (!capture.retrieve(picture) || picture.empty()) continue;
    const double sharpness = Sharpness(picture);
    if (sharpness > best_sharpness) {
      best_sharpness = sharpness;
      best_number = number;
      picture.copyTo(best);
    }
    share(std::min(1.0, static_cast<double>(number) / static_cast<double>(count)));
  }
  finish();
  return number;
}

}  // namespace

double Sharpness(const cv::Mat& bgr) {
  cv::Mat small, grey, laplacian;
  const double scale = std::min(1.0, 960.0 / std::max(bgr.cols, bgr.rows));
  cv::resize(bgr, small, {}, scale, scale, cv::INTER_AREA);
  cv::cvtColor(small, grey, cv::COLOR_BGR2GRAY);
  cv::Laplacian(grey, laplacian, CV_32F);
  cv::Scalar mean, deviation;
  cv::meanStdDev(laplacian, mean, deviation);
  return deviation[0];
}

void WriteSharpFrames(const std::string& video, const std::string& folder, int wanted,
                      const std::function<void(double)>& share) {
  RequireFile(video, kVideoRemedy);
  const long told = CountFrames(video);
  if (told < 3) throw InputError(video, "", "cannot be read as a video", kVideoRemedy);
  const PartialFolder aside(fs::path(folder).parent_path().string());
  const std::string& partial = aside.path();
  const long count = WriteFrames(video, partial, told, wanted, share);
  // Some headers count pictures that were dropped, or those of a file that was cut off.
  if (count > 0 && static_cast<double>(std::abs(told - count)) > kMiscounted * told) {
    for (const auto& entry : fs::directory_iterator(partial)) fs::remove(entry.path());
    WriteFrames(video, partial, count, wanted, share);
  }
  if (fs::is_empty(partial)) {
    throw InputError(video, "", "holds no picture that can be decoded", kVideoRemedy);
  }
  if (ChangePlaces(partial, folder)) return;
  fs::remove_all(folder);
  fs::rename(partial, folder);
}

}  // namespace roomtex
