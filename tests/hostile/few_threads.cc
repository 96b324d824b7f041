// Loaded before the C library (LD_PRELOAD): after THREADS_AT_MOST threads, no other can be started,
// as under ulimit -u, which the super-user's processes do not feel.

#include <atomic>
#include <cerrno>
#include <cstdlib>

#include <dlfcn.h>
#include <pthread.h>

extern "C" int pthread_create(pthread_t* thread, const pthread_attr_t* attributes,
                              void* (*start)(void*), void* argument) noexcept {
  static std::atomic<int> count{0};
  const char* const limit = std::getenv("THREADS_AT_MOST");
  if (limit != nullptr && count++ >= std::atoi(limit)) return EAGAIN;
  const auto next = reinterpret_cast<decltype(&pthread_create)>(dlsym(RTLD_NEXT, "pthread_create"));
  return next(thread, attributes, start, argument);
}
