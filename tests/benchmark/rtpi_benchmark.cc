// ReadScan on scan files of three million samples. The column CPU counts user and system time of
// the process. Target for RTPI: 0.5 s.

#include <cmath>
#include <filesystem>
#include <random>
#include <string>

#include <benchmark/benchmark.h>
#include <unistd.h>

#include "importers/ptx.h"
#include "importers/rtpi.h"
#include "importers/scan_reader.h"

namespace roomtex {
namespace {

// A scan as large as the manual's example, 1267 columns of 2366 samples: elevations jitter by a
// fifth of a row, azimuths within a column too, every 500th sample is missing.
RtpiFile MakeFile() {
  constexpr double kDegree = 3.14159265358979323846 / 180;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> jitter(-0.2, 0.2);
  RtpiFile file;
  file.header.units = "inches";
  file.header.el_fov = {-55.9643, 86.0231};
  file.header.samples_per_degree_el = 16.66;
  file.header.max_range = 240;
  for (int column = 0; column < 1267; ++column) {
    for (int row = 0; row < 2366; ++row) {
      if (random() % 500 == 0) continue;
      const double theta = (-185.683 + (column + 0.01 * jitter(random)) / 13.25) * kDegree;
      const double phi = (-55.9643 + (row + jitter(random)) / 16.6634) * kDegree;
      file.samples.push_back({static_cast<float>(100 + 20 * std::sin(3 * theta)),
                              static_cast<float>(theta), static_cast<float>(phi),
                              static_cast<uint32_t>(random() % 4096)});
    }
    file.column_begin.push_back(static_cast<int64_t>(file.samples.size()));
  }
  return file;
}

// Files in a folder of this process, removed at its end.
class Files {
 public:
  Files() {
    folder_ = std::filesystem::temp_directory_path() /
              ("roomtex-benchmark-" + std::to_string(::getpid()));
    std::filesystem::create_directory(folder_);
    RtpiFile file = MakeFile();
    WriteRtpi(file, Path("little.rtpi"));
    file.byte_order = ByteOrder::kBig;
    WriteRtpi(file, Path("big.rtpi"));
    WritePtx({ScanFromRtpi(file, {})}, Path("scan.ptx"));
  }
  ~Files() { std::filesystem::remove_all(folder_); }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }

 private:
  std::filesystem::path folder_;
};

void ReadScanOf(benchmark::State& state, const std::string& name) {
  static const Files files;
  for (auto _ : state) {
    const Scan scan = ReadScan(files.Path(name), {});
    benchmark::DoNotOptimize(scan.points.data());
  }
}

BENCHMARK_CAPTURE(ReadScanOf, rtpi_little, std::string("little.rtpi"))
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->MinTime(2);
BENCHMARK_CAPTURE(ReadScanOf, rtpi_big, std::string("big.rtpi"))
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->MinTime(2);
BENCHMARK_CAPTURE(ReadScanOf, ptx, std::string("scan.ptx"))
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->MinTime(2);

}  // namespace
}  // namespace roomtex
