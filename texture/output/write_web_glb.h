#pragma once
// A small binary glTF for the web: quantised and compressed.

#include <string>
#include <vector>

#include "core/scan.h"
#include "texture/output/textured_parts.h"
#include "texture/texels/colored_scan.h"

namespace roomtex {

class OptionFields;

struct WebOptions {
  // Triangles of model_web.glb and model.obj; of a cloud five points for each. 500 000: about 5 MB
  // beside the texture, and what phones draw smoothly.
  int max_triangles = 500000;
  // "meshopt": EXT_meshopt_compression, which the viewers of the web read (three.js, Babylon.js,
  // model-viewer, Cesium). "none": three times as large, for programs that do not (Blender).
  std::string compression = "meshopt";

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// The scene of WriteColoredGlb (write_glb.h) with the triangles of `parts` (decimate_parts.h),
// texture images as JPEG of quality 88. Places are 16-bit numbers (KHR_mesh_quantization) with
// steps of at most 1 mm, floats where the scan is too large for that. Of a cloud at most
// 5 * max_triangles points in all, every second, third ... one. Throws InputError if it cannot be
// written or would exceed glTF's 4 GB.
void WriteWebGlb(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                 const std::vector<std::vector<TexturedPart>>& parts, const std::string& path,
                 const WebOptions& options = {});

}  // namespace roomtex
