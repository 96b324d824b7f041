#include "workflow/capture_facts.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <sstream>
#include <tuple>

#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/output_file.h"
#include "core/photo.h"
#include "core/photo_files.h"
#include "core/statistics.h"
#include "core/text.h"

namespace roomtex {

std::vector<PhotoFacts> ReadPhotoFacts(const std::string& folder) {
  std::vector<PhotoFacts> photos;
  for (const std::string& name : ListPhotoFiles(folder, "Give the photos' folder")) {
    const std::string path = folder + "/" + name;
    PhotoFacts photo;
    photo.name = name;
    const auto [width, height] = ReadPhotoSize(path);
    photo.width = width;
    photo.height = height;
    const LensData lens = ReadLensData(path);
    photo.camera = lens.camera;
    photo.focal_length_mm = lens.focal_length_mm;
    photos.push_back(std::move(photo));
  }
  return photos;
}

std::string PhotoGroup::Text() const {
  std::string text = std::to_string(names.size()) +
                     (names.size() == 1 ? " photo of " : " photos of ") + std::to_string(width) +
                     " x " + std::to_string(height);
  if (!camera.empty()) text += ", " + camera;
  if (focal_length_mm) text += ", " + Significant(*focal_length_mm, 3) + " mm";
  return text;
}

std::vector<PhotoGroup> GroupByCamera(const std::vector<PhotoFacts>& photos) {
  std::map<std::tuple<std::string, int, int, long>, PhotoGroup> groups;
  for (const PhotoFacts& photo : photos) {
    const long focal_um = photo.focal_length_mm ? std::lround(1000 * *photo.focal_length_mm) : -1L;
    PhotoGroup& group = groups[{photo.camera, photo.width, photo.height, focal_um}];
    group.camera = photo.camera;
    group.width = photo.width;
    group.height = photo.height;
    group.focal_length_mm = photo.focal_length_mm;
    group.names.push_back(photo.name);
  }
  std::vector<PhotoGroup> result;
  for (auto& [key, group] : groups) result.push_back(std::move(group));
  std::stable_sort(result.begin(), result.end(), [](const PhotoGroup& a, const PhotoGroup& b) {
    return a.names.size() > b.names.size();
  });
  return result;
}

std::vector<KnownCamera> ReadKnownCameras(const std::string& path) {
  RequireFile(path, "Give the cameras.txt that roomtex-calibrate wrote");
  std::ifstream stream(path);
  std::vector<KnownCamera> cameras;
  std::string line;
  for (long number = 1; std::getline(stream, line); ++number) {
    line = Trimmed(line);
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    KnownCamera camera;
    std::string id, param;
    words >> id >> camera.model >> camera.width >> camera.height;
    bool is_camera = static_cast<bool>(words);
    while (words >> param) {
      is_camera = is_camera && ParseNumber(param);
      camera.params += (camera.params.empty() ? "" : ",") + param;
    }
    if (!is_camera || camera.width <= 0 || camera.height <= 0 || camera.params.empty()) {
      throw InputError(path, LinePosition(number), "is no camera: " + Quoted(line),
                       "Expected COLMAP's CAMERA_ID MODEL WIDTH HEIGHT PARAMS");
    }
    cameras.push_back(std::move(camera));
  }
  if (cameras.empty()) {
    throw InputError(path, "", "holds no camera", "Give the cameras.txt of roomtex-calibrate");
  }
  return cameras;
}

namespace {

constexpr int kSmallWidth = 240;     // pixels; of the pictures that are compared
constexpr double kEdgeShare = 0.06;  // of the pixels, those with the strongest gradients
constexpr double kSameView =
    0.2;  // agreement of edges beyond that of a shifted picture; 0.3 to 0.8, and below 0.07
constexpr double kPatternedShare = 0.3;  // of neighbours
constexpr size_t kFewestPhotos = 6, kMostPairs = 16;

// Gradients of a small grey picture; two channels.
cv::Mat2f SmallGradients(const std::string& path) {
  cv::Mat1b grey = ReadGreyPhoto(path, 8);
  cv::Mat small, dx, dy;
  const double scale = static_cast<double>(kSmallWidth) / grey.cols;
  if (scale > 1.5) grey = ReadGreyPhoto(path, 1);
  cv::resize(grey, small, {kSmallWidth, std::max(1, kSmallWidth * grey.rows / grey.cols)}, 0, 0,
             cv::INTER_AREA);
  cv::GaussianBlur(small, small, {5, 5}, 1);
  cv::Sobel(small, dx, CV_32F, 1, 0);
  cv::Sobel(small, dy, CV_32F, 0, 1);
  cv::Mat2f gradients;
  cv::merge(std::vector<cv::Mat>{dx, dy}, gradients);
  return gradients;
}

// Mean cosine of twice the angle between the gradients of both, where `a` has its edges and `b` is
// looked at `shift` pixels aside: 1 = all edges lie alike, 0 = by chance.
double EdgeAgreement(const cv::Mat2f& a, const cv::Mat2f& b, int shift) {
  std::vector<float> strengths;
  for (const cv::Vec2f& g : a) strengths.push_back(g.dot(g));
  const auto rank = static_cast<size_t>((1 - kEdgeShare) * static_cast<double>(strengths.size()));
  const float least = std::max(AtRank(&strengths, rank), 1.f);
  double sum = 0;
  int count = 0;
  for (int row = 0; row < a.rows; ++row) {
    for (int column = std::max(0, -shift); column < std::min(a.cols, a.cols - shift); ++column) {
      const cv::Vec2f g = a(row, column), h = b(row, column + shift);
      const float size = g.dot(g) * h.dot(h);
      if (g.dot(g) < least || size <= 0) continue;
      const float along = g.dot(h);
      sum += 2 * along * along / size - 1;
      ++count;
    }
  }
  return count > 0 ? sum / count : 0;
}

bool ShowOneView(const cv::Mat2f& a, const cv::Mat2f& b) {
  if (a.size() != b.size()) return false;
  double best = -1;
  for (const auto& [from, to] : {std::pair(&a, &b), std::pair(&b, &a)}) {
    const double beside = std::max(EdgeAgreement(*from, *to, kSmallWidth / 12),
                                   EdgeAgreement(*from, *to, -kSmallWidth / 12));
    best = std::max(best, EdgeAgreement(*from, *to, 0) - std::max(beside, 0.0));
  }
  return best > kSameView;
}

}  // namespace

bool LooksPatterned(const std::string& folder, const std::vector<PhotoFacts>& photos) {
  if (photos.size() < kFewestPhotos) return false;
  const size_t num_pairs = photos.size() - 1, step = (num_pairs + kMostPairs - 1) / kMostPairs;
  int num_alike = 0, num_looked_at = 0;
  for (size_t i = 0; i < num_pairs; i += step) {
    try {
      const cv::Mat2f a = SmallGradients(folder + "/" + photos[i].name);
      const cv::Mat2f b = SmallGradients(folder + "/" + photos[i + 1].name);
      num_alike += ShowOneView(a, b);
      ++num_looked_at;
    } catch (const InputError&) {
      // A photo that cannot be read is told by the commands that need it.
    }
  }
  return num_looked_at > 0 && num_alike >= kPatternedShare * num_looked_at;
}

}  // namespace roomtex
