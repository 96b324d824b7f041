#include "core/local_server_connection.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <utility>

#include <poll.h>
#include <sys/socket.h>

#include "core/text.h"

namespace roomtex {
namespace {
using Clock = std::chrono::steady_clock;

constexpr int kMaxFields = 100;         // header lines of a request
constexpr double kFarewellSeconds = 2;  // for the last bytes when stopping or refusing
constexpr double kHeaderSeconds = 5;    // from its first byte; browsers send it at once
constexpr size_t kReadBytes = size_t{1} << 16;
const char kHeadEnd[] = "\r\n\r\n";
const std::array<const char*, 6> kUsedFields = {"host",          "origin",          "content-type",
                                                "if-none-match", "accept-encoding", "accept"};
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

// A GET has no body that anybody would read. What of the body is not taken (the request was
// answered without it) is no failure.
void SendRequest(const LocalRequest& request, int http) {
  const bool has_body = !BeginsWith(request.head, "GET ") && !BeginsWith(request.head, "HEAD ");
  const std::string_view body = has_body ? std::string_view(request.body) : "";
  const std::string text = request.head + "content-length: " + std::to_string(body.size()) +
                           kHeadEnd + std::string(body);
  size_t sent = 0;
  while (sent < text.size()) {
    const ssize_t count = send(http, text.data() + sent, text.size() - sent, MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return;
    sent += static_cast<size_t>(count);
  }
}

bool EndsWith(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

// What follows the head of httplib's answer.
size_t BodyBytes(const std::string& head, const LocalRequest& request) {
  const std::string field = "\r\nContent-Length: ";
  const size_t begin = head.find(field);
  if (begin == std::string::npos || BeginsWith(request.head, "HEAD ")) return 0;
  return static_cast<size_t>(std::strtoull(head.c_str() + begin + field.size(), nullptr, 10));
}

// False at the end.
bool AppendFrom(int http, std::string* answer) {
  char block[kReadBytes];
  ssize_t size = -1;
  do {
    size = recv(http, block, sizeof block, 0);
  } while (size < 0 && errno == EINTR);
  if (size > 0) answer->append(block, static_cast<size_t>(size));
  return size > 0;
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
std::string ErrorText(const std::string& sentence) {
  return Json{{"error", sentence}}.dump(-1, ' ', false, Json::error_handler_t::replace);
}
bool IsReadable(int fd, int milliseconds) {
  pollfd poll_fd{fd, POLLIN, 0};
  return poll(&poll_fd, 1, milliseconds) > 0;
}

bool LocalConnection::Receive(Clock::time_point deadline) {
  while (true) {
    pollfd fds[2] = {{browser_.get(), POLLIN, 0}, {stop_fd_, POLLIN, 0}};
    const int ready = poll(fds, 2, MillisecondsTo(deadline));
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0 || fds[1].revents != 0) return false;
    char block[kReadBytes];
    const ssize_t size = recv(browser_.get(), block, sizeof block, MSG_DONTWAIT);
    if (size < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (size <= 0) return false;
    received_.append(block, static_cast<size_t>(size));
    return true;
  }
}

std::optional<LocalRequest> LocalConnection::NextRequest() {
  if (received_.empty() && !Receive(After(options_.idle_seconds))) return std::nullopt;
  const Clock::time_point deadline = After(options_.request_seconds);
  const Clock::time_point head_deadline = After(std::min(options_.request_seconds, kHeaderSeconds));
  const auto late = [&] { return Clock::now() >= deadline; };
  const auto head_late = [&] { return Clock::now() >= head_deadline; };
  const size_t max_head = static_cast<size_t>(options_.max_header_bytes);
  size_t end = received_.find(kHeadEnd);
  for (; end == std::string::npos; end = received_.find(kHeadEnd)) {
    if (received_.size() > max_head) return Refuse(431);
    if (head_late() || !Receive(head_deadline)) return head_late() ? Refuse(408) : std::nullopt;
  }
  if (end > max_head) return Refuse(431);
  const std::string head = received_.substr(0, end + 2);
  received_.erase(0, end + 4);
  LocalRequest request;
  if (const int status = ParseHead(head, &request)) return Refuse(status);
  if (expects_continue_ && received_.size() < content_length_) {
    Send("HTTP/1.1 100 Continue\r\n\r\n");
  }
  while (received_.size() < content_length_) {
    if (late() || !Receive(deadline)) return late() ? Refuse(408) : std::nullopt;
  }
  request.body = received_.substr(0, content_length_);
  received_.erase(0, content_length_);
  return request;
}

int LocalConnection::ParseHead(const std::string& head, LocalRequest* request) {
  std::map<std::string, std::string> fields;
  size_t begin = head.find("\r\n") + 2;
  const std::string request_line = head.substr(0, begin);
  // httplib ends a line at a line feed alone: what followed it would be a field that nobody
  // checked.
  const auto is_plain = [](unsigned char c) { return c >= ' ' && c < 127; };
  if (!std::all_of(head.begin(), head.begin() + static_cast<long>(begin) - 2, is_plain)) return 400;
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
  request->wants_close = LowerCase(fields["connection"]).find("close") != std::string::npos ||
                         EndsWith(request_line, " HTTP/1.0\r\n");
  request->head = request_line;
  for (const char* name : kUsedFields) {
    const auto field = fields.find(name);
    if (field == fields.end()) continue;
    // gzip or nothing: httplib's brotli takes seconds for a script.
    const bool is_encoding = field->first == "accept-encoding";
    if (is_encoding && field->second.find("gzip") == std::string::npos) continue;
    request->head += field->first + ": " + (is_encoding ? "gzip" : field->second) + "\r\n";
  }
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

bool LocalConnection::Send(std::string_view bytes) const {
  Clock::time_point deadline = After(options_.stall_seconds);
  Clock::time_point farewell = Clock::time_point::max();
  while (!bytes.empty()) {
    const ssize_t count =
        send(browser_.get(), bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    if (count > 0) {
      bytes.remove_prefix(static_cast<size_t>(count));
      deadline = After(options_.stall_seconds);
      continue;
    }
    if (count < 0 && errno != EAGAIN && errno != EINTR) return false;
    if (IsReadable(stop_fd_)) farewell = std::min(farewell, After(kFarewellSeconds));
    if (Clock::now() >= std::min(deadline, farewell)) return false;
    pollfd poll_fd{browser_.get(), POLLOUT, 0};
    poll(&poll_fd, 1, std::min(100, MillisecondsTo(deadline)));
  }
  return true;
}

bool LocalConnection::Relay(const LocalRequest& request, bool is_last,
                            const LocalSocket& http) const {
  SendRequest(request, http.get());
  std::string answer;
  size_t end = std::string::npos;
  while ((end = answer.find(kHeadEnd)) == std::string::npos) {
    if (!AppendFrom(http.get(), &answer)) return false;
  }
  std::string head = answer.substr(0, end);
  answer.erase(0, end + std::strlen(kHeadEnd));
  size_t left = BodyBytes(head, request);
  // httplib's connection ends with this answer, the browser's may stay.
  const std::string closes = "\r\nConnection: close";
  const size_t field = head.find(closes);
  if (field != std::string::npos && !is_last) {
    const int seconds = std::max(1, static_cast<int>(options_.idle_seconds));
    head.replace(field, closes.size(),
                 "\r\nKeep-Alive: timeout=" + std::to_string(seconds) +
                     ", max=" + std::to_string(kMaxRequests));
  }
  answer.insert(0, head + kHeadEnd);
  left += head.size() + std::strlen(kHeadEnd);
  while (true) {
    if (answer.size() > left || !Send(answer)) return false;
    left -= answer.size();
    if (left == 0) return true;
    answer.clear();
    if (!AppendFrom(http.get(), &answer)) return false;
  }
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
  if (!Send(text)) return std::nullopt;
  // Closing with unread bytes would take the answer away from a client that is still sending.
  shutdown(browser_.get(), SHUT_WR);
  const Clock::time_point deadline = After(kFarewellSeconds);
  do {
    received_.clear();
  } while (Clock::now() < deadline && Receive(deadline));
  return std::nullopt;
}

}  // namespace roomtex
