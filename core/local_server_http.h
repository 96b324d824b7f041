#pragma once
// cpp-httplib behind the gate of LocalServer; for local_server*.cc only.

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

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

// Threads that do one job after the other. (httplib's own end the process where the system does not
// give as many as are asked for.)
class Workers : public httplib::TaskQueue {
 public:
  // So many, or as many as the system gives. Throws std::system_error if it gives none.
  explicit Workers(size_t count);
  ~Workers() override { Workers::shutdown(); }
  size_t count() const { return threads_.size(); }

  // void in old versions of httplib, bool in new ones.
  using Enqueued = decltype(std::declval<httplib::TaskQueue&>().enqueue({}));
  Enqueued enqueue(std::function<void()> job) override;
  void shutdown() override;  // once all jobs are done

 private:
  void Work();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> jobs_;
  bool ends_ = false;
  std::vector<std::thread> threads_;
};

// A httplib::Server that nothing but this process reaches: it listens at a Unix socket whose name
// is taken away at once, and we connect by the descriptor that stays. It answers one request of a
// connection, so that bytes behind a request are never taken for the next one.
class HiddenHttp {
 public:
  HiddenHttp() = default;
  ~HiddenHttp() { Stop(); }

  httplib::Server& server() { return server_; }  // its routes, before Start()
  // Throws std::runtime_error when the system gives no socket or no thread.
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
