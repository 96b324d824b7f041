#pragma once
// What the page needs to colour the surface by the photos nearest to the point of view
// (unstructured lumigraph: Buehler et al. 2001, "Unstructured Lumigraph Rendering"): photos without
// distortion, how far they see, and their exposure.

#include <map>
#include <optional>
#include <string>

#include <Eigen/Core>

#include "core/report.h"
#include "texture/sampling/photo_tone.h"
#include "texture/view/view_cameras.h"
#include "texture/view/view_chunks.h"

namespace roomtex {

// How the photos' bytes became the colours of the model.
struct ViewTones {
  // Per name of a photo, factors on linear red, green, blue; photos that are not here did not
  // colour the model. None = nobody says: all photos as they are.
  std::optional<std::map<std::string, Eigen::Vector3f>> gains;
  std::optional<ResponseCurve> response;  // none = sRGB
};
// From the report.json of roomtex-texture in a folder; none of both where there is none, or a
// damaged one. Throws InputError for a response.txt that cannot be read.
ViewTones ReadViewTones(const std::string& folder);

class ViewLumigraph {
 public:
  // Longer side of a depth map, pixels.
  static constexpr int kDepthSize = 512;

  // Photos that are there, coloured the model, and go into a plane (no panoramas). cameras must
  // outlive this.
  ViewLumigraph(const ViewCameras& cameras, ViewTones tones);

  // {reason ("" = it can be shown), photos: [{id (of the camera), focal [2], centre [2] (shares of
  // width and height), gain [3]}]}.
  Json ToJson() const;
  // JPEG of the photo without distortion, at most max_size pixels along its longer side; null for
  // one that is not of ToJson(). Throws InputError if it cannot be read.
  std::shared_ptr<const std::string> Photo(int id, int max_size) const;
  // What the photo sees of the mesh, in its frame without distortion, little-endian: uint32 "RTD1",
  // width, height, 0; then row by row 1/depth as half floats, per metre, 0 = no surface. Where the
  // depth jumps, the nearer surface is one pixel wider, so that nothing of it falls on what lies
  // behind. origin: ViewModel::origin.
  std::string Depths(int id, const ViewChunks& chunks, const Eigen::Vector3d& origin,
                     int num_threads) const;

 private:
  bool Has(int id) const;

  const ViewCameras& cameras_;
  ViewTones tones_;
};

}  // namespace roomtex
