#pragma once
// Calls of the system that a test makes fail, or watches. Those of this program stand before those
// of the C library.

#include <functional>
#include <string>

#include <sys/types.h>

namespace roomtex {

// The error number; 0 = the call goes on as usual. They end with this object, one at a time.
struct FailingCalls {
  std::function<int(const std::string& from, const std::string& to)> on_rename;
  std::function<int(const std::string& path)> on_fsync;
  int other_users = 0;  // added to the number of the user: our files are another's then

  FailingCalls();
  ~FailingCalls();
  FailingCalls(const FailingCalls&) = delete;
  FailingCalls& operator=(const FailingCalls&) = delete;
};

}  // namespace roomtex
