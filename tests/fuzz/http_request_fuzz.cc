// Any bytes as what a browser sends over one connection: refused, or requests within the limits,
// which httplib then answers; never a crash, a hang, or a field that httplib is not to see.

#include <cstdint>
#include <cstdlib>
#include <string>

#include <sys/eventfd.h>
#include <sys/socket.h>

#include "core/local_server_connection.h"
#include "core/text.h"

namespace {

// httplib with one route of each kind, running as long as the process.
roomtex::HiddenHttp& Http() {
  static roomtex::HiddenHttp* const http = [] {
    auto* const made = new roomtex::HiddenHttp();
    made->server().Get("/token/state", [](const httplib::Request& request, httplib::Response& r) {
      r.set_content(request.get_param_value("name"), "text/plain");
    });
    made->server().Put("/token/picks", [](const httplib::Request& request, httplib::Response& r) {
      r.set_content(request.body, "application/json");
    });
    made->Start(2);
    return made;
  }();
  return *http;
}

void RequireWithinLimits(const roomtex::LocalRequest& request,
                         const roomtex::LocalServerOptions& options) {
  const auto lacks = [&](const char* word) {
    return roomtex::LowerCase(request.head).find(word) == std::string::npos;
  };
  if (request.body.size() > static_cast<size_t>(options.max_body_bytes)) std::abort();
  if (request.head.size() > static_cast<size_t>(options.max_header_bytes) + 64) std::abort();
  if (request.head.find("\r\n\r\n") != std::string::npos || !lacks("\ncontent-length") ||
      !lacks("\ntransfer-encoding") || !lacks("\nrange:")) {
    std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const int stop_fd = eventfd(0, EFD_CLOEXEC);
  roomtex::LocalServerOptions options;
  options.max_body_bytes = 2000;
  options.max_header_bytes = 1000;
  int sockets[2];
  if (stop_fd < 0 || socketpair(AF_UNIX, SOCK_STREAM, 0, sockets) != 0) std::abort();
  const roomtex::LocalSocket browser(sockets[0]);
  const int large = 1 << 20;  // nobody takes the answers before all are sent
  setsockopt(sockets[1], SOL_SOCKET, SO_SNDBUF, &large, sizeof large);
  if (send(browser.get(), data, size, 0) != static_cast<ssize_t>(size)) std::abort();
  shutdown(browser.get(), SHUT_WR);
  roomtex::LocalConnection connection(sockets[1], stop_fd, options);
  for (int count = 0; count < 4; ++count) {
    const auto request = connection.NextRequest();
    if (!request) break;
    RequireWithinLimits(*request, options);
    const roomtex::LocalSocket http = Http().Connect();
    if (http.get() < 0) std::abort();
    connection.Relay(*request, request->wants_close, http);
    if (request->wants_close) break;
  }
  return 0;
}
