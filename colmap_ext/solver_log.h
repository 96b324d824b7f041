#pragma once

namespace roomtex {

// Ceres tells of steps that it had to retry through glog, on stderr, also where its own log is
// silent; its result says what matters. Before each ceres::Solve().
void SilenceCeres();

}  // namespace roomtex
