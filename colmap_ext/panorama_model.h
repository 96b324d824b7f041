#pragma once
// A sparse model of faces that were cut out of panoramas, as a model of the panoramas.

#include <string>
#include <vector>

#include "colmap_ext/sparse_model.h"
#include "core/panorama_set.h"

namespace roomtex {

// Every panorama of which a face is registered becomes one EQUIRECTANGULAR image with one pose: its
// faces are a rig of fixed rotations about one centre. Its keypoints are those of its faces that
// have a point; of one point that several faces see, the observation nearest to the middle of its
// face is kept. Then all poses and points are adjusted once more (reprojection errors, Huber), for
// COLMAP let every face move by itself. Images that are no faces stay. Warnings name faces whose
// poses contradict their panorama (by more than 3 degrees, or a tenth of their points' depth): they
// are left out. Throws InputError if no image of the model is a face (path: of panoramas.json).
SparseModel MergeFaces(const SparseModel& faces, const std::vector<CutPanorama>& panoramas,
                       const std::string& path, std::vector<std::string>* warnings);

// ReadSparseModel() and, unless panoramas_path is empty, MergeFaces().
SparseModel ReadModelOfPanoramas(const std::string& folder, const std::string& panoramas_path,
                                 std::vector<std::string>* warnings);

// Of --panoramas_path.
std::string PanoramasHelp();

}  // namespace roomtex
