#pragma once
// Work side by side. Whatever is computed must not depend on the number of threads: give every
// index its own place to write, or add up per fixed chunk in order.

#include <functional>

namespace roomtex {

// The number of threads to use for --num_threads: -1 = all of the machine.
int EffectiveThreads(int num_threads);

// Calls body(index) for every index in [begin, end), on num_threads threads; returns when all are
// done. The first exception of a body is thrown again here. Indices are handed out one by one in
// order.
void ParallelFor(int num_threads, int begin, int end, const std::function<void(int)>& body);

}  // namespace roomtex
