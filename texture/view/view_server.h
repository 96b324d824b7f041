#pragma once
// What the page of roomtex-view asks for, and who answers.

#include <memory>
#include <string>
#include <vector>

#include "core/local_server.h"
#include "texture/view/view_cameras.h"
#include "texture/view/view_evidence.h"
#include "texture/view/view_lumigraph.h"
#include "texture/view/view_model.h"

namespace roomtex {

// What is to be seen.
struct ViewContent {
  ViewModel model;
  ViewCameras cameras;                // none: no cameras on the page
  ViewTones tones;                    // of the photos of the cameras
  std::string evidence_path;          // "" = none
  std::string no_evidence_reason;     // a sentence, when there is none
  std::vector<std::string> warnings;  // sentences for the user
};

// Adds the paths to the server. Everything heavy (coarse levels, rays, evidence) is made in the
// background; what asks for it waits.
//
// All GET; numbers are metres, `scan` frame, unless said; ids count from 0.
//   scene            {version, name, path, origin, up, bounds, num_vertices, num_triangles, pages:
//                    [{id, width, height}], chunks: [{id, page (-1 = colours), supplement, min, max
//                    (relative to origin), num_triangles, num_vertices, spacing}], num_cameras,
//                    num_photos, num_points, warnings}
//   chunk?id&level   level 0 = coarse, 1 = middle, 2 = everything; bytes of ViewChunks::Encode
//   evidence         {available, reason, ...} of ViewEvidence::ToJson
//   evidence_chunk?id&level   bytes of ViewEvidence::Encode, for the points of that chunk
//   texture?page&max image of at most max x max texels, scaled if it has more
//   cameras          [camera ...] of ViewCameras::ToJson
//   lattice?id       of ViewCameras::Lattice
//   photo?id&max     JPEG; 404 without a file
//   lumigraph        of ViewLumigraph::ToJson
//   pinhole_photo?id&max   JPEG of ViewLumigraph::Photo; 404 without a file
//   depths?id        bytes of ViewLumigraph::Depths
//   points           bytes of ViewCameras::EncodePoints
//   cast?x&y&z&dx&dy&dz&front&supplement&cut0&cut1&cut2   nearest surface of the full mesh along a
//                    ray: {hit, point, normal, distance}; front = 1: what is seen from behind
//                    (ShowsFront) does not count; supplement = 0: nor does the supplement; cut0 ...
//                    (x,y,z,low,high): nor what along that axis does not lie between low and high
// The server must outlive this, and be stopped before this ends.
class ViewServer {
 public:
  ViewServer(ViewContent content, LocalServer* server, int num_threads);
  ~ViewServer();  // ends the background work

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace roomtex
