#pragma once
// What the rows of the table of steps (step_table.cc) share: choices by quality, options in the
// spelling of the COLMAP that is there, and the rows that have a file of their own.

#include <set>
#include <string>
#include <vector>

#include "workflow/step.h"

namespace roomtex {

// By the quality asked for.
struct Quality {
  const char* name;
  int max_image_size, max_num_features;
  bool guided_matching;
  const char* texture_scale;
  int video_frames;
};
const Quality& QualityOf(const AutoOptions& options);

// Options that the user handed on take the place of ours.
void AddPassed(const std::vector<std::string>& passed, CommandLine* line);
// The scans and how they are read; `inputs` gets the files.
void AddScans(const AutoOptions& options, CommandLine* line, std::vector<std::string>* inputs);
// COLMAP's names of one option, old and new: the one that this version has, if it has one.
void AddSpelled(const std::set<std::string>& options, const std::vector<std::string>& names,
                const std::string& value, CommandLine* line);
bool UsesGpu(Chain* chain, std::vector<std::string>* notes);

bool HasPanoramas(Chain* chain);
bool HasOwnPhotos(Chain* chain);  // the user's, not only the scanner's
// So few photos that COLMAP makes no model of them: each is placed by itself, by picks or by what
// it shows of the scan.
bool PhotosStandAlone(Chain* chain);
// The lens of these photos for roomtex-align, where it was told.
void AddLensOfPhotosAlone(Chain* chain, CommandLine* line);
Step MakeFeatures(Chain* chain);
Step MakeScanner(Chain* chain);

}  // namespace roomtex
