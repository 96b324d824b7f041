#include "core/local_server_connection.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <utility>

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace roomtex {
namespace {
using Clock = std::chrono::steady_clock;

constexpr int kMaxFields = 100;         // header lines of a request
constexpr double kFarewellSeconds = 2;  // for the last bytes when stopping or refusing
constexpr size_t kBlockBytes = size_t{1} << 16;
const std::array<const char*, 6> kUsedFields = {"host",          "origin",     "content-type",
                                                "if-none-match", "connection", "accept-encoding"};
// Scripts, styles and pictures only from us; blob: is how three.js hands textures on.
const char kContentPolicy[] =
    "default-src 'self'; img-src 'self' data: blob:; connect-src 'self' blob:; "
    "worker-src 'self' blob:; object-src 'none'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'";

Clock::time_point After(double seconds) {
  return Clock::now() +
         std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

int MillisecondsTo(Clock::time_point deadline) {
  using std::chrono::milliseconds;
  const auto left = std::chrono::duration_cast<milliseconds>(deadline - Clock::now()).count();
  return static_cast<int>(std::clamp<int64_t>(left + 1, 0, 1000000));
}

}  // namespace

const httplib::Headers& SafetyHeaders() {
  static const httplib::Headers headers = {{"Content-Security-Policy", kContentPolicy},
                                           {"X-Content-Type-Options", "nosniff"},
                                           {"X-Frame-Options", "DENY"},
                                           {"Referrer-Policy", "no-referrer"},
                                           {"Cross-Origin-Opener-Policy", "same-origin"},
                                           {"Cross-Origin-Resource-Policy", "same-origin"},
                                           {"Cache-Control", "no-store"}};
  return headers;
}
std::string LowerCase(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

std::string ErrorText(const std::string& sentence) {
  return Json{{"error", sentence}}.dump(-1, ' ', false, Json::error_handler_t::replace);
}
bool IsReadable(int fd, int milliseconds) {
  pollfd poll_fd{fd, POLLIN, 0};
  return poll(&poll_fd, 1, milliseconds) > 0;
}

LocalConnection::~LocalConnection() { close(socket_); }

ssize_t LocalConnection::read(char* to, size_t size) {
  const size_t count = std::min(size, head_.size() - next_);
  std::memcpy(to, head_.data() + next_, count);
  next_ += count;
  return static_cast<ssize_t>(count);
}

bool LocalConnection::Receive(Clock::time_point deadline) {
  while (true) {
    pollfd fds[2] = {{socket_, POLLIN, 0}, {stop_fd_, POLLIN, 0}};
    const int ready = poll(fds, 2, MillisecondsTo(deadline));
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0 || fds[1].revents != 0) return false;
    char block[kBlockBytes];
    const ssize_t size = recv(socket_, block, sizeof block, MSG_DONTWAIT);
    if (size < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (size <= 0) return false;
    received_.append(block, static_cast<size_t>(size));
    return true;
  }
}

std::optional<std::string> LocalConnection::NextRequest() {
  if (received_.empty() && !Receive(After(options_.idle_seconds))) return std::nullopt;
  const Clock::time_point deadline = After(options_.request_seconds);
  const auto late = [&] { return Clock::now() >= deadline; };
  const size_t max_head = static_cast<size_t>(options_.max_header_bytes);
  size_t end = received_.find("\r\n\r\n");
  for (; end == std::string::npos; end = received_.find("\r\n\r\n")) {
    if (received_.size() > max_head) return Refuse(431);
    if (late() || !Receive(deadline)) return late() ? Refuse(408) : std::nullopt;
  }
  if (end > max_head) return Refuse(431);
  const std::string head = received_.substr(0, end + 2);
  received_.erase(0, end + 4);
  if (const int status = ParseHead(head)) return Refuse(status);
  if (expects_continue_ && received_.size() < content_length_) {
    Stream::write(std::string("HTTP/1.1 100 Continue\r\n\r\n"));
  }
  while (received_.size() < content_length_) {
    if (late() || !Receive(deadline)) return late() ? Refuse(408) : std::nullopt;
  }
  std::string body = received_.substr(0, content_length_);
  received_.erase(0, content_length_);
  return body;
}

int LocalConnection::ParseHead(const std::string& head) {
  std::map<std::string, std::string> fields;
  size_t begin = head.find("\r\n") + 2;
  const std::string request_line = head.substr(0, begin);
  for (int count = 0; begin < head.size(); ++count) {
    if (count == kMaxFields) return 431;
    const size_t end = head.find("\r\n", begin);
    if (const int status = ParseField(head.substr(begin, end - begin), &fields)) return status;
    begin = end + 2;
  }
  if (fields.count("transfer-encoding")) return 411;
  if (fields.count("content-encoding")) return 415;
  const std::string length = fields.count("content-length") ? fields["content-length"] : "0";
  if (length.empty() || length.find_first_not_of("0123456789") != std::string::npos) return 400;
  if (length.size() > 12 || std::stoll(length) > options_.max_body_bytes) return 413;
  content_length_ = static_cast<size_t>(std::stoll(length));
  expects_continue_ = fields.count("expect") > 0;
  head_ = request_line;
  next_ = 0;
  for (const char* name : kUsedFields) {
    const auto field = fields.find(name);
    if (field == fields.end()) continue;
    // gzip or nothing: httplib's brotli takes seconds for a script.
    const bool is_encoding = field->first == "accept-encoding";
    if (is_encoding && field->second.find("gzip") == std::string::npos) continue;
    head_ += field->first + ": " + (is_encoding ? "gzip" : field->second) + "\r\n";
  }
  head_ += "\r\n";
  return 0;
}

int LocalConnection::ParseField(const std::string& line,
                                std::map<std::string, std::string>* fields) const {
  const auto is_name = [](unsigned char c) {
    return std::isalnum(c) || std::strchr("-_.!#$&'*+^`|~%", c);
  };
  const auto is_control = [](unsigned char c) { return (c < 32 && c != '\t') || c == 127; };
  const size_t colon = line.find(':');
  if (colon == std::string::npos || colon == 0) return 400;
  if (!std::all_of(line.begin(), line.begin() + static_cast<long>(colon), is_name)) return 400;
  if (std::any_of(line.begin(), line.end(), is_control)) return 400;
  const size_t first = line.find_first_not_of(" \t", colon + 1);
  const std::string value = first == std::string::npos
                                ? ""
                                : line.substr(first, line.find_last_not_of(" \t") + 1 - first);
  const std::string name = LowerCase(line.substr(0, colon));
  const bool is_new = fields->emplace(name, value).second;
  // Two of what decides anything would leave open which one counts.
  const bool decides = name == "host" || name == "origin" || name == "content-length" ||
                       name == "content-type" || name == "transfer-encoding";
  return is_new || !decides ? 0 : 400;
}

ssize_t LocalConnection::write(const char* from, size_t size) {
  size_t sent = 0;
  Clock::time_point deadline = After(options_.stall_seconds);
  Clock::time_point farewell = Clock::time_point::max();
  while (sent < size) {
    const ssize_t count = send(socket_, from + sent, size - sent, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (count > 0) {
      sent += static_cast<size_t>(count);
      deadline = After(options_.stall_seconds);
      continue;
    }
    if (count < 0 && errno != EAGAIN && errno != EINTR) return -1;
    if (IsReadable(stop_fd_)) farewell = std::min(farewell, After(kFarewellSeconds));
    if (Clock::now() >= std::min(deadline, farewell)) return -1;
    pollfd poll_fd{socket_, POLLOUT, 0};
    poll(&poll_fd, 1, std::min(100, MillisecondsTo(deadline)));
  }
  return static_cast<ssize_t>(size);
}

std::nullopt_t LocalConnection::Refuse(int status) {
  const std::map<int, std::pair<const char*, const char*>> kinds = {
      {400, {"Bad Request", "The request cannot be read."}},
      {408, {"Request Timeout", "The request took too long to arrive."}},
      {411, {"Length Required", "The request must say its length."}},
      {413, {"Payload Too Large", "The request is larger than this server takes."}},
      {415, {"Unsupported Media Type", "Compressed requests are not taken."}},
      {431, {"Request Header Fields Too Large", "The header of the request is too large."}}};
  const auto& [reason, sentence] = kinds.at(status);
  const std::string body = ErrorText(sentence);
  std::string text = "HTTP/1.1 " + std::to_string(status) + " " + reason + "\r\n";
  for (const auto& [name, value] : SafetyHeaders()) text += name + ": " + value + "\r\n";
  text += "Content-Type: application/json\r\nConnection: close\r\nContent-Length: " +
          std::to_string(body.size()) + "\r\n\r\n" + body;
  if (write(text.data(), text.size()) < 0) return std::nullopt;
  // Closing with unread bytes would take the answer away from a client that is still sending.
  shutdown(socket_, SHUT_WR);
  const Clock::time_point deadline = After(kFarewellSeconds);
  do {
    received_.clear();
  } while (Clock::now() < deadline && Receive(deadline));
  return std::nullopt;
}

}  // namespace roomtex
