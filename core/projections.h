#pragma once
// The projection of every camera of a model.

#include <cstdint>
#include <map>

#include "core/camera_model.h"

namespace roomtex {

// By camera id; the cameras must have no Problems().
inline std::map<uint32_t, CameraProjection> ProjectionsOf(
    const std::map<uint32_t, Camera>& cameras) {
  std::map<uint32_t, CameraProjection> projections;
  for (const auto& [id, camera] : cameras) projections.emplace(id, camera);
  return projections;
}

}  // namespace roomtex
