#pragma once
// Photos that show something else than the others do at the same places: of another room that looks
// alike, of the room before it was furnished anew. Their poses may fit, so that only their colours
// tell.

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

// Most photos contradict what the others show at the same places: some of them stand elsewhere than
// they were aligned, in groups that agree among themselves. Two projectors that throw one pattern,
// or rooms that look alike, fold a sparse model so that every residual is small.
bool ContradictEachOther(const std::vector<PhotoAgreement>& agreement);

}  // namespace roomtex
