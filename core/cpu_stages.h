#pragma once
// CPU seconds per stage of colouring, summed over all threads, for reports and benchmarks: stages
// that run side by side cannot be told apart by the clock on the wall. One count per process.

#include <string>
#include <utility>
#include <vector>

namespace roomtex {

enum class CpuStage {
  kMesh,        // triangulation, smoothing, tiles
  kDecode,      // photos' files to pixels
  kDepthMap,    // projection and drawing of the mesh
  kBoundaries,  // depth boundaries and their mask, gaps
  kSamples,     // projection, depth test, look-up and weight of the samples
  kMerge,       // what the photos say, per sample
  kExposure,
  kBlend,
  kDetail,
  kWrite,
};

// Counts from its construction to its end; microseconds of overhead. kThread: what this thread
// does; kProcess: what all threads do meanwhile, for stages that run alone. Do not nest.
class CpuTimer {
 public:
  enum class Scope { kThread, kProcess };
  explicit CpuTimer(CpuStage stage, Scope scope = Scope::kThread);
  ~CpuTimer();
  CpuTimer(const CpuTimer&) = delete;
  CpuTimer& operator=(const CpuTimer&) = delete;

 private:
  CpuStage stage_;
  int clock_;
  double started_;
};

// Name and seconds of every stage so far, and last "other": the process's seconds beside them.
std::vector<std::pair<std::string, double>> CpuSecondsByStage();

}  // namespace roomtex
