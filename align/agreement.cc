#include "align/agreement.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "core/camera_model.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/parallel.h"
#include "core/photo.h"

namespace roomtex {
namespace {

constexpr double kParzenSigma = 2.0;  // thesis A.1.2

// Intensity of the scan along the viewing rays of one photo.
struct Sighting {
  Eigen::Vector3d x_in_cam;
  uint8_t scan_grey;
};

std::vector<Sighting> LookFromPhoto(const CameraProjection& projection, const Rigid& cam_from_scan,
                                    const FreeSpace& free_space, int pixels_across) {
  const Camera& camera = projection.camera();
  const double step = std::max(1.0, static_cast<double>(camera.width) / pixels_across);
  const Rigid scan_from_cam = cam_from_scan.Inverse();
  std::vector<Sighting> sightings;
  for (double y = 0.5 * step; y < camera.height; y += step) {
    for (double x = 0.5 * step; x < camera.width; x += step) {
      const auto ray = projection.CamFromImg({x, y});
      if (!ray) continue;
      const Eigen::Vector3d direction = ray->homogeneous().normalized();
      const auto sight =
          free_space.Look(scan_from_cam.translation, scan_from_cam.rotation * direction);
      if (!sight) continue;
      sightings.push_back(
          {cam_from_scan * sight->x_in_scan, static_cast<uint8_t>(std::lround(sight->grey))});
    }
  }
  return sightings;
}

double InformationAt(const CameraProjection& projection, const std::vector<Sighting>& sightings,
                     const cv::Mat& grey, const Eigen::Quaterniond& turn) {
  JointHistogram histogram;
  for (const Sighting& sighting : sightings) {
    const auto x = projection.ImgFromCam(turn * sighting.x_in_cam);
    if (!x || !projection.InImage(*x)) continue;
    const Eigen::Vector2d at = OpenCvFromImg(*x);
    const int column = std::clamp(static_cast<int>(std::lround(at.x())), 0, grey.cols - 1);
    const int row = std::clamp(static_cast<int>(std::lround(at.y())), 0, grey.rows - 1);
    histogram.Add(grey.at<uint8_t>(row, column), sighting.scan_grey);
  }
  return histogram.MutualInformation();
}

struct PhotoAgreement {
  bool valid = false;
  std::string warning;
  long num_pixels = 0;
  double information = 0;
  std::vector<double> turned;
};

PhotoAgreement MeasurePhoto(const SparseModel& aligned, const SparseImage& image,
                            const std::string& image_path, const FreeSpace& free_space,
                            const AgreementOptions& options) {
  PhotoAgreement result;
  const Camera& camera = aligned.cameras.at(image.camera_id);
  cv::Mat grey;
  try {
    cv::cvtColor(ReadPhoto(image_path + "/" + image.name), grey, cv::COLOR_BGR2GRAY);
  } catch (const InputError& error) {
    result.warning = error.what();
    return result;
  }
  if (grey.cols != camera.width || grey.rows != camera.height) {
    result.warning = image.name + " has " + std::to_string(grey.cols) + " x " +
                     std::to_string(grey.rows) + " pixels, its camera in the model " +
                     std::to_string(camera.width) + " x " + std::to_string(camera.height) + ".";
    return result;
  }
  // One sample stands for step x step pixels: smooth the photo accordingly.
  const double step = std::max(1.0, static_cast<double>(camera.width) / options.pixels_across);
  cv::GaussianBlur(grey, grey, cv::Size(), 0.5 * step);
  const CameraProjection projection(camera);
  const std::vector<Sighting> sightings =
      LookFromPhoto(projection, image.cam_from_model, free_space, options.pixels_across);
  if (sightings.size() < 1000) return result;
  result.valid = true;
  result.num_pixels = static_cast<long>(sightings.size());
  result.information = InformationAt(projection, sightings, grey, Eigen::Quaterniond::Identity());
  for (const double turn_deg : options.turns_deg) {
    double sum = 0;
    for (int side = 0; side < 4; ++side) {
      const Eigen::Vector3d axis = Eigen::Vector3d::Unit(side / 2) * (side % 2 == 0 ? 1 : -1);
      sum += InformationAt(projection, sightings, grey,
                           Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(turn_deg), axis)));
    }
    result.turned.push_back(sum / 4);
  }
  return result;
}

}  // namespace

double JointHistogram::MutualInformation() const {
  cv::Mat density(256, 256, CV_32F);
  std::copy(bins_.begin(), bins_.end(), density.begin<float>());
  if (!(cv::sum(density)[0] > 0)) return 0;
  cv::GaussianBlur(density, density, cv::Size(17, 17), kParzenSigma, kParzenSigma,
                   cv::BORDER_CONSTANT);
  density.convertTo(density, CV_64F);
  density /= cv::sum(density)[0];
  std::vector<double> a(256, 0), b(256, 0);
  double joint_entropy = 0;
  const auto entropy = [](double p) { return p > 0 ? -p * std::log(p) : 0; };
  for (int i = 0; i < 256; ++i) {
    for (int j = 0; j < 256; ++j) {
      const double p = density.at<double>(i, j);
      a[i] += p;  // Thesis (A.5), (A.6)
      b[j] += p;
      joint_entropy += entropy(p);  // Thesis (A.9)
    }
  }
  double information = -joint_entropy;
  for (int i = 0; i < 256; ++i) information += entropy(a[i]) + entropy(b[i]);
  return information;  // Thesis (A.11)
}

Agreement MeasureAgreement(const SparseModel& aligned, const std::string& image_path,
                           const FreeSpace& free_space, const AgreementOptions& options,
                           int num_threads, std::vector<std::string>* warnings) {
  std::vector<const SparseImage*> images;
  for (const auto& [id, image] : aligned.images) images.push_back(&image);
  std::sort(images.begin(), images.end(),
            [](const SparseImage* a, const SparseImage* b) { return a->name < b->name; });
  const int n = static_cast<int>(images.size());
  const int taken = std::min(n, options.max_photos);
  std::vector<PhotoAgreement> photos(taken);
  ParallelFor(num_threads, 0, taken, [&](int i) {
    const int at = static_cast<int>((static_cast<long>(2 * i + 1) * n) / (2 * taken));
    photos[i] = MeasurePhoto(aligned, *images[at], image_path, free_space, options);
  });
  Agreement agreement;
  for (const double turn_deg : options.turns_deg) agreement.turned.push_back({turn_deg, 0});
  for (const PhotoAgreement& photo : photos) {
    if (!photo.warning.empty()) warnings->push_back("Agreement: " + photo.warning);
    if (!photo.valid) continue;
    ++agreement.num_photos;
    agreement.num_pixels += photo.num_pixels;
    agreement.mutual_information += photo.information;
    for (size_t k = 0; k < photo.turned.size(); ++k) {
      agreement.turned[k].mutual_information += photo.turned[k];
    }
  }
  if (agreement.num_photos == 0) return agreement;
  agreement.mutual_information /= agreement.num_photos;
  for (Agreement::Turned& turned : agreement.turned) {
    turned.mutual_information /= agreement.num_photos;
  }
  return agreement;
}

}  // namespace roomtex
