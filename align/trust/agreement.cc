#include "align/trust/agreement.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>

#include <opencv2/imgproc.hpp>

#include "align/trust/perspective_views.h"
#include "core/camera_model.h"
#include "core/frames.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

constexpr double kParzenSigma = 2.0;     // thesis A.1.2
constexpr double kMinValidShare = 0.02;  // a photo that sees less of the scan says nothing

constexpr int kMaxSets = 3;  // of photos, see AgreementOptions

// What all photos of one camera share.
struct CameraSetup {
  LookSetup look;
  int coarse_cells = 1;  // cells of the view per position of Appendix A, in a row
  // Per turn and direction: where the turned camera has each coarse position, for cv::remap of the
  // coarse photo.
  std::vector<std::vector<cv::Mat2f>> turned_positions = {};
};

CameraSetup SetUpCamera(const Camera& camera, const ScanViewer& viewer,
                        const AgreementOptions& options) {
  CameraSetup setup{LookSetup(camera, viewer, FinestCell(camera, viewer))};
  const int columns = camera.width / setup.look.cell_px, rows = camera.height / setup.look.cell_px;
  setup.coarse_cells = std::max(
      1, static_cast<int>(std::lround(static_cast<double>(columns) / options.pixels_across)));
  setup.coarse_cells = std::min({setup.coarse_cells, columns, rows});

  const double step = setup.look.cell_px * setup.coarse_cells;
  const cv::Size size(columns / setup.coarse_cells, rows / setup.coarse_cells);
  for (const double turn_deg : options.turns_deg) {
    setup.turned_positions.emplace_back();
    for (int side = 0; side < 4; ++side) {
      const Eigen::Vector3d axis = Eigen::Vector3d::Unit(side / 2) * (side % 2 == 0 ? 1 : -1);
      const Eigen::Matrix3d turn = Eigen::AngleAxisd(RadFromDeg(turn_deg), axis).toRotationMatrix();
      cv::Mat2f positions(size);
      for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x) {
          const Eigen::Vector2d ray =
              setup.look.lattice.RayAt({(x + 0.5) * step, (y + 0.5) * step});
          const auto at = setup.look.projection.ImgFromCam(turn * ray.homogeneous());
          positions(y, x) = at ? cv::Vec2f(static_cast<float>(at->x() / step - 0.5),
                                           static_cast<float>(at->y() / step - 0.5))
                               : cv::Vec2f(-10, -10);
        }
      }
      setup.turned_positions.back().push_back(positions);
    }
  }
  return setup;
}

// Mask M of thesis (A.2) over both images.
ImageMeasures CompareImages(const cv::Mat1b& photo, const cv::Mat1b& scan, const cv::Mat1b& valid,
                            int ncc_patch) {
  JointHistogram histogram;
  for (int y = 0; y < photo.rows; ++y) {
    for (int x = 0; x < photo.cols; ++x) {
      if (valid(y, x)) histogram.Add(photo(y, x), scan(y, x));
    }
  }
  const JointHistogram::Dependence dependence = histogram.Measure();
  return {dependence.mutual_information, dependence.chi_square,
          PatchNcc(photo, scan, valid, ncc_patch)};
}

void AddMeasures(const ImageMeasures& other, double weight, ImageMeasures* sum) {
  sum->mutual_information += weight * other.mutual_information;
  sum->chi_square += weight * other.chi_square;
  sum->patch_ncc += weight * other.patch_ncc;
}

struct PhotoMeasures {
  bool valid = false;
  std::string warning;
  long num_pixels = 0;
  ImageMeasures at_pose;
  std::vector<ImageMeasures> turned;
  GradientShifts shifts;
};

