#include "colmap_ext/dense_workspace.h"

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/output_file.h"
#include "core/text.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;

// Neighbouring pixels lie on one surface when their inverse depths differ by less than this share.
constexpr float kSameSurface = 0.03f;

// The smaller of the two one-sided differences: it does not cross an edge of the surface.
bool OneSidedSlope(float before, float here, float after, float* slope) {
  const float limit = kSameSurface * here;
  const bool has_before = before > 0 && std::abs(here - before) < limit;
  const bool has_after = after > 0 && std::abs(after - here) < limit;
  if (has_before && has_after) *slope = 0.5f * (after - before);
  if (has_before && !has_after) *slope = here - before;
  if (!has_before && has_after) *slope = after - here;
  return has_before || has_after;
}

}  // namespace

std::string DenseWorkspace::ImagePath(const std::string& image_name) const {
  return PathInside(folder + "/images", image_name);
}
std::string DenseWorkspace::DepthMapPath(const std::string& image_name,
                                         const std::string& kind) const {
  return PathInside(folder + "/stereo/depth_maps", image_name + "." + kind + ".bin");
}
std::string DenseWorkspace::NormalMapPath(const std::string& image_name,
                                          const std::string& kind) const {
  return PathInside(folder + "/stereo/normal_maps", image_name + "." + kind + ".bin");
}

void WriteDenseArray(const std::vector<cv::Mat1f>& channels, const std::string& path) {
  OutputFile file(path);
  const cv::Mat1f& first = channels.at(0);
  file.stream() << first.cols << '&' << first.rows << '&' << channels.size() << '&';
  for (const cv::Mat1f& channel : channels) {
    for (int row = 0; row < channel.rows; ++row) {
      file.stream().write(reinterpret_cast<const char*>(channel[row]),
                          static_cast<std::streamsize>(channel.cols * sizeof(float)));
    }
  }
  file.Commit();
}

std::vector<cv::Mat1f> ReadDenseArray(const std::string& path) {
  RequireFile(path, "It is written by roomtex-dense and COLMAP's dense steps");
  std::ifstream stream(path, std::ios::binary);
  int sizes[3] = {0, 0, 0};
  for (int& size : sizes) {
    std::string word;
    for (char c = 0; word.size() < 12 && stream.get(c) && c != '&';) word += c;
    const auto number = ParseNumber(word);
    if (!number || !(*number >= 1 && *number <= 100000)) {
      throw InputError(path, BytePosition(0),
                       "has the size " + Quoted(word) + ", expected width&height&channels&",
                       "Write it again");
    }
    size = static_cast<int>(*number);
  }
  const double expected = 4.0 * sizes[0] * sizes[1] * sizes[2];
  const auto left = static_cast<double>(fs::file_size(path)) - static_cast<double>(stream.tellg());
  if (left != expected) {
    throw InputError(
        path, "", "holds " + Number(left, 0) + " bytes of values, expected " + Number(expected, 0),
        "The file is cut off: write it again");
  }
  std::vector<cv::Mat1f> channels;
  for (int k = 0; k < sizes[2]; ++k) {
    cv::Mat1f channel(sizes[1], sizes[0]);
    stream.read(reinterpret_cast<char*>(channel.data),
                static_cast<std::streamsize>(channel.total() * sizeof(float)));
    channels.push_back(channel);
  }
  return channels;
}

std::vector<cv::Mat1f> NormalsOfDepth(const cv::Mat1f& depth, const std::vector<double>& pinhole,
                                      int radius_px) {
  cv::Mat1f w(depth.size());  // inverse depth
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) w(y, x) = depth(y, x) > 0 ? 1 / depth(y, x) : 0;
  }
  // Slopes over the inverse depth: they are even over a plane, whatever lies beside it.
  cv::Mat1f slope_x(depth.size(), 0.0f), slope_y(depth.size(), 0.0f), known(depth.size(), 0.0f);
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      const float here = w(y, x);
      if (!(here > 0)) continue;
      const float left = x > 0 ? w(y, x - 1) : 0, right = x + 1 < w.cols ? w(y, x + 1) : 0;
      const float above = y > 0 ? w(y - 1, x) : 0, below = y + 1 < w.rows ? w(y + 1, x) : 0;
      if (!OneSidedSlope(left, here, right, &slope_x(y, x)) ||
          !OneSidedSlope(above, here, below, &slope_y(y, x))) {
        slope_x(y, x) = slope_y(y, x) = 0;
        continue;
      }
      known(y, x) = 1;
    }
  }
  const cv::Size box(2 * radius_px + 1, 2 * radius_px + 1);
  for (cv::Mat1f* map : {&slope_x, &slope_y, &known}) {
    cv::boxFilter(*map, *map, CV_32F, box, {-1, -1}, false, cv::BORDER_CONSTANT);
  }
  const auto fx = static_cast<float>(pinhole[0]), fy = static_cast<float>(pinhole[1]);
  const auto cx = static_cast<float>(pinhole[2]), cy = static_cast<float>(pinhole[3]);
  std::vector<cv::Mat1f> normals;
  for (int k = 0; k < 3; ++k) normals.emplace_back(cv::Mat1f::zeros(depth.size()));
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      if (!(w(y, x) > 0) || known(y, x) < 0.5f) continue;
      const float a = slope_x(y, x) / known(y, x), b = slope_y(y, x) / known(y, x);
      // On the plane n.X = d the inverse depth is (n/d).(K^-1 x).
      const Eigen::Vector3f away(fx * a, fy * b,
                                 w(y, x) - (static_cast<float>(x) + 0.5f - cx) * a -
                                     (static_cast<float>(y) + 0.5f - cy) * b);
      const Eigen::Vector3f normal = -away.normalized();
      for (int k = 0; k < 3; ++k) normals[k](y, x) = normal[k];
    }
  }
  return normals;
}

void WriteStereoConfiguration(const std::vector<std::string>& image_names,
                              const DenseWorkspace& workspace) {
  OutputFile patch_match(PathInside(workspace.folder + "/stereo", "patch-match.cfg"));
  OutputFile fusion(PathInside(workspace.folder + "/stereo", "fusion.cfg"));
  for (const std::string& name : image_names) {
    patch_match.stream() << name << "\n__auto__, 20\n";
    fusion.stream() << name << "\n";
  }
  patch_match.Commit();
  fusion.Commit();
}

}  // namespace roomtex
