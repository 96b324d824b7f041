#pragma once
// Do photos show the same at the same places? Photos of another room that looks alike, or of the
// room before it was furnished anew, fit by their poses, and so do the halves of a sparse model
// that is folded: only their colours tell.

#include <cstddef>
#include <utility>
#include <vector>

#include "core/report.h"

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

// Samples at which photos stand against each other in groups: two and more that agree against two
// and more that agree. What moves or mirrors differs from photo to photo; where part of the photos
// stand elsewhere than they were aligned, groups do. Two projectors that throw one pattern, or
// rooms that look alike, fold a sparse model so that every residual is small.
struct DividedPhotos {
  size_t num_samples = 0;  // that four photos and more show
  size_t num_unlike = 0;   // of these, where any two photos differ
  size_t num_divided = 0;  // of these, where groups do

  double ShareOfAll() const;     // divided ones of all
  double ShareOfUnlike() const;  // divided ones of those that are unlike
};

// Collects samples of the scan as photos show them.
class PhotoComparison {
 public:
  explicit PhotoComparison(size_t num_photos = 0) : sums_(num_photos) {}

  // A sample: the number of each photo that sees it, and how bright it is there: 0..1, on a scale
  // about even to the eye, exposures made equal.
  void Add(const std::vector<std::pair<int, float>>& seen);

  std::vector<PhotoAgreement> Agreement() const;  // per photo
  const DividedPhotos& Divided() const { return divided_; }
  // Of the median photo that can be compared, with the others; NaN if there is none.
  double MedianCorrelation() const;
  // The photos do not stand where they were aligned: they show little alike (median over them), or
  // stand against each other in groups. In another light they do so, too, but what they show is
  // alike. False where too little can be compared.
  bool Contradicts() const;
  // They do stand there: the median photo shows what the others show. False where too little can be
  // compared. Of the places of the photos to each other, not of a scale or a place in the scan.
  bool Agrees() const;

 private:
  // Over the samples of a photo, of its brightness p and the others' median o.
  struct Sums {
    double n = 0, p = 0, o = 0, pp = 0, oo = 0, po = 0;
  };
  std::vector<Sums> sums_;
  DividedPhotos divided_;
  std::vector<float> values_;  // of the sample at hand
};

Json ToJson(const PhotoComparison& comparison);  // the reports' `divided_photos`

}  // namespace roomtex
