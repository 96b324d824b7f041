#pragma once
// Photos that show something else than the others do at the same places: of another room that looks
// alike, of the room before it was furnished anew. Their poses may fit, so that only their colours
// tell.

#include <algorithm>
#include <vector>

#include <Eigen/Core>

#include "texture/sampling/observations.h"

namespace roomtex {

struct PhotoAgreement {
  size_t num_samples = 0;  // that were compared: two other photos and more see them
  // Of the photo's brightness with the median of the others' at the same samples, -1..1, whatever
  // the exposures are; 0 = not compared.
  double correlation = 0;
  // What is left of its brightness after the best gain and offset, RMS, on a scale of 0..1 that is
  // about even to the eye.
  double difference = 0;
};

// gains and result: one per photo. Observations in doubt and clipped ones do not count.
std::vector<PhotoAgreement> MeasureAgreement(const ObservationStore& store,
                                             const std::vector<Eigen::Vector3f>& gains);

// Numbers of the photos that contradict the others: correlated by less than min_correlation, and
// further from them than photos of this set usually are. A photo of a bare wall correlates with
// nothing, but is near to all.
std::vector<int> FindForeignPhotos(const std::vector<PhotoAgreement>& agreement,
                                   double min_correlation);

// Samples at which photos stand against each other in groups: two and more that agree against two
// and more that agree. What moves or mirrors differs from photo to photo; where part of the photos
// stand elsewhere than they were aligned, groups do. Two projectors that throw one pattern, or
// rooms that look alike, fold a sparse model so that every residual is small.
struct DividedPhotos {
  size_t num_samples = 0;  // that four photos and more show
  size_t num_unlike = 0;   // of these, where any two photos differ
  size_t num_divided = 0;  // of these, where groups do

  double ShareOfAll() const { return num_divided / std::max(1.0, 1.0 * num_samples); }
  double ShareOfUnlike() const { return num_divided / std::max(1.0, 1.0 * num_unlike); }
  // So many that the poses are not to be trusted. agreement: in another light, too, photos stand
  // against each other in groups, but what they show is alike.
  bool Fold(const std::vector<PhotoAgreement>& agreement) const;
};
DividedPhotos FindDividedPhotos(const ObservationStore& store,
                                const std::vector<Eigen::Vector3f>& gains);

}  // namespace roomtex
