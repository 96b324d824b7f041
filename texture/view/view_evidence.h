#pragma once
// Scan intensity, number of photos and their disagreement at the points of the model.

#include <array>
#include <string>
#include <vector>

#include "core/report.h"
#include "texture/output/evidence.h"
#include "texture/view/view_chunks.h"

namespace roomtex {

class ViewEvidence {
 public:
  // Not there; `reason` is a sentence for the user.
  explicit ViewEvidence(const std::string& reason) : reason_(reason) {}
  // Finds for every point of the chunks the nearest point of the evidence, at most
  // kMaxDistance away. origin: ViewModel::origin.
  ViewEvidence(const ViewChunks& chunks, const Eigen::Vector3d& origin, const Evidence& evidence,
               int num_threads);

  static constexpr double kMaxDistance = 1e-3;       // metres; the two files round differently
  static constexpr double kDisagreementStep = 0.25;  // of a code of one byte; 255 = fewer than two

  // {available, reason, intensity [low, high] (1st and 99th percentile: black and white),
  // max_views, disagreement_high (98th percentile), disagreement_step}.
  Json ToJson() const;
  // Four bytes per point, of those of the chunk: intensity as grey, photos, disagreement (code), 0
  // = known, 255 = nothing is known of the point.
  std::string Encode(int chunk, const std::vector<uint16_t>& points) const;

 private:
  std::string reason_;
  std::vector<std::vector<std::array<uint8_t, 4>>> codes_;  // [chunk][point]; or none
  double intensity_low_ = 0, intensity_high_ = 1, disagreement_high_ = 1;
  int max_views_ = 0;
};

}  // namespace roomtex
