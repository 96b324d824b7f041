#pragma once
// Pictures for the simulated room: 8-bit BGR, sRGB, drawn from a seed. width and height in pixels;
// one pixel is meant to be about a millimetre.

#include <cstdint>
#include <string>

#include <opencv2/core/mat.hpp>

namespace roomtex {

cv::Mat DrawLandscape(int width, int height, uint64_t seed);  // mountains, lake, firs
cv::Mat DrawAbstract(int width, int height, uint64_t seed);   // circles, bars and lines
cv::Mat DrawTextPoster(int width, int height, const std::string& title, uint64_t seed);
cv::Mat DrawMap(int width, int height, const std::string& title, uint64_t seed);
cv::Mat DrawCity(int width, int height, uint64_t seed);  // a skyline at dusk
cv::Mat DrawFlowers(int width, int height, uint64_t seed);
cv::Mat DrawCalendar(int width, int height, uint64_t seed);
cv::Mat DrawClock(int size, uint64_t seed);
cv::Mat DrawScreen(int width, int height, uint64_t seed);  // lines of a program
cv::Mat DrawBookSpine(int width, int height, uint64_t seed);
cv::Mat DrawCardboard(int width, int height, uint64_t seed);  // a parcel with tape, label and marks
cv::Mat DrawRug(int width, int height, uint64_t seed);
cv::Mat DrawOutside(int width, int height, uint64_t seed);  // what is to be seen through the window
cv::Mat DrawDoor(int width, int height, uint64_t seed);     // panelled door

}  // namespace roomtex
