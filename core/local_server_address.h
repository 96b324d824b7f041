#pragma once
// Addresses that LocalServer binds; for local_server.cc only.

#include <optional>
#include <string>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace roomtex {

struct LocalAddress {
  sockaddr_storage storage{};  // AF_INET or AF_INET6
  socklen_t size = 0;

  sockaddr* get() { return reinterpret_cast<sockaddr*>(&storage); }
  bool is_v6() const { return storage.ss_family == AF_INET6; }
  int port() const;
  void set_port(int port);
  bool IsLoopback() const;   // only this machine reaches it
  bool IsAny() const;        // 0.0.0.0 or [::]
  std::string Text() const;  // as it stands in a URL: "127.0.0.1", "[::1]"
};

// Of a name or a number; "localhost" is 127.0.0.1. None if there is no such host.
std::optional<LocalAddress> ResolveHost(const std::string& host);
// "192.168.1.5" or "[fe80::1]", no name.
bool IsAddressLiteral(const std::string& host);
// Of this machine.
std::string HostName();

}  // namespace roomtex
