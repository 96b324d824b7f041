#include "core/local_server_http.h"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <future>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "core/resource_limits.h"

namespace roomtex {
namespace {

[[noreturn]] void Fail(const std::string& what) {
  throw std::runtime_error("no socket for the page's server: " + what + ": " +
                           std::strerror(errno));
}

// A path of any file that is open here, short enough for the address of a socket.
std::string PathOf(int descriptor) { return "/proc/self/fd/" + std::to_string(descriptor); }

}  // namespace

LocalSocket::~LocalSocket() {
  if (descriptor_ >= 0) close(descriptor_);
}

Workers::Workers(size_t count) {
  threads_.reserve(count);
  try {
    while (threads_.size() < count) threads_.emplace_back([this] { Work(); });
  } catch (const std::system_error&) {
    NoteThreadNotStarted();
    if (threads_.empty()) throw;
  }
}

void Workers::Work() {
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return ends_ || !jobs_.empty(); });
    if (jobs_.empty()) return;
    const std::function<void()> job = std::move(jobs_.front());
    jobs_.pop_front();
    lock.unlock();
    job();
    lock.lock();
  }
}

Workers::Enqueued Workers::enqueue(std::function<void()> job) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    jobs_.push_back(std::move(job));
  }
  changed_.notify_one();
  return static_cast<Enqueued>(true);
}

void Workers::shutdown() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ends_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) {
    if (thread.joinable()) thread.join();
  }
}

void HiddenHttp::Bind() {
  std::error_code no_folder;
  const std::filesystem::path parent = std::filesystem::temp_directory_path(no_folder);
  std::string folder = (no_folder ? "/tmp" : parent) / "roomtex-XXXXXX";
  if (mkdtemp(folder.data()) == nullptr) Fail(folder);
  const int folder_file = open(folder.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC);
  const std::string path = PathOf(folder_file) + "/http";
  server_.set_address_family(AF_UNIX);
  server_.set_socket_options([](socket_t) {});  // those of httplib are for ports
  const int unused_port = 1;
  if (server_.bind_to_port(path, unused_port)) {
    socket_file_ = open(path.c_str(), O_PATH | O_NOFOLLOW | O_CLOEXEC);
  }
  const int error = errno;
  unlink(path.c_str());
  close(folder_file);
  rmdir(folder.c_str());
  errno = error;
  if (socket_file_ < 0) Fail(folder);
}

void HiddenHttp::Start(int num_threads) {
  Bind();
  server_.set_keep_alive_max_count(1);
  // The one public sign that stop() will be heard from now on, in old and new versions.
  const auto listens = std::make_shared<std::promise<void>>();
  const auto workers =
      std::make_shared<std::unique_ptr<Workers>>(new Workers(static_cast<size_t>(num_threads)));
  server_.new_task_queue = [listens, workers] {
    listens->set_value();
    return workers->release();  // httplib owns them
  };
  listener_ = StartThread([this] { server_.listen_after_bind(); });
  listens->get_future().wait();
}

LocalSocket HiddenHttp::Connect() const {
  LocalSocket connection(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  PathOf(socket_file_).copy(address.sun_path, sizeof address.sun_path - 1);
  const int failed =
      connect(connection.get(), reinterpret_cast<sockaddr*>(&address), sizeof address);
  return failed == 0 ? std::move(connection) : LocalSocket();
}

void HiddenHttp::Stop() {
  if (listener_.joinable()) {
    server_.stop();
    listener_.join();
  }
  if (socket_file_ >= 0) close(std::exchange(socket_file_, -1));
}

}  // namespace roomtex
