#pragma once
// Pictures that show whether scan and photos lie on each other: photo, scan intensity rendered from
// its pose, and the scan's edges drawn on the photo, whole and as enlarged cut-outs.

#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "align/trust/free_space.h"
#include "align/trust/gradient_shift.h"
#include "align/trust/perspective_views.h"
#include "align/trust/scan_edges.h"
#include "align/trust/scan_view.h"
#include "colmap_ext/sparse_model.h"
#include "core/scan.h"

namespace roomtex {

struct OverlayOptions {
  int panel_width = 960;          // pixels of each of the three panels
  int num_crops = 3;              // cut-outs below the panels, each plain and with edges
  int crop_scale = 3;             // a pixel of the photo is this many pixels wide in a cut-out
  double max_view_cells = 2.5e6;  // the intensity is rendered at no more positions than this
  GradientShiftOptions gradient;
  ScanEdgeOptions edges;
};

// An edge of the scan as a photo sees it, in `img` (lens distortion included).
struct ImgEdge {
  ScanEdge::Kind kind = ScanEdge::Kind::kDepth;
  std::vector<Eigen::Vector2d> points;
};

// What a scanner in the photo's place would measure of the meshes, a sample per cell of the
// lattice: gives them the grid that FindScanEdges asks for. Missing where a scan with a grid of its
// own is seen.
Scan ScanFromPhoto(const FreeSpace& free_space, const RayLattice& lattice, const Camera& camera,
                   const Rigid& cam_from_scan);

// What the photo sees of the edges: not hidden behind the scan's surface, inside the photo. Edges
// are cut where they disappear.
std::vector<ImgEdge> SeeEdges(const std::vector<ScanEdge>& edges, const FreeSpace& free_space,
                              const CameraProjection& projection, const Rigid& cam_from_scan);

// photo: 8-bit BGR of the size of the camera. Left to right: photo, scan intensity (blue where the
// scan shows nothing), edges on the grey photo; below, cut-outs where edges are many. On the first
// two, corners of the intensity that the photo shows where the scan has them (rings), and those
// that it does not (crosses).
cv::Mat DrawOverlay(const cv::Mat& photo, const ScanView& view, const std::vector<ImgEdge>& edges,
                    const GradientShifts& shifts, const std::string& name,
                    const OverlayOptions& options);

// Writes folder/NAME.jpg for `count` photos evenly taken from all; a slash in a name becomes an
// underscore. Gives the paths written. Photos that cannot be read are named in `warnings`.
std::vector<std::string> WriteOverlays(const AlignedPhotos& aligned, const std::string& folder,
                                       const ScanViewer& viewer, int count,
                                       const OverlayOptions& options, int num_threads,
                                       std::vector<std::string>* warnings);

}  // namespace roomtex
