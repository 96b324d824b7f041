#pragma once
// A picture to look at: places of held-out photos, and beside each what every method predicts
// there.

#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "tests/benchmark/held_out/held_out_score.h"

namespace roomtex {

// Squares of the photo, a quarter of its width (at most 320 pixels) across, in which nine tenths of
// the pixels show the scan: those with the most gradient energy, the richest first, none over
// another, `count` at most.
std::vector<cv::Rect> RichestSquares(const cv::Mat3b& photo, const cv::Mat1b& seen, int count);

// Rows are places, columns the photo and the methods in the order in which they came.
class PictureSheet {
 public:
  // Places are chosen by the first method that predicts a photo.
  void Add(const std::string& method, const std::string& photo_name, const cv::Mat3b& photo,
           const Prediction& prediction);
  // The `count` places with the most gradient energy, from as many photos as there are; empty if
  // nothing was added.
  cv::Mat3b Draw(int count) const;

 private:
  struct Place {
    std::string photo_name;
    cv::Rect square;
    double energy = 0;
    int rank = 0;                   // among the places of its photo
    std::vector<cv::Mat3b> panels;  // the photo's, then one per method
  };

  std::vector<std::string> methods_;
  std::vector<Place> places_;
};

}  // namespace roomtex
