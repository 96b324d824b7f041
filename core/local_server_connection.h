#pragma once
// One connection of LocalServer; for local_server.cc only.

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "core/local_server.h"
#include "core/local_server_http.h"

// cpp-httplib reads the request line, decodes paths and queries, compresses and writes answers.
// What it does not bound (0.11: number of header lines, chunked and compressed bodies, the time of
// a whole request, waiting connections), and what we have no use for (files, ranges, multipart,
// regular expressions over headers), never gets to it: the browser's sockets are ours, a request is
// read whole within the limits first, and only the header fields that are used are passed on.

namespace roomtex {

// Go with every answer.
const httplib::Headers& SafetyHeaders();
// The one of a connection that stays open (HTTP/1.1 keep-alive), and how often.
inline constexpr int kMaxRequests = 1000;
// {"error": sentence} as text; what is not UTF-8 is replaced.
std::string ErrorText(const std::string& sentence);
// Whether there is something to read within so many milliseconds.
bool IsReadable(int fd, int milliseconds = 0);

// A request within the limits, as httplib is to see it.
struct LocalRequest {
  std::string head;  // request line and the fields that are used; no Connection, no empty line
  std::string body;
  bool wants_close = false;  // the browser wants no further one on this connection
};

// A browser's connection.
class LocalConnection {
 public:
  // Takes the socket, which does not block. stop_fd is readable once the server is to stop.
  LocalConnection(int socket, int stop_fd, const LocalServerOptions& options)
      : browser_(socket), stop_fd_(stop_fd), options_(options) {}

  // None when there is no more or when it was refused.
  std::optional<LocalRequest> NextRequest();
  // Sends the request to httplib at a connection of its own, and the answer to the browser, which
  // is told whether it is the last. False when either is gone.
  bool Relay(const LocalRequest& request, bool is_last, const LocalSocket& http) const;

 private:
  // Appends what has arrived to received_; false at the end, at the deadline and when stopping.
  bool Receive(std::chrono::steady_clock::time_point deadline);
  // Status of a refusal, or 0: fills request, content_length_ and expects_continue_.
  int ParseHead(const std::string& head, LocalRequest* request);
  int ParseField(const std::string& line, std::map<std::string, std::string>* fields) const;
  std::nullopt_t Refuse(int status);
  // False when the browser is gone or takes nothing for too long.
  bool Send(std::string_view bytes) const;

  const LocalSocket browser_;
  const int stop_fd_;
  const LocalServerOptions& options_;
  std::string received_;  // and not used yet
  size_t content_length_ = 0;
  bool expects_continue_ = false;
};

}  // namespace roomtex
