#pragma once
// Which photos of a database share a lens while they are mapped. COLMAP gives every photo a camera
// of its own unless told --ImageReader.single_camera, and one camera to photos that were zoomed
// differently if it was; its mapper then refines what the photos cannot tell apart, or holds what
// is not the same.

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "colmap_ext/database.h"
#include "colmap_ext/lens_check.h"
#include "colmap_ext/lens_labels.h"
#include "colmap_ext/sparse_model.h"
#include "core/camera_model.h"

namespace roomtex {

class LensPlan {
 public:
  // As the database has them.
  LensPlan(const std::map<uint32_t, Camera>& cameras,
           const std::map<uint32_t, DatabaseImage>& images)
      : database_cameras_(cameras), cameras_(cameras), database_images_(images), images_(images) {}
  // Cameras with the same model, photo size, parameters and labels are one; photos of one camera
  // whose labels name different focal lengths are several, the most frequent label keeps the
  // camera's own, the others' focal lengths are as EXIF relates them.
  LensPlan(const std::map<uint32_t, Camera>& cameras,
           const std::map<uint32_t, DatabaseImage>& images, const LensLabels& labels);

  // The database's own where nothing is to be done.
  const std::map<uint32_t, Camera>& cameras() const { return cameras_; }
  const std::map<uint32_t, DatabaseImage>& images() const { return images_; }
  bool IsAsInDatabase() const;
  // What was divided, in sentences.
  const std::vector<std::string>& notes() const { return notes_; }

  // With lenses as they were found (of a model of this plan); those not used stay. Photos are set
  // apart only where all else stays: beside a wrong lens single photos look wrong that are right.
  // Gives those that were taken.
  std::vector<LensFinding> Take(const LensCheck& found, const SparseModel& model);

  // The cameras of a model of this plan as they are there, calibrated ones from now on.
  void Calibrate(const SparseModel& model);

  // Gives some photos a camera of their own, whatever the database says of them.
  void Tell(const std::vector<uint32_t>& image_ids, Camera camera);

  // A model of this plan with the database's cameras: those that were one have the same parameters;
  // of one that is several, the others keep the new ids.
  void Restore(SparseModel* model) const;

 private:
  void EraseUnused();

  std::map<uint32_t, Camera> database_cameras_, cameras_;
  std::map<uint32_t, DatabaseImage> database_images_, images_;
  std::vector<std::string> notes_;
};

}  // namespace roomtex
