#pragma once
// Names of files by which one command finds what another has written.

namespace roomtex {

// The report of roomtex-align, beside the model that it aligned.
inline constexpr char kAlignReportName[] = "alignment.json";
// What roomtex-mapper says of a model, in its folder.
inline constexpr char kMapperReportName[] = "roomtex-mapper.json";
// Beside photos of one camera: its options for `colmap feature_extractor` (camera_text.h).
inline constexpr char kCameraOptionsName[] = "camera_options.txt";
// Beside the faces that were cut out of panoramas (panorama_set.h).
inline constexpr char kPanoramaSetName[] = "panoramas.json";

}  // namespace roomtex
