#pragma once
// A click in a photo, moved onto the corner that was meant.

#include <optional>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace roomtex {

// The corner within `reach` pixels of x_in_img, to a fraction of a pixel: the place to which the
// gradients around it are square (Förstner and Gülch 1987; cv::cornerSubPix). None where there are
// only edges, nothing, or noise, and where the place depends on how much around it is looked at.
std::optional<Eigen::Vector2d> FindCorner(const cv::Mat1b& photo, const Eigen::Vector2d& x_in_img,
                                          double reach);

}  // namespace roomtex
