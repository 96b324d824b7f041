#include "colmap_ext/solver_log.h"

#include <glog/logging.h>

namespace roomtex {

void SilenceCeres() {
  static const bool once = [] {
    FLAGS_minloglevel = google::GLOG_FATAL;
    return true;
  }();
  (void)once;
}

}  // namespace roomtex
