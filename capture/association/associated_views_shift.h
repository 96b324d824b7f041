#pragma once
// How far the camera moved between two photos of one scene in different light: plain light, and the
// light of projectors, which puts strong edges of its own onto everything. What both photos show
// are the edges of the things themselves.

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace roomtex {

// A small picture of the directions of a photo's edges: two channels, horizontal and vertical;
// faint edges are short, all others about 1 long.
using EdgeThumb = cv::Mat2f;
// grey: 8 bit.
EdgeThumb MakeEdgeThumb(const cv::Mat1b& grey);

struct CoarseShift {
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();  // pixels of the thumb: x_second - x_first
  double agreement = 0;  // share of the edges of the photo with fewer edges that the other has too
  double significance = 0;  // peak over standard deviation of the correlation elsewhere
};
// Searches shifts of up to max_shift pixels each way (correlation of edge directions, Fitch et al.
// 2002: light does not turn edges).
CoarseShift FindCoarseShift(const EdgeThumb& first, const EdgeThumb& second, int max_shift);

struct CameraShift {
  bool found = false;  // edges enough that both show
  // Motion of the picture, x_second - x_first in pixels: at the middle, and what a roll about it
  // and a change of scale add at the corners.
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();
  double roll_px = 0, scale_px = 0;
  double offset_px = 0;  // root mean square of the motion over the picture
  double error_px = 0;   // standard deviation of offset_px, from how far the edges contradict
  double advantage = 0;  // logarithm of how much likelier the photos are with it than unmoved
  int num_tiles = 0;     // pieces of edges that took part
};
// plain: the photo with fewer edges. Each small tile of the plain photo that holds an edge is
// fitted to the patterned photo (contrast free, shift linearised, coarse to fine), and the tiles
// are joined robustly, weighted by what they know in which direction.
CameraShift FindCameraShift(const cv::Mat1b& plain, const cv::Mat1b& patterned,
                            const Eigen::Vector2d& start);

}  // namespace roomtex
