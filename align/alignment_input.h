#pragma once
// What an alignment is made from.

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "align/clicks/pick_review.h"
#include "align/clicks/picks.h"
#include "align/clicks/scale.h"
#include "align/fit/plane_bundle.h"
#include "align/fit/similarity_fit.h"
#include "align/surface/scan_patches.h"
#include "align/surveyed_scans.h"
#include "align/trust/trust.h"
#include "colmap_ext/lens_check.h"
#include "colmap_ext/sparse_model.h"
#include "core/row_motion.h"
#include "core/scan_mesh.h"

namespace roomtex {

struct AlignmentOptions {
  // Lenses by photos and scan (lens_check.h, model_adjustment.h); never: they stay as told.
  RefineIntrinsics refine_intrinsics = RefineIntrinsics::kAuto;
  // Refine the similarity on the surface of the scan, and adjust poses and points to it.
  bool plane_constrained = true;
  PickReviewOptions picks;
  ScaleOptions scale;
  SimilarityFitOptions fit;
  PlaneBundleOptions bundle;
  TrustOptions trust;
  // Of the SurveyedScans that the alignment is made on.
  ScanPatchOptions surface;
  ScanMeshOptions mesh;

  std::vector<std::string> Problems() const;
};

struct AlignmentInput {
  const SparseModel& model;
  const SurveyedScans& surveyed;
  const std::vector<Pick>& picks;  // may be empty where a start is given
  // What was read from where, for the messages.
  std::string picks_path;
  std::string azimuth;  // as the scans were read: "clockwise" or "counterclockwise"
  // What EXIF says of the photos' cameras (CheckLenses), by image_id; may be empty.
  LensLabels photo_labels = {};
  // The model's lenses are what a mapper made of them: the scan has the last word on them.
  bool lenses_refined = false;
  // Folder of the photos, for a second opinion where few points lie on a rough surface; may be
  // empty.
  std::string image_path = "";
  int num_threads = -1;  // for that; changes nothing
  // The model's keypoints and the picks are those that photos would show had they been read at
  // once, while they were read like this (FindRollingShutter).
  RowMotions row_motions = {};
  bool freed_with_rows = false;  // lenses were adjusted when these motions were found
  // What is added to places of the scan in messages: the scans were moved by as much.
  Eigen::Vector3d scan_origin = Eigen::Vector3d::Zero();

  // The same of another model, other scans or picks; all must outlive the result.
  AlignmentInput With(const SparseModel& other_model, const SurveyedScans& other_scans,
                      const std::vector<Pick>& other_picks) const {
    AlignmentInput other{other_model, other_scans, other_picks, picks_path, azimuth};
    other.photo_labels = photo_labels;
    other.lenses_refined = lenses_refined;
    other.image_path = image_path;
    other.num_threads = num_threads;
    other.row_motions = row_motions;
    other.freed_with_rows = freed_with_rows;
    other.scan_origin = scan_origin;
    return other;
  }
};

}  // namespace roomtex
