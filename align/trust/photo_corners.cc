#include "align/trust/photo_corners.h"

#include <map>
#include <utility>

#include "align/trust/perspective_views.h"
#include "core/parallel.h"

namespace roomtex {

PhotoCorners FindPhotoCorners(const AlignedPhotos& aligned, const ScanViewer& viewer,
                              int max_photos, int num_threads) {
  const PerspectiveViews views(aligned);
  const std::vector<const SparseImage*> images = SpreadImages(views.model(), max_photos);
  std::map<uint32_t, LookSetup> cameras;
  for (const SparseImage* image : images) {
    const Camera& camera = views.model().cameras.at(image->camera_id);
    cameras.try_emplace(image->camera_id, camera, viewer, FinestCell(camera, viewer));
  }
  GradientShiftOptions options;
  options.turns_deg.clear();  // whether the place is right is not asked
  options.moves.clear();
  std::vector<std::vector<FittingCorner>> found(images.size());
  ParallelFor(num_threads, 0, static_cast<int>(images.size()), [&](int i) {
    const SparseImage& image = *images[i];
    std::string ignored;  // MeasureAgreement() says it
    const auto photo = views.Read(image, &ignored);
    if (!photo) return;
    const LookSetup& camera = cameras.at(image.camera_id);
    ScanView view = camera.Look(viewer, image.cam_from_model);
    const cv::Mat still = views.Still(image, view, camera, *photo);
    views.LeaveOutTransparent(image, &view);
    found[i] = MeasureGradientShifts(view, still, camera.projection, viewer.sample_angle(), options)
                   .shifted_alike;
    for (FittingCorner& corner : found[i]) corner.image_id = image.image_id;
  });
  PhotoCorners result;
  for (const std::vector<FittingCorner>& corners : found) {
    result.num_photos += !corners.empty();
    result.corners.insert(result.corners.end(), corners.begin(), corners.end());
  }
  return result;
}

}  // namespace roomtex
