#pragma once
// What glTF files of roomtex say about the scan frame, for those who write and who read them.

namespace roomtex {

// Name of the node that turns a model.glb or model_web.glb from the scan frame to glTF's +Y up.
inline constexpr char kRootOfScanFrame[] = "scan frame, turned to +Y up";

}  // namespace roomtex