// Appendix A: photo and scan at coarse positions.
void MeasureImages(const ScanView& view, const cv::Mat& photo, const CameraSetup& setup,
                   const AgreementOptions& options, PhotoMeasures* result) {
  const int k = setup.coarse_cells;
  const cv::Size size(view.grey.cols / k, view.grey.rows / k);
  const cv::Rect whole(0, 0, size.width * k, size.height * k);
  const int px = view.cell_px;
  cv::Mat photo_grey;
  cv::cvtColor(photo(cv::Rect(0, 0, whole.width * px, whole.height * px)), photo_grey,
               cv::COLOR_BGR2GRAY);
  cv::Mat1b coarse_photo, scan_grey, coarse_scan, valid;
  cv::resize(photo_grey, coarse_photo, size, 0, 0, cv::INTER_AREA);
  view.grey(whole).convertTo(scan_grey, CV_8U);
  cv::resize(scan_grey, coarse_scan, size, 0, 0, cv::INTER_AREA);
  cv::Mat1f covered;
  view.valid(whole).convertTo(covered, CV_32F);
  cv::resize(covered, covered, size, 0, 0, cv::INTER_AREA);
  valid = covered > 254;
  result->num_pixels = cv::countNonZero(valid);
  result->at_pose = CompareImages(coarse_photo, coarse_scan, valid, options.ncc_patch);
  for (const auto& directions : setup.turned_positions) {
    ImageMeasures mean;
    for (const cv::Mat2f& positions : directions) {
      cv::Mat1b turned, inside(size, static_cast<uchar>(255)), both;
      cv::remap(coarse_photo, turned, positions, cv::noArray(), cv::INTER_LINEAR,
                cv::BORDER_CONSTANT, 0);
      cv::remap(inside, both, positions, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_CONSTANT, 0);
      both = (both == 255) & valid;
      AddMeasures(CompareImages(turned, coarse_scan, both, options.ncc_patch),
                  1.0 / directions.size(), &mean);
    }
    result->turned.push_back(mean);
  }
}

PhotoMeasures MeasurePhoto(const PerspectiveViews& views, const SparseImage& image,
                           const ScanViewer& viewer, const CameraSetup& setup,
                           const AgreementOptions& options) {
  PhotoMeasures result;
  const auto read = views.Read(image, &result.warning);
  if (!read) return result;
  ScanView view = setup.look.Look(viewer, image.cam_from_model);
  const cv::Mat photo = views.Still(image, view, setup.look, *read);
  views.LeaveOutTransparent(image, &view);
  if (view.valid_share < kMinValidShare) return result;
  result.valid = true;
  MeasureImages(view, photo, setup, options, &result);
  result.shifts = MeasureGradientShifts(view, photo, setup.look.projection, viewer.sample_angle(),
                                        options.gradient);
  if (result.shifts.num_unclear_photos > 0) result.shifts.shifted_alike.clear();
  for (auto* const corners : {&result.shifts.corners, &result.shifts.shifted_alike}) {
    for (FittingCorner& corner : *corners) corner.image_id = image.image_id;
  }
  return result;
}

double NegativeEntropyTerm(double p) { return p > 0 ? p * std::log(p) : 0; }

}  // namespace

JointHistogram::Dependence JointHistogram::Measure() const {
  cv::Mat1f smoothed(256, 256);
  std::copy(bins_.begin(), bins_.end(), smoothed.begin());
  if (!(cv::sum(smoothed)[0] > 0)) return {};
  cv::GaussianBlur(smoothed, smoothed, cv::Size(17, 17), kParzenSigma, kParzenSigma,
                   cv::BORDER_CONSTANT);
  cv::Mat1d density;
  smoothed.convertTo(density, CV_64F, 1 / cv::sum(smoothed)[0]);  // Thesis (A.4)
  std::vector<double> a(256, 0), b(256, 0);
  for (int i = 0; i < 256; ++i) {
    for (int j = 0; j < 256; ++j) {
      a[i] += density(i, j);  // Thesis (A.5), (A.6)
      b[j] += density(i, j);
    }
  }
  Dependence result;
  for (int i = 0; i < 256; ++i) {
    result.mutual_information -= NegativeEntropyTerm(a[i]) + NegativeEntropyTerm(b[i]);
    for (int j = 0; j < 256; ++j) {
      result.mutual_information += NegativeEntropyTerm(density(i, j));  // Thesis (A.11)
      const double expected = a[i] * b[j];                              // Thesis (A.13)
      if (!(expected > 0)) continue;
      result.chi_square += std::pow(density(i, j) - expected, 2) / expected;  // Thesis (A.14)
    }
  }
  return result;
}

