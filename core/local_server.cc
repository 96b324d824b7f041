#include "core/local_server.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <exception>
#include <list>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include <netinet/tcp.h>
#include <poll.h>
#include <pwd.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/error.h"
#include "core/local_server_address.h"
#include "core/local_server_answers.h"
#include "core/local_server_connection.h"
#include "core/local_server_http.h"
#include "core/local_server_key.h"
#include "core/option_fields.h"
#include "core/resource_limits.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr size_t kMaxConnections = 128;  // open at a time

// A thread for each connection, or as many as the system gives; that many are served side by side.
struct Room {
  size_t threads = kMaxConnections;
  size_t PerAddress() const { return std::max<size_t>(1, 3 * threads / 8); }  // another computer's
  size_t Few() const { return threads / 4; }  // with more, each gets one answer
};

// The time does not tell how much is right.
bool EqualSecrets(const std::string& a, const std::string& b) {
  if (a.size() != b.size()) return false;
  unsigned difference = 0;
  for (size_t i = 0; i < a.size(); ++i) difference |= static_cast<unsigned>(a[i] ^ b[i]);
  return difference == 0;
}

// The descriptor that a signal makes readable; -1 = none.
std::atomic<int> signalled_fd{-1};

extern "C" void StopOnSignal(int) {
  const int saved = errno;
  const uint64_t one = 1;
  const int fd = signalled_fd;
  if (fd >= 0 && write(fd, &one, sizeof one) < 0) errno = saved;  // full means stopping already
  errno = saved;
}

}  // namespace

// The gate in front of httplib: it owns the sockets of the browsers, reads their requests within
// the limits and hands them on, each at a connection of its own, to httplib's server, which looks
// whether it may answer and routes. httplib alone bounds neither the time nor the header of a
// request, waits for idle connections when it stops, and hands out no socket by which one could.
struct LocalServer::Impl {
  using Route = httplib::Server::Handler;

  explicit Impl(const LocalServerOptions& server_options);
  ~Impl();

  void AddRoute(const std::string& method, const std::string& path, const Route& route);
  void AddBodyRoute(const std::string& method, const std::string& path,
                    std::function<Json(const Json&)> handler);
  int Listen();
  void Bind();
  void AllowHosts();
  void CatchSignals();
  void StartThreads();
  void Accept();
  struct Visitor;
  void Serve(int socket, Visitor* visitor);
  // Answers what may not be asked and what is not there; else it is left to the route.
  httplib::Server::HandlerResponse Check(const httplib::Request& request,
                                         httplib::Response& response) const;
  // Why the request may not be answered, or "".
  std::string Objection(const httplib::Request& request) const;
  bool IsAllowedHost(const std::string& host) const;
  void RequestStop();
  void Join();

  const LocalServerOptions options;
  const std::string token = options.token.empty() ? MakeToken() : options.token;
  const std::string run = MakeToken();  // tells this server from an earlier one of the same address
  int listen_fd = -1, stop_fd = -1, port = 0;
  LocalAddress address;
  std::vector<std::string> hosts;                       // "name:port", lower case
  std::map<std::string, std::set<std::string>> routes;  // methods by path
  HiddenHttp http;
  std::unique_ptr<Workers> pool;
  Room room;
  std::thread acceptor;
  std::atomic<size_t> num_connections{0};

  // Who is connected, the longest first. Known: has asked with the token. When there is no more
  // room, strangers go, the longest waiting first, so that no number of slow ones keeps a person
  // out.
  struct Visitor {
    int socket = -1;
    std::string address;
    bool known = false;
  };
  bool MakeRoom(const std::string& from_where);
  std::mutex starting;  // held until the acceptor may begin
  std::mutex visitors_mutex;
  std::list<Visitor> visitors;
  bool catches_signals = false;
  struct sigaction old_interrupt {
  }, old_terminate{};
};

LocalServer::Impl::Impl(const LocalServerOptions& server_options) : options(server_options) {
  ThrowIfProblems(options.Problems());
  stop_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (stop_fd < 0) throw std::runtime_error(std::string("eventfd: ") + std::strerror(errno));
  const auto to_time = [](double seconds) { return static_cast<time_t>(std::ceil(seconds)); };
  http.server()
      .set_default_headers(SafetyHeaders())
      .set_payload_max_length(static_cast<size_t>(options.max_body_bytes))
      .set_read_timeout(to_time(options.request_seconds))
      // The gate gives up a browser that takes nothing before httplib gives up the gate.
      .set_write_timeout(2 * to_time(options.stall_seconds))
      .set_pre_routing_handler(
          [this](const httplib::Request& request, httplib::Response& response) {
            return Check(request, response);
          })
      .set_exception_handler(
          [](const httplib::Request&, httplib::Response& response,
             const std::exception_ptr& thrown) { SetException(response, thrown); });
}

