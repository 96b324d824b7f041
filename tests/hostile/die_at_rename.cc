// Loaded before the C library (LD_PRELOAD): ends the process at its N-th rename, before it happens
// (DIE_AT=N) or after it (DIE_AFTER=N), as a power cut or kill -9 would. DIE_PROGRAM: only the
// process of this program, not those that it starts or is started by.

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>

#include <dlfcn.h>
#include <unistd.h>

namespace {

int count = 0;

bool IsTime(const char* name) {
  const char* const value = std::getenv(name);
  const char* const program = std::getenv("DIE_PROGRAM");
  if (program != nullptr && std::strcmp(program, program_invocation_short_name) != 0) return false;
  return value != nullptr && std::atoi(value) == count;
}

template <typename Function, typename... Arguments>
int Renamed(const char* name, Arguments... arguments) {
  const auto next = reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
  ++count;
  if (IsTime("DIE_AT")) kill(getpid(), SIGKILL);
  const int result = next(arguments...);
  if (IsTime("DIE_AFTER")) kill(getpid(), SIGKILL);
  return result;
}

}  // namespace

extern "C" {

int rename(const char* from, const char* to) noexcept {
  return Renamed<int (*)(const char*, const char*)>("rename", from, to);
}

int renameat(int a, const char* from, int b, const char* to) noexcept {
  return Renamed<int (*)(int, const char*, int, const char*)>("renameat", a, from, b, to);
}

int renameat2(int a, const char* from, int b, const char* to, unsigned flags) noexcept {
  return Renamed<int (*)(int, const char*, int, const char*, unsigned)>("renameat2", a, from, b, to,
                                                                        flags);
}
}
