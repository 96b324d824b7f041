#include "tests/core/failing_calls.h"

#include <atomic>
#include <cerrno>
#include <filesystem>
#include <system_error>

#include <dlfcn.h>
#include <unistd.h>

namespace roomtex {
namespace {

std::atomic<const FailingCalls*> current_calls{nullptr};

template <typename Function>
Function Next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

}  // namespace

FailingCalls::FailingCalls() { current_calls = this; }
FailingCalls::~FailingCalls() { current_calls = nullptr; }

extern "C" {

int rename(const char* from, const char* to) noexcept {
  const FailingCalls* const calls = current_calls;
  const int error = calls != nullptr && calls->on_rename ? calls->on_rename(from, to) : 0;
  if (error != 0) return errno = error, -1;
  return Next<int (*)(const char*, const char*)>("rename")(from, to);
}

int fsync(int descriptor) {
  const FailingCalls* const calls = current_calls;
  std::error_code ignored;
  const int error =
      calls != nullptr && calls->on_fsync
          ? calls->on_fsync(std::filesystem::read_symlink(
                                "/proc/self/fd/" + std::to_string(descriptor), ignored)
                                .string())
          : 0;
  if (error != 0) return errno = error, -1;
  return Next<int (*)(int)>("fsync")(descriptor);
}

uid_t geteuid() noexcept {
  const FailingCalls* const calls = current_calls;
  const uid_t user = Next<uid_t (*)()>("geteuid")();
  return calls == nullptr ? user : user + static_cast<uid_t>(calls->other_users);
}
}

}  // namespace roomtex
