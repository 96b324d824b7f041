#include "workflow/video_frames.h"

#include <cstring>
#include <filesystem>
#include <set>
#include <utility>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "core/error.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;

cv::Mat Checkered(int shift) {
  cv::Mat picture(120, 160, CV_8UC3);
  for (int row = 0; row < picture.rows; ++row) {
    for (int column = 0; column < picture.cols; ++column) {
      const bool light = ((row / 10) + ((column + shift) / 10)) % 2 == 0;
      picture.at<cv::Vec3b>(row, column) = light ? cv::Vec3b(200, 210, 220) : cv::Vec3b(30, 40, 50);
    }
  }
  return picture;
}

// Frames of a moving pattern; all but every fifth (2, 7, 12 ...) are blurred.
std::string WriteVideo(const std::string& path, int num_frames) {
  cv::VideoWriter writer(path, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, {160, 120});
  for (int i = 0; i < num_frames; ++i) {
    cv::Mat picture = Checkered(i);
    if (i % 5 != 2) cv::GaussianBlur(picture, picture, {}, 4);
    writer.write(picture);
  }
  return path;
}

std::set<std::string> Names(const std::string& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename());
  return names;
}

TEST(WriteSharpFrames, TakesTheSharpestOfEveryStretch) {
  const TempFolder folder;
  const std::string video = WriteVideo(folder / "video.avi", 40);
  double last = 0;
  WriteSharpFrames(video, folder / "frames", 8, [&](double share) {
    EXPECT_GE(share, last);
    EXPECT_LE(share, 1);
    last = share;
  });
  EXPECT_EQ(Names(folder / "frames"),
            (std::set<std::string>{"frame_000002.jpg", "frame_000007.jpg", "frame_000012.jpg",
                                   "frame_000017.jpg", "frame_000022.jpg", "frame_000027.jpg",
                                   "frame_000032.jpg", "frame_000037.jpg"}));
  EXPECT_FALSE(fs::exists(folder / "frames.partial"));
}

TEST(WriteSharpFrames, TakesNoMoreThanThereAre) {
  const TempFolder folder;
  WriteSharpFrames(WriteVideo(folder / "video.avi", 5), folder / "frames", 100, [](double) {});
  EXPECT_EQ(Names(folder / "frames").size(), 5u);
}

// The number of frames in the headers of an AVI: dwTotalFrames and dwLength.
void TellFrames(const std::string& path, uint32_t num_frames) {
  std::string bytes = ReadBytes(path);
  const std::pair<const char*, size_t> kPlaces[] = {{"avih", 16}, {"strh", 32}};
  for (const auto& [chunk, offset] : kPlaces) {
    const size_t at = bytes.find(chunk);
    ASSERT_NE(at, std::string::npos);
    std::memcpy(&bytes[at + 8 + offset], &num_frames, sizeof num_frames);
  }
  WriteBytes(path, bytes);
}

TEST(WriteSharpFrames, CountsTheFramesThatAreThereWhereTheHeaderIsWrong) {
  const TempFolder folder;
  const std::string video = WriteVideo(folder / "video.avi", 40);
  TellFrames(video, 200);
  WriteSharpFrames(video, folder / "frames", 8, [](double) {});
  EXPECT_EQ(Names(folder / "frames"),
            (std::set<std::string>{"frame_000002.jpg", "frame_000007.jpg", "frame_000012.jpg",
                                   "frame_000017.jpg", "frame_000022.jpg", "frame_000027.jpg",
                                   "frame_000032.jpg", "frame_000037.jpg"}));
}

TEST(WriteSharpFrames, RefusesWhatIsNoVideo) {
  const TempFolder folder;
  WriteBytes(folder / "video.mp4", "no video");
  EXPECT_INPUT_ERROR(WriteSharpFrames(folder / "video.mp4", folder / "frames", 5, [](double) {}),
                     "cannot be read as a video");
  EXPECT_FALSE(fs::exists(folder / "frames"));
}

TEST(Sharpness, IsLessWhenBlurred) {
  const cv::Mat sharp = Checkered(0);
  cv::Mat blurred;
  cv::GaussianBlur(sharp, blurred, {}, 2);
  EXPECT_GT(Sharpness(sharp), 2 * Sharpness(blurred));
}

}  // namespace
}  // namespace roomtex
