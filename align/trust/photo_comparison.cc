#include "align/trust/photo_comparison.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "align/trust/perspective_views.h"
#include "core/camera_model.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr float kUnseen = std::numeric_limits<float>::quiet_NaN();
constexpr int kGainRounds = 5;

std::vector<Eigen::Vector3d> SpreadSamples(const std::vector<Scan>& scans, int count) {
  size_t num_all = 0;
  for (const Scan& scan : scans) num_all += scan.points.size();
  const size_t stride = num_all / static_cast<size_t>(count) + 1;
  std::vector<Eigen::Vector3d> samples;
  size_t next = 0, before = 0;
  for (const Scan& scan : scans) {
    for (; next < before + scan.points.size(); next += stride) {
      const size_t i = next - before;
      if (!scan.IsMissing(static_cast<int>(i))) samples.push_back(scan.points[i]);
    }
    before += scan.points.size();
  }
  return samples;
}

// LogLight() of a photo at every sample; kUnseen where it does not see it.
std::vector<float> LightAt(const std::vector<Eigen::Vector3d>& samples, const PhotoAndView& look,
                           const CameraProjection& projection, const Rigid& cam_from_scan) {
  const ScanView& view = look.view;
  std::vector<float> light(samples.size(), kUnseen);
  for (size_t i = 0; i < samples.size(); ++i) {
    const Eigen::Vector3d x_in_cam = cam_from_scan * samples[i];
    if (!(x_in_cam.z() > 0)) continue;
    const auto x_in_img = projection.ImgFromCam(x_in_cam);
    if (!x_in_img) continue;
    const double column = x_in_img->x() / view.cell_px, row = x_in_img->y() / view.cell_px;
    if (!(column >= 0 && column < view.depth.cols && row >= 0 && row < view.depth.rows)) continue;
    const int x = static_cast<int>(column), y = static_cast<int>(row);
    if (view.valid(y, x) && IsAsDeep(view.depth(y, x), x_in_cam.z())) {
      light[i] = LogLight(look.cells.at<cv::Vec3b>(y, x));
    }
  }
  return light;
}

// Makes the exposures equal: each photo is as bright as the median of all, in the median of what it
// sees; the whole then has the mean that photos have.
void MakeEven(std::vector<std::vector<float>>* light) {
  if (light->empty()) return;
  const size_t num_samples = light->front().size();
  std::vector<double> values;
  for (int round = 0; round < kGainRounds; ++round) {
    std::vector<std::vector<double>> above(light->size());
    for (size_t i = 0; i < num_samples; ++i) {
      values.clear();
      for (const std::vector<float>& photo : *light) {
        if (!std::isnan(photo[i])) values.push_back(photo[i]);
      }
      if (values.size() < 2) continue;
      const double usual = Median(&values);
      for (size_t k = 0; k < light->size(); ++k) {
        if (!std::isnan((*light)[k][i])) above[k].push_back((*light)[k][i] - usual);
      }
    }
    for (size_t k = 0; k < light->size(); ++k) {
      if (above[k].empty()) continue;
      const float excess = static_cast<float>(Median(&above[k]));
      for (float& value : (*light)[k]) value -= excess;
    }
  }
}

}  // namespace

PhotoComparison ComparePhotosOnScan(const AlignedPhotos& aligned, const ScanViewer& viewer,
                                    const PhotoComparisonOptions& options, int num_threads) {
  const PerspectiveViews views(aligned);
  const std::vector<const SparseImage*> images = SpreadImages(views.model(), options.num_photos);
  std::map<uint32_t, LookSetup> cameras;
  for (const SparseImage* image : images) {
    const Camera& camera = views.model().cameras.at(image->camera_id);
    cameras.try_emplace(image->camera_id, camera, viewer,
                        std::max(1, std::max(camera.width, camera.height) / options.pixels_across));
  }
  const std::vector<Eigen::Vector3d> samples = SpreadSamples(viewer.scans(), options.num_samples);
  std::vector<std::vector<float>> light(images.size());
  ParallelFor(num_threads, 0, static_cast<int>(images.size()), [&](int k) {
    const SparseImage& image = *images[k];
    const LookSetup& camera = cameras.at(image.camera_id);
    light[k].assign(samples.size(), kUnseen);
    std::string ignored;  // MeasureAgreement() says it
    const auto look = views.Look(viewer, image, camera, &ignored);
    if (look) light[k] = LightAt(samples, *look, camera.projection, image.cam_from_model);
  });
  MakeEven(&light);

  PhotoComparison comparison(images.size());
  std::vector<std::pair<int, float>> seen;
  for (size_t i = 0; i < samples.size(); ++i) {
    seen.clear();
    for (size_t k = 0; k < light.size(); ++k) {
      if (!std::isnan(light[k][i])) {
        seen.emplace_back(static_cast<int>(k), std::exp(0.5f * light[k][i]));
      }
    }
    comparison.Add(seen);
  }
  return comparison;
}

}  // namespace roomtex
