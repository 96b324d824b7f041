#pragma once
// Runs of connected samples along the rows and the columns of a scan's grid, for filters that must
// not reach over depth edges or missing samples.

#include <algorithm>
#include <vector>

#include "core/parallel.h"
#include "core/scan.h"
#include "texture/sampling/grid_links.h"

namespace roomtex {

// Calls body(indices) for every run of connected samples along the rows (columns == false) or
// columns. `indices` are grid indices in order; runs have at least two samples and do not wrap
// around a full turn. Runs of one line are handed out by one thread, lines side by side.
template <typename Body>
void ForEachRun(const Scan& scan, const GridLinks& links, bool columns, int num_threads,
                const Body& body) {
  const int num_lines = columns ? scan.num_columns : scan.num_rows;
  const int length = columns ? scan.num_rows : scan.num_columns;
  const int step = columns ? scan.num_columns : 1;
  const uint8_t link = columns ? GridLinks::kDown : GridLinks::kRight;
  constexpr int kLinesAtOnce = 16;
  ParallelFor(num_threads, 0, (num_lines + kLinesAtOnce - 1) / kLinesAtOnce, [&](int block) {
    std::vector<int> run;
    const int end = std::min(num_lines, (block + 1) * kLinesAtOnce);
    for (int line = block * kLinesAtOnce; line < end; ++line) {
      run.clear();
      for (int i = 0; i < length; ++i) {
        const int index = columns ? scan.Index(line, i) : scan.Index(i, line);
        run.push_back(index);
        const bool connected = i + 1 < length && (links.bits[index] & link) != 0;
        if (connected) continue;
        if (run.size() > 1) body(run, step);
        run.clear();
      }
    }
  });
}

}  // namespace roomtex
