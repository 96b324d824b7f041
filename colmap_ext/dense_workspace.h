#pragma once
// The folder that COLMAP's dense steps work in: images/, sparse/, stereo/
// (https://colmap.github.io/format.html, "Dense Reconstruction"). Pictures are those of pinhole
// cameras.

#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace roomtex {

// Folders may be part of an image's name: they are made.
struct DenseWorkspace {
  std::string folder;

  std::string ImagePath(const std::string& image_name) const;
  // kind: "geometric" or "photometric".
  std::string DepthMapPath(const std::string& image_name, const std::string& kind) const;
  std::string NormalMapPath(const std::string& image_name, const std::string& kind) const;
};

// An array of COLMAP's: the text "width&height&channels&", then float32, little-endian, one channel
// after the other, each row by row. A depth map has one channel (metres along the optical axis, 0 =
// unknown), a normal map three (x, y, z in `cam`, towards the camera; 0 = unknown). All channels of
// one size; makes the folder. Throws InputError.
void WriteDenseArray(const std::vector<cv::Mat1f>& channels, const std::string& path);
// Throws InputError: missing, cut off, of impossible size.
std::vector<cv::Mat1f> ReadDenseArray(const std::string& path);

// Unit normals in `cam` by the slope of the inverse depth, which is linear in the picture on a
// plane; averaged over the pixels up to radius_px away. 0 where the depth is. pinhole: the
// parameters of the PINHOLE camera.
std::vector<cv::Mat1f> NormalsOfDepth(const cv::Mat1f& depth, const std::vector<double>& pinhole,
                                      int radius_px);

// stereo/patch-match.cfg and stereo/fusion.cfg for all images.
void WriteStereoConfiguration(const std::vector<std::string>& image_names,
                              const DenseWorkspace& workspace);

}  // namespace roomtex
