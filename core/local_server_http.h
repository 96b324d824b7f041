#pragma once
// cpp-httplib behind the gate of LocalServer; for local_server*.cc only.

#include <thread>
#include <utility>

// Eigen before httplib: resolv.h defines a macro _res, which is a name in Eigen.
// clang-format off
#include "core/local_server.h"

#include <httplib.h>
// clang-format on

namespace roomtex {

// A socket that is closed with its owner.
class LocalSocket {
 public:
  explicit LocalSocket(int descriptor = -1) : descriptor_(descriptor) {}
  LocalSocket(LocalSocket&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  LocalSocket& operator=(LocalSocket&&) = delete;
  ~LocalSocket();

  int get() const { return descriptor_; }  // -1 = none to be had

 private:
  int descriptor_;
};

// A httplib::Server that nothing but this process reaches: it listens at a Unix socket whose name
// is taken away at once, and we connect by the descriptor that stays. It answers one request of a
// connection, so that bytes behind a request are never taken for the next one.
class HiddenHttp {
 public:
  HiddenHttp() = default;
  ~HiddenHttp() { Stop(); }

  httplib::Server& server() { return server_; }  // its routes, before Start()
  // Throws std::runtime_error when the system gives no socket.
  void Start(int num_threads);
  // A new connection, which blocks.
  LocalSocket Connect() const;
  // After the last connection has ended.
  void Stop();

 private:
  void Bind();

  httplib::Server server_;
  int socket_file_ = -1;  // the file of the Unix socket, without a name
  std::thread listener_;
};

}  // namespace roomtex
