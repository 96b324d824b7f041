#pragma once
// Large vectors that are no longer needed.

namespace roomtex {

// Empties them and gives their memory back, which `v = {}` and clear() keep.
template <typename... Vectors>
void FreeVectors(Vectors*... vectors) {
  (Vectors().swap(*vectors), ...);
}

}  // namespace roomtex
