#pragma once
// The scans of a run and every form in which it looks at their surface. One scan is one surface:
// each form is made once, when it is first asked for. Frame: `scan`.

#include <memory>
#include <mutex>
#include <vector>

#include <Eigen/Core>

#include "align/surface/scan_patches.h"
#include "align/surface/scan_planes.h"
#include "align/trust/free_space.h"
#include "align/trust/scan_view.h"
#include "core/scan.h"
#include "core/scan_mesh.h"

namespace roomtex {

struct SurveyOptions {
  ScanPatchOptions patches;
  ScanPlaneOptions planes;
  ScanMeshOptions mesh;
  // Samples of the coarse mesh for free space and agreement, which do not need every sample of
  // millions. Larger = exacter and slower.
  int coarse_samples = 300000;
  int num_threads = -1;  // changes nothing
};

// Safe to use from several threads.
class SurveyedScans {
 public:
  // The scans must outlive it.
  explicit SurveyedScans(const std::vector<Scan>& scans,
                         const SurveyOptions& options = SurveyOptions());

  const std::vector<Scan>& scans() const { return scans_; }
  const SurveyOptions& options() const { return options_; }

  // Small flat patches: distances of points from the surface.
  const ScanPatches& patches() const;
  // Large planes (thesis 7.2).
  const std::vector<ScanPlane>& planes() const;
  // Every sample as a mesh, one per scan.
  const std::vector<std::vector<Triangle>>& meshes() const;
  // The coarse mesh: what the scanners looked through.
  const FreeSpace& free_space() const;
  // What photos would see of the intensity.
  const ScanViewer& viewer() const;

  // Distance of each point from the nearest sample (of a mesh without a grid: point of its
  // surface), metres, less what a place between the samples around it may lie from them; infinite
  // without samples. Looks at every sample for every point.
  std::vector<double> DistancesOf(const std::vector<Eigen::Vector3d>& points) const;

 private:
  template <typename Form>
  class Once {
   public:
    template <typename Make>
    const Form& Get(const Make& make) {
      std::call_once(flag_, [&] { form_ = std::make_unique<Form>(make()); });
      return *form_;
    }

   private:
    std::once_flag flag_;
    std::unique_ptr<Form> form_;
  };

  const std::vector<Scan>& scans_;
  const SurveyOptions options_;
  mutable Once<ScanPatches> patches_;
  mutable Once<std::vector<ScanPlane>> planes_;
  mutable Once<std::vector<std::vector<Triangle>>> meshes_;
  mutable Once<FreeSpace> free_space_;
  mutable Once<ScanViewer> viewer_;
};

}  // namespace roomtex
