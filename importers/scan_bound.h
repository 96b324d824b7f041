#pragma once
// Many stations in bounded memory: beyond a number of samples every scan is thinned out as soon as
// it is read, so that all surfaces are there and no more than one scan is held in full.

#include <string>
#include <vector>

#include "core/scan.h"

namespace roomtex {

class OptionFields;

struct ScanBound {
  // Samples of all scans together that are held; beyond, all are thinned out evenly.
  int max_samples = 20000000;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// All scans that are read are thinned by one stride, the smallest power of two that keeps the
// bound: what is held in the end does not depend on the order of the files. Not thinned are the
// only scan of a run, and meshes without a grid, which are not counted either.
class ScanThinner {
 public:
  // held: the scans of the files before, whose strides are the thinner's, too; must outlive it.
  ScanThinner(double max_samples, std::vector<Scan>* held)
      : max_samples_(max_samples), held_(held) {}

  // ScanVisitor: the last scan of `of_file` is in full, those before it are as they were left here.
  void Take(std::vector<Scan>* of_file);
  int stride() const { return stride_; }

 private:
  double max_samples_;
  std::vector<Scan>* held_;
  int stride_ = 1;
};

}  // namespace roomtex
