#pragma once
// One connection of LocalServer; for local_server.cc only.

#include <chrono>
#include <map>
#include <optional>
#include <string>

// Eigen before httplib: resolv.h defines a macro _res, which is a name in Eigen.
// clang-format off
#include "core/local_server.h"

#include <httplib.h>
// clang-format on

// cpp-httplib reads the request line, decodes paths and queries, compresses and writes answers.
// What it does not bound (0.11: number of header lines, chunked and compressed bodies, the time of
// a whole request, waiting connections), and what we have no use for (files, ranges, multipart,
// regular expressions over headers), never gets to it: sockets are ours, a request is read whole
// within the limits first, and only the header fields that are used are passed on.

namespace roomtex {

// Go with every answer.
const httplib::Headers& SafetyHeaders();
// {"error": sentence} as text; what is not UTF-8 is replaced.
std::string ErrorText(const std::string& sentence);
std::string LowerCase(std::string text);  // ASCII
// Whether there is something to read within so many milliseconds.
bool IsReadable(int fd, int milliseconds = 0);

// One connection: reads whole requests within the limits and is the stream that httplib reads the
// passed part of the head from and writes the answer to.
class LocalConnection : public httplib::Stream {
 public:
  // Takes the socket, which does not block. stop_fd is readable once the server is to stop.
  LocalConnection(int socket, int stop_fd, const LocalServerOptions& options)
      : socket_(socket), stop_fd_(stop_fd), options_(options) {}
  ~LocalConnection() override;

  // The next request: its body; the head is then to be read by httplib. None when there is no more
  // or when it was refused.
  std::optional<std::string> NextRequest();

  // httplib's side.
  bool is_readable() const override { return next_ < head_.size(); }
  bool is_writable() const override { return true; }
  ssize_t read(char* to, size_t size) override;
  ssize_t write(const char* from, size_t size) override;
  void get_remote_ip_and_port(std::string&, int&) const override {}
  void get_local_ip_and_port(std::string&, int&) const override {}
  socket_t socket() const override { return socket_; }

 private:
  // Appends what has arrived to received_; false at the end, at the deadline and when stopping.
  bool Receive(std::chrono::steady_clock::time_point deadline);
  // Status of a refusal, or 0: fills head_, content_length_ and expects_continue_.
  int ParseHead(const std::string& head);
  int ParseField(const std::string& line, std::map<std::string, std::string>* fields) const;
  std::nullopt_t Refuse(int status);

  const int socket_, stop_fd_;
  const LocalServerOptions& options_;
  std::string received_;  // and not used yet
  std::string head_;      // for httplib
  size_t next_ = 0;       // in head_
  size_t content_length_ = 0;
  bool expects_continue_ = false;
};

}  // namespace roomtex
