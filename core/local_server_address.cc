#include "core/local_server_address.h"

#include <cstring>

#include <netdb.h>
#include <strings.h>
#include <unistd.h>

namespace roomtex {
namespace {

const sockaddr_in& V4(const LocalAddress& address) {
  return reinterpret_cast<const sockaddr_in&>(address.storage);
}
const sockaddr_in6& V6(const LocalAddress& address) {
  return reinterpret_cast<const sockaddr_in6&>(address.storage);
}

}  // namespace

int LocalAddress::port() const { return ntohs(is_v6() ? V6(*this).sin6_port : V4(*this).sin_port); }

void LocalAddress::set_port(int port) {
  const in_port_t number = htons(static_cast<in_port_t>(port));
  (is_v6() ? reinterpret_cast<sockaddr_in6&>(storage).sin6_port
           : reinterpret_cast<sockaddr_in&>(storage).sin_port) = number;
}

bool LocalAddress::IsLoopback() const {
  return is_v6() ? IN6_IS_ADDR_LOOPBACK(&V6(*this).sin6_addr)
                 : ntohl(V4(*this).sin_addr.s_addr) >> 24 == IN_LOOPBACKNET;
}

bool LocalAddress::IsAny() const {
  return is_v6() ? IN6_IS_ADDR_UNSPECIFIED(&V6(*this).sin6_addr)
                 : V4(*this).sin_addr.s_addr == INADDR_ANY;
}

std::string LocalAddress::Text() const {
  char text[INET6_ADDRSTRLEN] = "";
  const void* source = is_v6() ? static_cast<const void*>(&V6(*this).sin6_addr)
                               : static_cast<const void*>(&V4(*this).sin_addr);
  inet_ntop(storage.ss_family, source, text, sizeof text);
  return is_v6() ? "[" + std::string(text) + "]" : text;
}

std::optional<LocalAddress> ResolveHost(const std::string& host) {
  // Browsers try both; 127.0.0.1 is there on every machine.
  const std::string name = strcasecmp(host.c_str(), "localhost") == 0 ? "127.0.0.1" : host;
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (name.empty() || getaddrinfo(name.c_str(), nullptr, &hints, &found) != 0) return std::nullopt;
  LocalAddress address;
  std::memcpy(&address.storage, found->ai_addr, found->ai_addrlen);
  address.size = found->ai_addrlen;
  freeaddrinfo(found);
  if (address.storage.ss_family != AF_INET && !address.is_v6()) return std::nullopt;
  return address;
}

bool IsAddressLiteral(const std::string& host) {
  in6_addr ignored;
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') {
    return inet_pton(AF_INET6, host.substr(1, host.size() - 2).c_str(), &ignored) == 1;
  }
  return inet_pton(AF_INET, host.c_str(), &ignored) == 1;
}

std::string HostName() {
  char name[256] = "";
  if (gethostname(name, sizeof name - 1) != 0 || name[0] == 0) return "localhost";
  return name;
}

}  // namespace roomtex
