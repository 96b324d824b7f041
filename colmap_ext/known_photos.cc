#include "colmap_ext/known_photos.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "core/decompositions.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// What a pose may be off and still be that of the photo: scanners know theirs to centimetres and
// tenths of a degree, and the model bends by as much as its lens is wrong. Positions as a share of
// the distance to what the photo sees.
constexpr double kMaxTurnDeg = 2;
constexpr double kMaxShift = 0.05;
// Least distance between the photos over the distance to what they see: below, the scale is not
// known to a percent or two.
constexpr double kMinBaseline = 0.1;

const DatabaseImage* FindByName(const std::string& name,
                                const std::map<uint32_t, DatabaseImage>& images) {
  const DatabaseImage* below = nullptr;
  int num_below = 0;
  const std::string ending = "/" + name;
  for (const auto& [id, image] : images) {
    if (image.name == name) return &image;
    if (image.name.size() <= ending.size() ||
        image.name.compare(image.name.size() - ending.size(), ending.size(), ending) != 0) {
      continue;
    }
    below = &image;
    ++num_below;
  }
  return num_below == 1 ? below : nullptr;
}

// One photo that is in the model and known.
struct Both {
  uint32_t image_id = 0;
  Rigid cam_from_sparse, cam_from_scan;
  Eigen::Vector3d centre_in_sparse, centre_in_scan;
  double depth_in_sparse = 0;  // median distance to its points
};

std::vector<Both> InBoth(const SparseModel& model, const KnownPhotos& known) {
  std::vector<Both> photos;
  for (const auto& [id, cam_from_scan] : known.cam_from_scan) {
    const auto found = model.images.find(id);
    if (found == model.images.end()) continue;
    const Rigid& pose = found->second.cam_from_model;
    photos.push_back({id, pose, cam_from_scan, pose.TargetOriginInSource(),
                      cam_from_scan.TargetOriginInSource(), MedianDepth(model, found->second)});
  }
  return photos;
}

bool Agrees(const Both& photo, const Similarity& scan_from_sparse) {
  const Rigid pose = CamFromScan(photo.cam_from_sparse, scan_from_sparse);
  const double shift = (pose.TargetOriginInSource() - photo.centre_in_scan).norm();
  return RotationAngle(pose.rotation, photo.cam_from_scan.rotation) <= RadFromDeg(kMaxTurnDeg) &&
         shift <= kMaxShift * scan_from_sparse.scale * photo.depth_in_sparse;
}

std::vector<Both> Agreeing(const std::vector<Both>& photos, const Similarity& scan_from_sparse) {
  std::vector<Both> agreeing;
  for (const Both& photo : photos) {
    if (Agrees(photo, scan_from_sparse)) agreeing.push_back(photo);
  }
  return agreeing;
}

// Least squares by all of them: the turn is the mean of theirs, because places on one line leave a
// turn about it open. None where they stand at one place.
std::optional<Similarity> FitPoses(const std::vector<Both>& photos) {
  Eigen::Matrix4d turns = Eigen::Matrix4d::Zero();
  Eigen::Vector3d mean_in_sparse = Eigen::Vector3d::Zero(), mean_in_scan = mean_in_sparse;
  for (const Both& photo : photos) {
    const Eigen::Quaterniond turn =
        photo.cam_from_scan.rotation.conjugate() * photo.cam_from_sparse.rotation;
    turns += turn.coeffs() * turn.coeffs().transpose();
    mean_in_sparse += photo.centre_in_sparse / static_cast<double>(photos.size());
    mean_in_scan += photo.centre_in_scan / static_cast<double>(photos.size());
  }
  // Markley et al. 2007, Averaging Quaternions: the eigenvector of the largest eigenvalue.
  Similarity fit;
  fit.rotation =
      Eigen::Quaterniond(Eigen::Vector4d(SymmetricEigen(turns).vectors.col(3))).normalized();
  double along = 0, square = 0;
  for (const Both& photo : photos) {
    const Eigen::Vector3d turned = fit.rotation * (photo.centre_in_sparse - mean_in_sparse);
    along += turned.dot(photo.centre_in_scan - mean_in_scan);
    square += turned.squaredNorm();
  }
  if (!(along > 0) || !(square > 0)) return std::nullopt;
  fit.scale = along / square;
  fit.translation = mean_in_scan - fit.scale * (fit.rotation * mean_in_sparse);
  return fit;
}

// The similarity that most photos agree with, of those that two of them give.
std::vector<Both> LargestAgreement(const std::vector<Both>& photos) {
  std::vector<Both> best;
  for (size_t i = 0; i < photos.size(); ++i) {
    for (size_t k = i + 1; k < photos.size() && best.size() < photos.size(); ++k) {
      const auto fit = FitPoses({photos[i], photos[k]});
      if (!fit) continue;
      std::vector<Both> agreeing = Agreeing(photos, *fit);
      if (agreeing.size() > best.size()) best = std::move(agreeing);
    }
  }
  return best;
}