double PatchNcc(const cv::Mat1b& a, const cv::Mat1b& b, const cv::Mat1b& valid, int patch) {
  double sum = 0;
  int count = 0;
  const double n = static_cast<double>(patch) * patch;
  for (int top = 0; top + patch <= a.rows; top += patch) {
    for (int left = 0; left + patch <= a.cols; left += patch) {
      const cv::Rect area(left, top, patch, patch);
      if (cv::countNonZero(valid(area)) < patch * patch) continue;
      // Sums of whole numbers: exact.
      long sum_a = 0, sum_b = 0, sum_aa = 0, sum_bb = 0, sum_ab = 0;
      for (int y = top; y < top + patch; ++y) {
        for (int x = left; x < left + patch; ++x) {
          const long va = a(y, x), vb = b(y, x);
          sum_a += va;
          sum_b += vb;
          sum_aa += va * va;
          sum_bb += vb * vb;
          sum_ab += va * vb;
        }
      }
      const double aa = sum_aa - sum_a / n * sum_a, bb = sum_bb - sum_b / n * sum_b;
      const double ab = sum_ab - sum_a / n * sum_b;  // Thesis (A.22)
      if (!(aa > 1e-6) || !(bb > 1e-6) || !(ab > 0)) continue;
      // Thesis (A.19); the root, without which it would not lie in [-1, 1], is lost in its print.
      sum += ab / std::sqrt(aa * bb);
      ++count;
    }
  }
  return count > 0 ? sum / count : 0;
}

Agreement MeasureAgreement(const AlignedPhotos& aligned, const ScanViewer& viewer,
                           const AgreementOptions& options, int num_threads,
                           std::vector<std::string>* warnings) {
  const PerspectiveViews views(aligned);
  // Every num_sets-th of them make a set of its own that is spread over all.
  const std::vector<const SparseImage*> images =
      SpreadImages(views.model(), kMaxSets * options.num_photos);
  const int num_images = static_cast<int>(images.size());
  const int num_sets = std::max(1, (num_images + options.num_photos - 1) / options.num_photos);
  std::map<uint32_t, CameraSetup> setups;
  std::vector<PhotoMeasures> photos(images.size());
  long num_patches = 0;
  for (int set = 0; set < num_sets && num_patches < options.enough_patches; ++set) {
    std::vector<int> members;
    for (int i = (set + num_sets / 2) % num_sets; i < num_images; i += num_sets) {
      members.push_back(i);
      const uint32_t camera_id = images[i]->camera_id;
      if (setups.count(camera_id)) continue;
      setups.emplace(camera_id, SetUpCamera(views.model().cameras.at(camera_id), viewer, options));
    }
    ParallelFor(num_threads, 0, static_cast<int>(members.size()), [&](int k) {
      const int i = members[k];
      photos[i] = MeasurePhoto(views, *images[i], viewer, setups.at(images[i]->camera_id), options);
    });
    bool any = false;
    for (const int i : members) {
      any = any || photos[i].valid;
      num_patches += photos[i].shifts.at_pose.num;
    }
    if (!any) break;
  }

  Agreement agreement;
  GradientShifts shifts;
  for (const PhotoMeasures& photo : photos) agreement.num_photos += photo.valid;
  for (const double turn_deg : options.turns_deg) agreement.turned.push_back({turn_deg, {}});
  for (const PhotoMeasures& photo : photos) {
    if (!photo.warning.empty()) warnings->push_back("Agreement: " + photo.warning);
    if (!photo.valid) continue;
    agreement.num_pixels += photo.num_pixels;
    const double weight = 1.0 / agreement.num_photos;
    AddMeasures(photo.at_pose, weight, &agreement.at_pose);
    for (size_t k = 0; k < photo.turned.size(); ++k) {
      AddMeasures(photo.turned[k], weight, &agreement.turned[k].measures);
    }
    shifts.Add(photo.shifts);
  }
  agreement.gradient = JudgeGradientShifts(shifts);
  return agreement;
}

}  // namespace roomtex
