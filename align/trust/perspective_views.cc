#include "align/trust/perspective_views.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <opencv2/imgproc.hpp>

#include "align/trust/still_photo.h"
#include "align/trust/transparent_parts.h"
#include "core/panorama_faces.h"
#include "core/photo.h"

namespace roomtex {
namespace {

// As many as cover the horizon without overlap.
FaceOptions FourFaces() {
  FaceOptions options;
  options.around = 4;
  return options;
}

std::string FaceName(const std::string& name, int number) {
  const size_t dot = std::min(name.rfind('.'), name.size());
  return name.substr(0, dot) + "_face" + std::to_string(number) + name.substr(dot);
}

}  // namespace

PerspectiveViews::PerspectiveViews(const AlignedPhotos& photos) : photos_(photos) {
  const SparseModel& model = photos.model;
  if (std::none_of(model.cameras.begin(), model.cameras.end(),
                   [](const auto& camera) { return camera.second.IsPanorama(); })) {
    return;
  }
  views_.emplace();
  const std::vector<Eigen::Quaterniond> rotations = FaceRotations(FourFaces());
  for (const auto& [id, camera] : model.cameras) {
    views_->cameras[id] = camera.IsPanorama() ? FaceCamera(camera, FourFaces()) : camera;
  }
  uint32_t next_id = model.images.empty() ? 1 : model.images.rbegin()->first + 1;
  for (const auto& [id, image] : model.images) {
    SparseImage view;
    view.image_id = id;
    view.camera_id = image.camera_id;
    view.name = image.name;
    view.cam_from_model = image.cam_from_model;
    if (!model.cameras.at(image.camera_id).IsPanorama()) {
      views_->images[id] = view;
      continue;
    }
    for (size_t k = 0; k < rotations.size(); ++k) {
      view.image_id = next_id++;
      view.name = FaceName(image.name, static_cast<int>(k) + 1);
      view.cam_from_model = Rigid{rotations[k], Eigen::Vector3d::Zero()} * image.cam_from_model;
      faces_[view.image_id] = {&image, rotations[k]};
      views_->images[view.image_id] = view;
    }
  }
}

std::optional<cv::Mat> PerspectiveViews::Read(const SparseImage& image,
                                              std::string* warning) const {
  const SparseModel& model = photos_.model;
  const std::string& image_path = photos_.image_path;
  const auto face = faces_.find(image.image_id);
  if (face == faces_.end()) {
    return ReadPhotoOf(image, model.cameras.at(image.camera_id), image_path, warning);
  }
  const SparseImage& panorama = *face->second.panorama;
  const auto photo =
      ReadPhotoOf(panorama, model.cameras.at(panorama.camera_id), image_path, warning);
  if (!photo) return std::nullopt;
  return CutFace(*photo, views_->cameras.at(image.camera_id), face->second.face_from_panorama);
}

std::optional<cv::Mat> PerspectiveViews::ReadCells(const SparseImage& image, int cell_px,
                                                   std::string* warning) const {
  if (faces_.count(image.image_id) == 0) {
    return ReadCellsOf(image, photos_.model.cameras.at(image.camera_id), cell_px,
                       photos_.image_path, warning);
  }
  const auto face = Read(image, warning);
  if (!face) return std::nullopt;
  const cv::Size size(face->cols / cell_px, face->rows / cell_px);
  cv::Mat cells;
  cv::resize((*face)(cv::Rect(0, 0, size.width * cell_px, size.height * cell_px)), cells, size, 0,
             0, cv::INTER_AREA);
  return cells;
}

void PerspectiveViews::LeaveOutTransparent(const SparseImage& image, ScanView* view) const {
  const auto face = faces_.find(image.image_id);
  const SparseImage& photo = face == faces_.end() ? image : *face->second.panorama;
  cv::Mat transparent =
      ReadTransparencyOf(photo, photos_.model.cameras.at(photo.camera_id), photos_.image_path);
  if (transparent.empty()) return;
  if (face != faces_.end()) {
    transparent = CutFace(transparent, views_->cameras.at(image.camera_id),
                          face->second.face_from_panorama) > 0;
  }
  roomtex::LeaveOutTransparent(transparent, view);
}

cv::Mat PerspectiveViews::Still(const SparseImage& image, const ScanView& view,
                                const LookSetup& camera, const cv::Mat& picture) const {
  const auto motion = photos_.row_motions.find(image.image_id);
  if (motion == photos_.row_motions.end()) return picture;
  return WithStillRows(picture, view, camera, motion->second);
}

std::optional<PhotoAndView> PerspectiveViews::Look(const ScanViewer& viewer,
                                                   const SparseImage& image,
                                                   const LookSetup& camera,
                                                   std::string* warning) const {
  const auto cells = ReadCells(image, camera.cell_px, warning);
  if (!cells) return std::nullopt;
  PhotoAndView look;
  look.view = camera.Look(viewer, image.cam_from_model);
  look.cells = Still(image, look.view, camera, *cells);
  LeaveOutTransparent(image, &look.view);
  return look;
}

bool IsAsDeep(float view_depth, double depth) {
  constexpr double kTolerance = 0.02, kShare = 0.02;
  return view_depth > 0 && std::abs(view_depth - depth) <= kTolerance + kShare * depth;
}

float LogLight(const cv::Vec3b& bytes) {
  // Bytes: darker is only noise, brighter is clipped.
  constexpr int kDark = 2, kClipped = 253;
  const auto [least, most] = std::minmax({bytes[0], bytes[1], bytes[2]});
  if (least < kDark || most > kClipped) return std::numeric_limits<float>::quiet_NaN();
  const std::array<float, 256>& linear = LinearFromSrgbByte();
  return std::log((linear[bytes[0]] + linear[bytes[1]] + linear[bytes[2]]) / 3);
}

}  // namespace roomtex