double Baseline(const std::vector<Both>& photos) {
  double longest = 0;
  for (const Both& a : photos) {
    for (const Both& b : photos) {
      longest = std::max(longest, (a.centre_in_scan - b.centre_in_scan).norm());
    }
  }
  return longest;
}

// Whether the model says that the photos stand at one place, as seen from what they show.
bool StandAtOnePlace(const std::vector<Both>& photos) {
  std::vector<double> depths;
  double longest = 0;
  for (const Both& a : photos) {
    depths.push_back(a.depth_in_sparse);
    for (const Both& b : photos) {
      longest = std::max(longest, (a.centre_in_sparse - b.centre_in_sparse).norm());
    }
  }
  return longest < kMinBaseline * Median(std::move(depths));
}

}  // namespace

KnownPhotos FindKnownPhotos(const std::string& known_path, const SparseModel& known,
                            const std::map<uint32_t, DatabaseImage>& images,
                            const std::map<uint32_t, Camera>& cameras) {
  KnownPhotos found;
  for (const auto& [known_id, image] : known.images) {
    const Camera& camera = known.cameras.at(image.camera_id);
    if (camera.IsPanorama()) {
      throw InputError(known_path, image.name,
                       "is a panorama, which has no picture plane to match in",
                       "Write faces of it: roomtex-import --images_path ... --E57.cut_panoramas 1");
    }
    const DatabaseImage* const match = FindByName(image.name, images);
    if (match == nullptr) {
      found.unmatched.push_back(image.name);
      continue;
    }
    const Camera& there = cameras.at(match->camera_id);
    if (there.width != camera.width || there.height != camera.height) {
      throw InputError(known_path, image.name,
                       "is " + std::to_string(camera.width) + " x " +
                           std::to_string(camera.height) + " pixels, " + match->name +
                           " of the database " + std::to_string(there.width) + " x " +
                           std::to_string(there.height),
                       "Extract the features of the photos as they were written");
    }
    if (!found.cam_from_scan.emplace(match->image_id, image.cam_from_model).second) {
      throw InputError(known_path, image.name,
                       "and another photo of this model both stand for " + match->name,
                       "Keep the names of the photos as they were written");
    }
    found.cameras.emplace(match->image_id, camera);
  }
  if (found.cam_from_scan.empty()) {
    throw InputError(known_path, "", "holds no photo that is in the database",
                     "Put its photos into --image_path, by their names or in a folder of their "
                     "own, and run colmap feature_extractor and a matcher on all of them");
  }
  return found;
}

void TellCameras(const KnownPhotos& known, LensPlan* plan) {
  std::map<uint32_t, std::vector<uint32_t>> photos_of;
  std::map<uint32_t, Camera> cameras;
  for (const auto& [image_id, camera] : known.cameras) {
    photos_of[camera.camera_id].push_back(image_id);
    cameras[camera.camera_id] = camera;
  }
  for (auto& [camera_id, camera] : cameras) {
    camera.has_prior_focal_length = true;
    plan->Tell(photos_of.at(camera_id), camera);
  }
}

KnownFit FitToKnown(const SparseModel& model, const KnownPhotos& known) {
  KnownFit result;
  const std::vector<Both> photos = InBoth(model, known);
  if (photos.size() < 2) return result;
  if (StandAtOnePlace(photos)) {
    result.kind = KnownFit::Kind::kOnePlace;
    return result;
  }
  result.kind = KnownFit::Kind::kContradicts;
  std::vector<Both> agreeing = LargestAgreement(photos);
  if (agreeing.size() < 2 || 2 * agreeing.size() <= photos.size()) return result;
  const std::optional<Similarity> fit = FitPoses(agreeing);
  if (!fit) return result;
  agreeing = Agreeing(photos, *fit);
  if (agreeing.size() < 2 || 2 * agreeing.size() <= photos.size()) return result;
  if (StandAtOnePlace(agreeing)) {
    result.kind = KnownFit::Kind::kOnePlace;
    return result;
  }
  result.kind = KnownFit::Kind::kPlaced;
  result.scan_from_sparse = *fit;
  result.baseline = Baseline(agreeing);
  double shifts = 0, turns = 0;
  for (const Both& photo : agreeing) {
    result.agreeing.insert(photo.image_id);
    const Rigid pose = CamFromScan(photo.cam_from_sparse, *fit);
    shifts += (pose.TargetOriginInSource() - photo.centre_in_scan).squaredNorm();
    turns += std::pow(RotationAngle(pose.rotation, photo.cam_from_scan.rotation), 2);
  }
  result.position_rms = std::sqrt(shifts / static_cast<double>(agreeing.size()));
  result.rotation_rms = std::sqrt(turns / static_cast<double>(agreeing.size()));
  for (const Both& photo : photos) {
    if (result.agreeing.count(photo.image_id) == 0) result.contradicting.insert(photo.image_id);
  }
  return result;
}

}  // namespace roomtex