LocalServer::Impl::~Impl() {
  RequestStop();
  Join();
  close(stop_fd);
}

void LocalServer::Impl::AddRoute(const std::string& method, const std::string& path,
                                 const Route& route) {
  if (path.empty() || path[0] != '/') throw std::logic_error("a path begins with /: " + path);
  if (acceptor.joinable()) throw std::logic_error("the server runs already: " + path);
  if (!routes[path].insert(method).second) {
    throw std::logic_error("the path is added twice: " + method + " " + path);
  }
  const std::string pattern = Literally("/" + token + path);
  if (method == "GET") http.server().Get(pattern, route);
  if (method == "POST") http.server().Post(pattern, route);
  if (method == "PUT") http.server().Put(pattern, route);
  if (method == "DELETE") http.server().Delete(pattern, route);
}

void LocalServer::Impl::AddBodyRoute(const std::string& method, const std::string& path,
                                     std::function<Json(const Json&)> handler) {
  AddRoute(method, path, [handler](const httplib::Request& request, httplib::Response& response) {
    const std::optional<Json> body = ParseBody(request.body);
    if (!body) return SetError(response, 400, "The request is not JSON that can be read.");
    SetJson(response, 200, Dump(handler(*body)));
  });
}

// The error number, 0 if the socket listens at `address`.
int LocalServer::Impl::Listen() {
  listen_fd = ::socket(address.storage.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  // SO_REUSEPORT, httplib's default, would let two servers share a port.
  const int yes = 1;
  setsockopt(listen_fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  if (listen_fd >= 0 && bind(listen_fd, address.get(), address.size) == 0 &&
      ::listen(listen_fd, 64) == 0) {
    return 0;
  }
  const int error = errno;
  if (listen_fd >= 0) close(std::exchange(listen_fd, -1));
  return error;
}

void LocalServer::Impl::Bind() {
  address = ResolveHost(options.host).value();
  address.set_port(options.port);
  int error = Listen();
  if (error == EADDRINUSE && options.port_may_differ && options.port == LocalServerOptions().port) {
    address.set_port(0);
    error = Listen();
  }
  if (error != 0) {
    const std::string port_text = "--port " + std::to_string(options.port) + ": ";
    if (error == EADDRINUSE) {
      throw UsageError(port_text + "the port is taken on " + options.host +
                       ", perhaps by another roomtex; give another one, or 0 for any free one");
    }
    if (error == EACCES) {
      throw UsageError(port_text + "this user may not use the port; give one above 1023, or 0");
    }
    throw UsageError("--host " + options.host + ", " + port_text + std::strerror(error));
  }
  LocalAddress bound;
  bound.size = sizeof bound.storage;
  getsockname(listen_fd, bound.get(), &bound.size);
  port = bound.port();
}

void LocalServer::Impl::AllowHosts() {
  std::vector<std::string> names = {"127.0.0.1", "localhost", "[::1]", address.Text()};
  if (LowerCase(options.host).find_first_not_of("0123456789abcdef:.") != std::string::npos) {
    names.push_back(options.host);
  }
  if (!address.IsLoopback()) names.push_back(HostName());
  const std::string suffix = ":" + std::to_string(port);
  for (const std::string& name : names) {
    hosts.push_back(LowerCase(name + suffix));
    if (port == 80) hosts.push_back(LowerCase(name));  // browsers leave out 80
  }
}

bool LocalServer::Impl::IsAllowedHost(const std::string& host) const {
  if (std::find(hosts.begin(), hosts.end(), LowerCase(host)) != hosts.end()) return true;
  // Rebinding needs a name: where others may come in, every address of ours is good.
  const size_t colon = host.rfind(':');
  return !address.IsLoopback() && colon != std::string::npos &&
         host.substr(colon + 1) == std::to_string(port) && IsAddressLiteral(host.substr(0, colon));
}

void LocalServer::Impl::CatchSignals() {
  signalled_fd = stop_fd;
  struct sigaction action {};
  action.sa_handler = StopOnSignal;
  action.sa_flags = SA_RESTART | static_cast<int>(SA_RESETHAND);  // the second one kills
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, &old_interrupt);
  sigaction(SIGTERM, &action, &old_terminate);
  // What the shell had ignored, e.g. for a job in the background, stays ignored.
  if (old_interrupt.sa_handler == SIG_IGN) sigaction(SIGINT, &old_interrupt, nullptr);
  if (old_terminate.sa_handler == SIG_IGN) sigaction(SIGTERM, &old_terminate, nullptr);
  catches_signals = true;
}

void LocalServer::Impl::RequestStop() {
  const uint64_t one = 1;
  // Never read, so that it wakes everyone; a full counter is a stop as well.
  if (::write(stop_fd, &one, sizeof one) < 0) return;
}

void LocalServer::Impl::Accept() {
  while (true) {
    pollfd fds[2] = {{listen_fd, POLLIN, 0}, {stop_fd, POLLIN, 0}};
    if (poll(fds, 2, -1) < 0 && errno != EINTR) break;
    if (fds[1].revents != 0) break;
    if (fds[0].revents == 0) continue;
    sockaddr_storage from{};
    socklen_t size = sizeof from;
    const int socket =
        accept4(listen_fd, reinterpret_cast<sockaddr*>(&from), &size, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (socket < 0) {
      // Out of descriptors: the connection stays in line, some of ours will end.
      if (errno != EINTR && errno != EAGAIN) IsReadable(stop_fd, 50);
      continue;
    }
    const int yes = 1;
    setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    LocalAddress visitor;
    visitor.storage = from;
    visitor.size = size;
    const std::string from_where = visitor.IsLoopback() ? "" : visitor.Text();
    if (!MakeRoom(from_where)) {
      close(socket);
      continue;
    }
    ++num_connections;
    const auto place = [&] {
      const std::lock_guard<std::mutex> lock(visitors_mutex);
      return visitors.insert(visitors.end(), {socket, from_where, false});
    }();
    pool->enqueue([this, socket, place] {
      Serve(socket, &*place);
      --num_connections;
      const std::lock_guard<std::mutex> lock(visitors_mutex);
      visitors.erase(place);
    });
  }
  close(std::exchange(listen_fd, -1));
}

void LocalServer::Impl::StartThreads() {
  const std::lock_guard<std::mutex> lock(starting);
  acceptor = StartThread([this] {
    starting.lock();  // until there are threads to give visitors to
    starting.unlock();
    Accept();
  });
  try {
    pool = std::make_unique<Workers>(kMaxConnections);
  } catch (const std::system_error&) {
    RequestStop();  // before it accepts anything
    throw;
  }
  room.threads = pool->count();
}

// False if there is none: all are known, and enough of them wait for a thread.
bool LocalServer::Impl::MakeRoom(const std::string& from_where) {
  const std::lock_guard<std::mutex> lock(visitors_mutex);
  const auto is_of_address = [&](const Visitor& one) { return one.address == from_where; };
  const auto num_of_address = std::count_if(visitors.begin(), visitors.end(), is_of_address);
  const bool crowds =
      !from_where.empty() && static_cast<size_t>(num_of_address) >= room.PerAddress();
  if (!crowds && visitors.size() < room.threads) return true;
  for (Visitor& one : visitors) {
    if (one.known || one.socket < 0 || (crowds && !is_of_address(one))) continue;
    shutdown(one.socket, SHUT_RDWR);  // its thread sees the end
    one.socket = -1;
    return true;
  }
  return !crowds && visitors.size() < kMaxConnections;
}

void LocalServer::Impl::Serve(int socket, Visitor* visitor) {
  LocalConnection connection(socket, stop_fd, options);
  const auto meet = [&](const LocalRequest& request) {
    const size_t path = request.head.find(" /") + 2;
    if (!EqualSecrets(request.head.substr(path, token.size()), token)) return;
    const std::lock_guard<std::mutex> lock(visitors_mutex);
    visitor->known = true;
  };
  // Before the descriptor is closed, and may be another's.
  const auto leave = [&] {
    const std::lock_guard<std::mutex> lock(visitors_mutex);
    visitor->socket = -1;
  };
  try {
    for (int count = 1; count <= kMaxRequests; ++count) {
      const std::optional<LocalRequest> request = connection.NextRequest();
      if (!request) return leave();
      meet(*request);
      // Nobody waits for a thread while this one waits for a browser's next wish.
      const bool is_last = count == kMaxRequests || request->wants_close || IsReadable(stop_fd) ||
                           num_connections > room.Few();
      const LocalSocket to_http = http.Connect();
      if (to_http.get() < 0) return leave();
      if (!connection.Relay(*request, is_last, to_http) || is_last) return leave();
    }
    leave();
  } catch (const std::exception&) {
    leave();
    // Out of memory while reading or answering: this connection ends, the server does not.
  }
}

std::string LocalServer::Impl::Objection(const httplib::Request& request) const {
  const std::string host = request.get_header_value("Host");
  if (!IsAllowedHost(host)) {
    return "This server is not reached under the name \"" + host + "\"; use " + hosts.back() + ".";
  }
  const bool changes = request.method != "GET" && request.method != "HEAD";
  if (request.has_header("Origin")) {
    if (LowerCase(request.get_header_value("Origin")) != "http://" + LowerCase(host)) {
      return "Pages of other sites may not use this server.";
    }
  } else if (changes) {
    return "A request that changes something must say which page it comes from (Origin).";
  }
  const std::string given = request.path.substr(0, token.size() + 1);
  const bool ends = request.path.size() == given.size() || request.path[given.size()] == '/';
  if (!EqualSecrets(given, "/" + token) || !ends) {
    return kLacksToken;
  }
  return "";
}

httplib::Server::HandlerResponse LocalServer::Impl::Check(const httplib::Request& request,
                                                          httplib::Response& response) const {
  const auto refuse = [&](int status, const std::string& sentence) {
    SetError(response, status, sentence);
    return httplib::Server::HandlerResponse::Handled;
  };
  const std::string objection = Objection(request);
  if (!objection.empty()) {
    const bool is_person =
        objection == kLacksToken && request.method == "GET" &&
        request.get_header_value("Accept").find("text/html") != std::string::npos;
    if (is_person) {
      response.status = 403;
      response.set_content(RefusalPage(), "text/html; charset=utf-8");
      return httplib::Server::HandlerResponse::Handled;
    }
    return refuse(403, objection);
  }
  const std::string path = request.path.substr(token.size() + 1);
  if (path.empty()) {  // the page's relative URLs need the slash
    response.set_header("Location", "/" + token + "/");
    return refuse(308, "The address ends with a slash.");
  }
  const auto found = routes.find(path);
  if (found == routes.end()) return refuse(404, "There is nothing at this address.");
  const std::set<std::string>& methods = found->second;
  if (methods.count(request.method == "HEAD" ? "GET" : request.method) == 0) {
    std::string allowed;
    for (const std::string& method : methods) allowed += (allowed.empty() ? "" : ", ") + method;
    response.set_header("Allow", allowed);
    return refuse(405, "This address does not take " + request.method + ".");
  }
  const bool reads_body = request.method != "GET" && request.method != "HEAD";
  if (reads_body && request.get_header_value("Content-Length") != "0" && !IsJson(request)) {
    return refuse(415, "The request must be application/json.");
  }
  return httplib::Server::HandlerResponse::Unhandled;
}

void LocalServer::Impl::Join() {
  if (acceptor.joinable()) acceptor.join();
  if (pool) pool->shutdown();
  pool.reset();
  http.Stop();
  if (std::exchange(catches_signals, false)) {
    sigaction(SIGINT, &old_interrupt, nullptr);
    sigaction(SIGTERM, &old_terminate, nullptr);
    signalled_fd = -1;
  }
}

LocalServer::LocalServer(const LocalServerOptions& options)
    : impl_(std::make_unique<Impl>(options)) {}
LocalServer::~LocalServer() = default;

void LocalServer::AddAsset(const std::string& path, const std::string& type, std::string bytes) {
  impl_->AddRoute("GET", path,
                  [type, text = std::make_shared<const std::string>(std::move(bytes))](
                      const httplib::Request&, httplib::Response& response) {
                    response.status = 200;
                    response.set_content(*text, type);
                  });
}

void LocalServer::AddJson(const std::string& path, std::function<Json(const Query&)> handler) {
  impl_->AddRoute("GET", path,
                  [handler](const httplib::Request& request, httplib::Response& response) {
                    SetJson(response, 200, Dump(handler(QueryOf(request))));
                  });
}

void LocalServer::AddContent(const std::string& path,
                             std::function<std::optional<Content>(const Query&)> handler) {
  impl_->AddRoute(
      "GET", path,
      [handler, impl = impl_.get()](const httplib::Request& request, httplib::Response& response) {
        std::optional<Content> content = handler(QueryOf(request));
        if (!content) {
          return SetError(response, 404, "There is nothing at this address.");
        }
        if (content->immutable && !impl->options.token.empty()) {
          // The browser may have what an earlier server had there.
          content->immutable = false;
          if (content->etag.empty()) content->etag = impl->run;
        }
        SetContent(request, *content, response);
      });
}

void LocalServer::AddPost(const std::string& path, std::function<Json(const Json&)> handler) {
  impl_->AddBodyRoute("POST", path, std::move(handler));
}
void LocalServer::AddPut(const std::string& path, std::function<Json(const Json&)> handler) {
  impl_->AddBodyRoute("PUT", path, std::move(handler));
}
void LocalServer::AddDelete(const std::string& path, std::function<Json(const Json&)> handler) {
  impl_->AddBodyRoute("DELETE", path, std::move(handler));
}

void LocalServer::Start(bool stop_on_signals) {
  if (impl_->port != 0) throw std::logic_error("the server was started already");
  impl_->Bind();
  impl_->AllowHosts();
  if (stop_on_signals) impl_->CatchSignals();
  impl_->http.Start(impl_->options.num_threads);
  impl_->StartThreads();
}

void LocalServer::Wait() {
  while (!IsReadable(impl_->stop_fd, 1000000)) {
  }
  impl_->Join();
}

void LocalServer::RequestStop() { impl_->RequestStop(); }
bool LocalServer::stopping() const { return IsReadable(impl_->stop_fd); }
int LocalServer::port() const { return impl_->port; }

std::string LocalServer::Url() const {
  const std::string host = impl_->address.IsAny() ? HostName() : impl_->address.Text();
  return "http://" + host + ":" + std::to_string(impl_->port) + "/" + impl_->token + "/";
}

std::string LocalServer::SshLine() const {
  const passwd* user = getpwuid(geteuid());
  const std::string host = impl_->address.IsAny() ? "127.0.0.1" : impl_->address.Text();
  const std::string number = std::to_string(impl_->port);
  return "ssh -L " + number + ":" + host + ":" + number + " " +
         (user != nullptr ? std::string(user->pw_name) + "@" : "") + HostName();
}

void LocalServerOptions::Declare(OptionFields* fields) {
  fields->Text("host", &host,
               "Address to serve on; one that other computers reach needs --allow_remote 1.");
  fields->Int("port", &port, "Port to serve on; 0 = any free one.")
      .Within(0, 65535)
      .Says("must be between 0 (any free one) and 65535");
  fields->Bool("allow_remote", &allow_remote,
               "Let other computers in that know the address with its token. Nothing is "
               "encrypted: prefer ssh -L.");
  fields->Bool("open", &open, "Open the page in the browser.");

  fields->Int("max_body_bytes", &max_body_bytes, "Largest request.").Positive().Internal();
  fields->Int("max_header_bytes", &max_header_bytes, "Largest header.").Positive().Internal();
  fields->Int("num_threads", &num_threads, "Requests answered side by side.").Positive().Internal();
  const std::string seconds = "request_seconds, idle_seconds and stall_seconds must be positive";
  fields->Number("request_seconds", &request_seconds, "For a request to arrive.")
      .Positive()
      .SaysSentence(seconds)
      .Internal();
  fields->Number("idle_seconds", &idle_seconds, "For a connection without a request.")
      .Positive()
      .SaysSentence(seconds)
      .Internal();
  fields->Number("stall_seconds", &stall_seconds, "For an answer of which nothing is taken.")
      .Positive()
      .SaysSentence(seconds)
      .Internal();
}

std::vector<std::string> LocalServerOptions::Problems() const {
  std::vector<std::string> problems;
  const std::optional<LocalAddress> address = ResolveHost(host);
  if (!address) {
    problems.push_back("--host is \"" + host + "\", which is no address of this machine; give " +
                       LocalServerOptions().host);
  } else if (!address->IsLoopback() && !allow_remote) {
    problems.push_back("--host " + host +
                       " lets other computers in; say --allow_remote 1 if that is meant, or keep " +
                       LocalServerOptions().host + " and use ssh -L");
  }
  AppendProblems(ProblemsOf(*this), &problems);
  return problems;
}

void LetPortDiffer(int argc, char** argv, LocalServerOptions* options) {
  options->port_may_differ = std::none_of(argv, argv + argc, [](const char* text) {
    return std::string_view(text).substr(0, 6) == "--port";
  });
}

}  // namespace roomtex
