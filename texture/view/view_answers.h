#pragma once
// What the page of roomtex-view asks for, and the answers.

#include <functional>
#include <map>
#include <memory>
#include <optional>
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
  ViewCameras cameras;                 // none: no cameras on the page
  ViewTones tones;                     // of the photos of the cameras
  std::map<std::string, Json> shifts;  // of them, as ReadViewShifts()
  std::string evidence_path;           // "" = none
  std::string no_evidence_reason;      // a sentence, when there is none
  std::vector<std::string> warnings;   // sentences for the user
};

// Questions are a word and values, as in a URL. Numbers are metres, `scan` frame, unless said; ids
// count from 0.
//   scene            {version, name, path, origin, up, bounds, num_vertices, num_triangles, pages:
//                    [{id, width, height, wrap (glTF's, of s and t)}], uv: {low, high} of what the
//                    pieces have as 0 and 1, chunks: [{id, page (-1 = colours), supplement, min,
//                    max (relative to origin), num_triangles, num_vertices, spacing}], num_cameras,
//                    num_photos, num_points, warnings}
//   chunk?id&level   level 0 = coarse, 1 = middle, 2 = everything; bytes of ViewChunks::Encode
//   evidence         {available, reason, ...} of ViewEvidence::ToJson
//   evidence_chunk?id&level   bytes of ViewEvidence::Encode, for the points of that chunk
//   texture?page&max image of at most max x max texels, scaled if it has more
//   cameras          [camera ...] of ViewCameras::ToJson, each with its `shift` of
//                    ReadViewShifts, null = not measured
//   lattice?id       of ViewCameras::Lattice
//   photo?id&max     JPEG; 404 without a file
//   lumigraph        of ViewLumigraph::ToJson
//   pinhole_photo?id&max   JPEG of ViewLumigraph::Photo; 404 without a file
//   depths?id        bytes of ViewLumigraph::Depths
//   points           bytes of ViewCameras::EncodePoints
//
// Everything heavy (pieces, coarse levels, evidence) is made in the background; what asks for it
// waits.
class ViewAnswers {
 public:
  using Query = LocalServer::Query;

  // Once `stop` says so, nothing waits any longer.
  ViewAnswers(ViewContent content, int num_threads, std::function<bool()> stop);
  ~ViewAnswers();  // ends the background work

  // By the word. InputError or UsageError: a sentence for the user.
  const std::map<std::string, std::function<Json(const Query&)>>& json() const;
  const std::map<std::string, std::function<std::optional<LocalServer::Content>(const Query&)>>&
  content() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace roomtex
