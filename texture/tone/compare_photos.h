#pragma once
// Photos that show something else than the others do at the same places (core/photo_agreement.h).

#include <vector>

#include <Eigen/Core>

#include "core/photo_agreement.h"
#include "texture/sampling/observations.h"

namespace roomtex {

// gains: one per photo. Observations in doubt and clipped ones do not count.
PhotoComparison ComparePhotos(const ObservationStore& store,
                              const std::vector<Eigen::Vector3f>& gains);

// Numbers of the photos that contradict the others: correlated by less than min_correlation, and
// further from them than photos of this set usually are. A photo of a bare wall correlates with
// nothing, but is near to all.
std::vector<int> FindForeignPhotos(const std::vector<PhotoAgreement>& agreement,
                                   double min_correlation);

}  // namespace roomtex
