#pragma once
// Weighted blending (thesis 8.2.2), with a check that the photos agree on the colour of a sample
// (photo-consistency, as in Waechter, Moehrle and Goesele 2014, "Let There Be Color!").

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "texture/sampling/observations.h"

namespace roomtex {

class OptionFields;

struct BlendOptions {
  // Where the detail of a place comes from; what is coarser is blended from all photos kept.
  // "average": from all of them. "select": from one, see photo_choice.h. "auto": from one as far as
  // the photos disagree there. `detail` goes without: it takes that of the dominant photo.
  std::string mode = "auto";
  // Photos kept per sample, the best by weight; 8 bytes each. Larger = smoother, more memory.
  int max_views = 8;
  // A photo that sees a sample at a slant, away from where the scanner stood, gets less weight:
  // what is left of the range noise and of the misalignment shifts its colour most. Departure from
  // the thesis.
  bool angle_weight = true;
  // A photo with more pixels per sample gets more weight: its colours are less mixed with their
  // neighbours'. Departure from the thesis.
  bool resolution_weight = true;
  // A photo that is blurred against the others at the same surface gets less weight, see
  // photo_sharpness.h. Departure from the thesis.
  bool sharpness_weight = true;
  // Colours that contradict the others at a sample (people, moved chairs, shadows of the
  // photographer, reflections) lose their weight where most of them agree: the distance at which
  // half of it is lost, on a scale of 0..1 that is about even to the eye. Larger = more tolerant;
  // below 0.2, shiny surfaces, which look different in every photo, come out in blotches. 0 = never
  // (thesis).
  double outlier = 0.3;
  // What stands before the surface in one photo, and not in those that outvote it, gives no colour
  // anywhere in that photo (contradicted_parts.h). Departure from the thesis.
  bool leave_out_moving = true;
  // A photo whose brightness correlates less than this with that of the others at the same samples
  // shows something else (another room that looks alike, furniture that was moved) and gives no
  // colour, unless more than a fifth of the photos were to go. Photos 3 cm beside their places
  // (the kitchen) have 0.7 and more, photos half full of people 0.6. 0 = never.
  double min_agreement = 0.5;
  // Share of the spacing between samples over which a photo's pixels are averaged. 0 = the colour
  // at the sample (thesis); 1 = the whole cell, which keeps fine print from turning into grain.
  double footprint = 0.0;
  // Preservation of details (8.2.3), see detail.h. Off (departure from the thesis): the weights and
  // the consensus keep the detail already; what the dominant photo would add is mostly its noise
  // and its own misalignment (docs/texture.md: 0.2 to 0.4 dB lost on simulated rooms, with true
  // poses and with poses off by 0.05 degrees).
  bool detail = false;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// Thesis 8.2.2: W = (1 - (((x-w)/w)^2 + ((y-h)/h)^2)/2) D (0.9 - 0.899 B) + (1 - B) 0.01 for a
// visible sample (D = 1), at the position (x, y) in `img` of a photo of 2w x 2h pixels.
inline float ThesisWeight(float x, float y, float photo_width, float photo_height, bool boundary) {
  const float dx = 2 * x / photo_width - 1, dy = 2 * y / photo_height - 1;
  const float centrality = 1 - (dx * dx + dy * dy) / 2;
  return boundary ? centrality * (0.9f - 0.899f) : centrality * 0.9f + 0.01f;
}

// Share of its weight that a photo keeps (departure from the thesis). Directions from the sample,
// unit: u to the scanner, c to the camera, n the normal. A sample whose range is wrong by e is
// looked up |u - c (n.u)/(n.c)| e beside its place on the surface. A misalignment of the same size
// across the line of sight, larger at a slant, is added to that. Zero `normal` or `to_scanner`: 1.
float AngleWeight(const Eigen::Vector3f& to_camera, const Eigen::Vector3f& to_scanner,
                  const Eigen::Vector3f& normal);

// Share of its weight that a photo keeps (departure from the thesis): half of it with 25 pixels per
// sample (an area, foreshortening counted).
float ResolutionWeight(float pixels_per_sample);

// Colour of a photo (8-bit BGR, sRGB) at a position in `img`, by cubic interpolation (Catmull-Rom;
// Keys 1981, "Cubic Convolution Interpolation for Digital Image Processing") of linear light: half
// a decibel nearer to the truth than bilinear on the simulated room.
struct PhotoColor {
  Eigen::Vector3f linear;  // r, g, b, 0..1
  float reliability;  // 1; falls to 1/2 towards pixels whose brightest channel is clipped at 255
};
PhotoColor LookUpPhoto(const cv::Mat& photo, float x, float y);
// Mean over a square of the given side in pixels around the position.
PhotoColor LookUpPhoto(const cv::Mat& photo, float x, float y, float side);

// The blend of one sample: M = sum W M_i / sum W in linear light, because that is what adds up when
// light is averaged and what the exposure gains apply to.
struct BlendedSample {
  Eigen::Vector3f blend = Eigen::Vector3f::Zero();     // M, linear light
  Eigen::Vector3f dominant = Eigen::Vector3f::Zero();  // C, of the photo with the largest weight
  int dominant_photo = -1;                             // S; -1 = no photo sees the sample
  bool dominant_fits = false;  // it does not contradict the blend, so that it may give detail
};
// How many of a sample's observations give it its colour, the first ones: what is in doubt counts
// only where there is nothing else, and then only if two of them agree; 0 = no colour. gains:
// linear, one 3-vector (r, g, b) per photo.
int NumThatCount(const Observation* observations, int count,
                 const std::vector<Eigen::Vector3f>& gains);
// gains: as above. shares (if given): room for `count` numbers, what each observation has of the
// blend; they sum to 1, or are all 0 without a colour.
BlendedSample BlendSample(const Observation* observations, int count,
                          const std::vector<Eigen::Vector3f>& gains, double outlier,
                          float* shares = nullptr);

// What the photos of a sample say of one of them: kAgrees with most of them, is kOutvoted by most,
// or kOpen: they differ, and no side has more than half. kNone: a single one, or in doubt.
enum class Vote : uint8_t { kNone, kAgrees, kOutvoted, kOpen };
// One vote per observation.
void CastVotes(const Observation* observations, int count,
               const std::vector<Eigen::Vector3f>& gains, double outlier, Vote* votes);

}  // namespace roomtex
