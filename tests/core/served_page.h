#pragma once
// A server with one of everything, for tests.

#include <atomic>
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/local_server.h"

// After Eigen: what it includes defines a macro _res, a name that Eigen uses.
#include <arpa/inet.h>
#include <httplib.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

namespace roomtex {

inline LocalServerOptions AnyPort() {
  LocalServerOptions options;
  options.port = 0;
  return options;
}

// Sends bytes as they are and gives what comes back until the server closes.
inline std::string SendRaw(int port, const std::string& bytes) {
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(connect(socket, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  size_t sent = 0;
  while (sent < bytes.size()) {
    const ssize_t count = send(socket, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (count <= 0) break;
    sent += static_cast<size_t>(count);
  }
  shutdown(socket, SHUT_WR);
  std::string answer;
  char block[4096];
  for (ssize_t count; (count = recv(socket, block, sizeof block, 0)) > 0;) {
    answer.append(block, static_cast<size_t>(count));
  }
  close(socket);
  return answer;
}

class ServedPage : public testing::Test {
 protected:
  void SetUp() override { Start(AnyPort()); }

  void Start(const LocalServerOptions& options) {
    server_ = std::make_unique<LocalServer>(options);
    server_->AddAsset("/", "text/html", "<p>page</p>");
    server_->AddJson("/sum", [](const LocalServer::Query& query) {
      return Json{{"sum", std::stoi(query.at("a")) + std::stoi(query.at("b"))}};
    });
    server_->AddPost("/echo", [this](const Json& json) {
      ++num_posts_;
      return json;
    });
    server_->AddDelete("/echo", [this](const Json&) {
      ++num_posts_;
      return Json("gone");
    });
    server_->AddPost("/fail", [](const Json& json) -> Json {
      const std::string kind = json.value("kind", "");
      if (kind == "input") throw InputError("picks.csv", "line 3", "is odd", "Make it even");
      if (kind == "usage") throw UsageError("--a and --b do not go together");
      if (kind == "bytes") throw InputError("caf\xe9.jpg", "", "is odd", "");
      if (kind == "memory") throw std::bad_alloc();
      if (kind == "number") throw 42;
      throw std::runtime_error("surprise");
    });
    server_->AddContent(
        "/tile", [this](const LocalServer::Query& query) -> std::optional<LocalServer::Content> {
          if (!query.count("x") || query.at("x") != "1") return std::nullopt;
          return LocalServer::Content{large_, "image/jpeg", "tile-1", true};
        });
    server_->AddContent("/piece", [this](const LocalServer::Query&) {
      return LocalServer::Content{large_, "application/octet-stream", "", true};
    });
    server_->Start(false);
    port_ = server_->port();
    const std::string url = server_->Url();
    base_ = url.substr(url.find('/', 7), std::string::npos);
    base_.pop_back();
    origin_ = "http://127.0.0.1:" + std::to_string(port_);
  }

  httplib::Client Client() const {
    httplib::Client client("127.0.0.1", port_);
    client.set_read_timeout(10);
    return client;
  }
  int GetStatus(const std::string& path, const httplib::Headers& headers = {}) const {
    const auto answer = Client().Get(path, headers);
    return answer ? answer->status : -1;
  }
  int PostStatus(const httplib::Headers& headers, const std::string& body = "{}",
                 const std::string& type = "application/json") const {
    const auto answer = Client().Post(base_ + "/echo", headers, body, type);
    return answer ? answer->status : -1;
  }
  std::string HostLine() const { return "Host: 127.0.0.1:" + std::to_string(port_) + "\r\n"; }

  // Larger than the buffers of a socket, with bytes of every kind.
  const std::shared_ptr<const std::string> large_ = [] {
    auto bytes = std::make_shared<std::string>(5 << 20, 0);
    for (size_t i = 0; i < bytes->size(); ++i) (*bytes)[i] = static_cast<char>(i * i >> 7);
    return bytes;
  }();
  std::atomic<int> num_posts_{0};
  std::unique_ptr<LocalServer> server_;
  int port_ = 0;
  std::string base_;  // "/TOKEN"
  std::string origin_;
};

}  // namespace roomtex
