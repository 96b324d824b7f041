#pragma once
// The coloured models of all rooms as one glTF scene, without a copy of them: a small .gltf whose
// buffers are the rooms' own .glb files.

#include <string>
#include <vector>

#include "core/report.h"
#include "core/similarity.h"

namespace roomtex {

struct SceneRoom {
  std::string name, glb_path;  // model.glb of roomtex-texture
  Rigid site_from_scan;
};

// The scene; paths in it start in `folder`, where the file will lie. +Y is the up of the first
// room. Throws InputError for what is no model.glb of roomtex-texture.
Json MakeJoinedScene(const std::vector<SceneRoom>& rooms, const std::string& folder);

}  // namespace roomtex
