// FindScanPlanes on a scan of three million samples of a furnished room. The column CPU counts user
// and system time of the process. Target: 5 s, and below 60 bytes of memory a sample.

#include <benchmark/benchmark.h>

#include "align/surface/scan_planes.h"
#include "capture/simulation/simulated_room.h"

namespace roomtex {
namespace {

Scan MakeScan(double noise_growth, double bend) {
  SimulatedRoomOptions options;
  options.num_photos = 1;
  options.scan_columns = 2449;
  options.scan_rows = 1225;
  options.range_noise_growth = noise_growth;
  options.bend = bend;
  return SimulatedRoom(options).MakeScan();
}

void FindPlanesOf(benchmark::State& state, double noise_growth, double bend) {
  const std::vector<Scan> scans = {MakeScan(noise_growth, bend)};
  size_t num_planes = 0;
  for (auto _ : state) {
    num_planes = FindScanPlanes(scans, ScanPlaneOptions(), static_cast<int>(state.range(0))).size();
  }
  state.counters["planes"] = static_cast<double>(num_planes);
  state.counters["samples"] = static_cast<double>(scans[0].points.size());
}

BENCHMARK_CAPTURE(FindPlanesOf, furnished, 0.0, 0.0)
    ->Arg(1)
    ->Arg(2)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->MinTime(4);
BENCHMARK_CAPTURE(FindPlanesOf, growing_noise, 1.0, 0.0)
    ->Arg(1)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->MinTime(4);
BENCHMARK_CAPTURE(FindPlanesOf, bent, 0.0, 0.01)
    ->Arg(1)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->MinTime(4);

}  // namespace
}  // namespace roomtex
