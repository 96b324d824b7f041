#pragma once
#include "core/error.h"

namespace roomtex {

// A reader may refuse with an InputError; whatever else it throws is a finding.
template <typename Read>
void TryRead(const Read& read) {
  try {
    read();
  } catch (const InputError&) {
  }
}

}  // namespace roomtex
