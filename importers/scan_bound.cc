#include "importers/scan_bound.h"

#include "core/option_fields.h"

namespace roomtex {
namespace {

constexpr int kLargestStride = 64;  // fewer samples show no room

}  // namespace

void ScanBound::Declare(OptionFields* fields) {
  fields
      ->Int(
          "max_samples", &max_samples,
          "Samples of several scans together that are held in memory. Scans with more are thinned "
          "out while they are read, all alike: every second (fourth, ...) column and row. Larger "
          "= exacter, and more memory.")
      .AtLeast(1000);
}

std::vector<std::string> ScanBound::Problems() const { return ProblemsOf(*this); }

void ScanThinner::Take(std::vector<Scan>* of_file) {
  const auto thin = [](int stride, Scan* scan) {
    if (stride > 1 && scan->kind() != Scan::Kind::kMesh) *scan = Thinned(*scan, stride);
  };
  const auto samples_of = [](const std::vector<Scan>& scans) {
    double count = 0;
    for (const Scan& scan : scans) {
      if (scan.kind() != Scan::Kind::kMesh) count += static_cast<double>(scan.points.size());
    }
    return count;
  };
  if (held_->size() + of_file->size() < 2) return;
  thin(stride_, &of_file->back());
  while (samples_of(*held_) + samples_of(*of_file) > max_samples_ && stride_ < kLargestStride) {
    for (Scan& scan : *held_) thin(2, &scan);
    for (Scan& scan : *of_file) thin(2, &scan);
    stride_ *= 2;
  }
}

}  // namespace roomtex
