#include "core/local_server.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <mutex>
#include <random>
#include <thread>

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <httplib.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/command_line.h"
#include "core/error.h"

namespace roomtex {
namespace {
using std::chrono::milliseconds;
using testing::HasSubstr;
using testing::MatchesRegex;
using testing::Not;
using testing::StartsWith;

LocalServerOptions AnyPort() {
  LocalServerOptions options;
  options.port = 0;
  return options;
}

// Sends bytes as they are and gives what comes back until the server closes.
std::string SendRaw(int port, const std::string& bytes) {
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

// A server with one of everything.
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

TEST_F(ServedPage, IsServedUnderItsUrl) {
  EXPECT_THAT(server_->Url(), MatchesRegex("http://127\\.0\\.0\\.1:[0-9]+/[0-9a-f]{40}/"));
  EXPECT_THAT(server_->SshLine(), StartsWith("ssh -L " + std::to_string(port_) +
                                             ":127.0.0.1:" + std::to_string(port_) + " "));
  const auto answer = Client().Get(base_ + "/");
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, 200);
  EXPECT_EQ(answer->body, "<p>page</p>");
  EXPECT_EQ(answer->get_header_value("Content-Type"), "text/html");
  const auto bare = Client().Get(base_);
  ASSERT_TRUE(bare);
  EXPECT_EQ(bare->status, 308);
  EXPECT_EQ(bare->get_header_value("Location"), base_ + "/");
}

TEST_F(ServedPage, EveryServerHasATokenOfItsOwn) {
  LocalServer other(AnyPort());
  other.Start(false);
  EXPECT_NE(other.port(), port_);
  EXPECT_THAT(other.Url(), Not(HasSubstr(base_)));
}

TEST_F(ServedPage, NeedsTheToken) {
  std::string wrong = base_;
  wrong.back() = wrong.back() == '0' ? '1' : '0';
  for (const std::string& path : {std::string("/"), std::string("/sum"), wrong + "/", base_ + "0/",
                                  base_.substr(0, 20) + "/", std::string("//") + base_.substr(1)}) {
    EXPECT_EQ(GetStatus(path), 403) << path;
  }
  EXPECT_EQ(GetStatus("/", {{"Cookie", "token=" + base_.substr(1)}}), 403);
}

TEST_F(ServedPage, NamesThatAreNotOursAreRefused) {
  const std::string port = std::to_string(port_);
  for (const std::string& host : {"evil.example:" + port, std::string("evil.example"),
                                  "127.0.0.1.evil.example:" + port, std::string("127.0.0.1:1"),
                                  std::string("127.0.0.1"), "192.168.1.5:" + port, std::string()}) {
    EXPECT_EQ(GetStatus(base_ + "/", {{"Host", host}}), 403) << host;
  }
  for (const std::string& host : {"localhost:" + port, "[::1]:" + port, "LOCALHOST:" + port}) {
    EXPECT_EQ(GetStatus(base_ + "/", {{"Host", host}}), 200) << host;
  }
  EXPECT_THAT(SendRaw(port_, "GET " + base_ + "/ HTTP/1.1\r\nConnection: close\r\n\r\n"),
              StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(SendRaw(port_, "GET " + base_ + "/ HTTP/1.1\r\n" + HostLine() + HostLine() + "\r\n"),
              StartsWith("HTTP/1.1 400"));
}

TEST(LocalServer, FurtherNamesCanBeAllowed) {
  LocalServerOptions options = AnyPort();
  options.allowed_hosts = {"lab.example", "proxy.example:99"};
  LocalServer server(options);
  server.AddAsset("/", "text/html", "page");
  server.Start(false);
  const std::string path = server.Url().substr(server.Url().find('/', 7));
  httplib::Client client("127.0.0.1", server.port());
  const auto status = [&](const std::string& host) {
    const auto answer = client.Get(path, httplib::Headers{{"Host", host}});
    return answer ? answer->status : -1;
  };
  EXPECT_EQ(status("lab.example:" + std::to_string(server.port())), 200);
  EXPECT_EQ(status("proxy.example:99"), 200);
  EXPECT_EQ(status("proxy.example:" + std::to_string(server.port())), 403);
}

TEST_F(ServedPage, OtherSitesMayNotAsk) {
  for (const std::string& origin :
       {std::string("http://evil.example"), std::string("null"), std::string("http://127.0.0.1"),
        "https://127.0.0.1:" + std::to_string(port_), origin_ + "0"}) {
    EXPECT_EQ(GetStatus(base_ + "/", {{"Origin", origin}}), 403) << origin;
    EXPECT_EQ(PostStatus({{"Origin", origin}}), 403) << origin;
  }
  EXPECT_EQ(GetStatus(base_ + "/", {{"Origin", origin_}}), 200);
  EXPECT_EQ(num_posts_, 0);
}

TEST_F(ServedPage, ChangesNeedTheOrigin) {
  EXPECT_EQ(PostStatus({}), 403);
  EXPECT_EQ(PostStatus({{"Origin", ""}}), 403);
  const auto removed = Client().Delete(base_ + "/echo");
  ASSERT_TRUE(removed);
  EXPECT_EQ(removed->status, 403);
  EXPECT_EQ(num_posts_, 0);
  EXPECT_EQ(PostStatus({{"Origin", origin_}}), 200);
  EXPECT_EQ(Client().Delete(base_ + "/echo", httplib::Headers{{"Origin", origin_}})->body,
            "\"gone\"");
  EXPECT_EQ(num_posts_, 2);
}

TEST_F(ServedPage, NothingElseIsReachable) {
  for (const char* path :
       {"/../etc/passwd", "/../../../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd",
        "/..%2f..%2fetc%2fpasswd", "/%2Fetc%2Fpasswd", "//etc/passwd", "/etc/passwd",
        "/..\\..\\etc\\passwd", "/%00", "/%zz", "/sum/", "/sum/..", "/./", "/SUM"}) {
    const std::string with = SendRaw(
        port_, "GET " + base_ + path + " HTTP/1.1\r\n" + HostLine() + "Connection: close\r\n\r\n");
    EXPECT_THAT(with, StartsWith("HTTP/1.1 404")) << path;
    const std::string without = SendRaw(port_, std::string("GET ") + path + " HTTP/1.1\r\n" +
                                                   HostLine() + "Connection: close\r\n\r\n");
    EXPECT_THAT(without, StartsWith("HTTP/1.1 403")) << path;
    EXPECT_THAT(with + without, Not(HasSubstr("root:")));
  }
}

TEST_F(ServedPage, JsonGoesThereAndBack) {
  const auto sum = Client().Get(base_ + "/sum?a=19&b=%32%33");
  ASSERT_TRUE(sum);
  EXPECT_EQ(sum->status, 200);
  EXPECT_EQ(Json::parse(sum->body), (Json{{"sum", 42}}));
  EXPECT_EQ(sum->get_header_value("Content-Type"), "application/json");
  const Json json = {{"name",
                      "K\xc3\xbc"
                      "che \"1\""},
                     {"x", 1234.5},
                     {"list", {1, nullptr, true}}};
  const auto echo = Client().Post(base_ + "/echo", {{"Origin", origin_}}, json.dump(),
                                  "application/json; charset=utf-8");
  ASSERT_TRUE(echo);
  EXPECT_EQ(echo->status, 200);
  EXPECT_EQ(Json::parse(echo->body), json);
}

TEST_F(ServedPage, WhatIsNoJsonIsRefused) {
  const httplib::Headers ours = {{"Origin", origin_}};
  for (const std::string& body :
       {std::string("{"), std::string("{} x"), std::string("nul"), std::string("\"\xff\""),
        std::string(200, '['), std::string(100000, '[') + std::string(100000, ']')}) {
    EXPECT_EQ(PostStatus(ours, body), 400) << body.substr(0, 20);
  }
  EXPECT_EQ(PostStatus(ours, "{}", "text/plain"), 415);
  EXPECT_EQ(num_posts_, 0);
  EXPECT_EQ(PostStatus(ours, std::string(60, '[') + std::string(60, ']')), 200);
}

TEST_F(ServedPage, FailuresOfAHandlerBecomeASentence) {
  const std::map<std::string, std::pair<int, std::string>> kinds = {
      {"input", {422, "picks.csv: line 3: is odd. Make it even."}},
      {"usage", {422, "--a and --b do not go together"}},
      {"bytes", {422, "caf\xef\xbf\xbd.jpg: is odd."}},
      {"memory", {500, "out of memory"}},
      {"number", {500, "internal error of an unknown kind"}},
      {"other", {500, "internal error: surprise"}}};
  for (const auto& [kind, expected] : kinds) {
    const auto answer = Client().Post(base_ + "/fail", {{"Origin", origin_}},
                                      Json{{"kind", kind}}.dump(), "application/json");
    ASSERT_TRUE(answer) << kind;
    EXPECT_EQ(answer->status, expected.first) << kind;
    EXPECT_EQ(Json::parse(answer->body), (Json{{"error", expected.second}}));
  }
  EXPECT_EQ(GetStatus(base_ + "/sum?a=1"), 500);  // a handler's own bug
  EXPECT_EQ(GetStatus(base_ + "/sum?a=1&b=2"), 200);
}

TEST_F(ServedPage, WrongMethodsAreNamed) {
  const auto answer = Client().Get(base_ + "/echo");
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, 405);
  EXPECT_EQ(answer->get_header_value("Allow"), "DELETE, POST");
  const auto preflight = Client().Options(
      base_ + "/echo",
      {{"Origin", "http://evil.example"}, {"Access-Control-Request-Method", "POST"}});
  ASSERT_TRUE(preflight);
  EXPECT_EQ(preflight->status, 403);
  EXPECT_FALSE(preflight->has_header("Access-Control-Allow-Origin"));
}

TEST_F(ServedPage, LargeContentArrivesWholeAndIsNotSentTwice) {
  const auto tile = Client().Get(base_ + "/tile?x=1");
  ASSERT_TRUE(tile);
  EXPECT_EQ(tile->status, 200);
  EXPECT_EQ(tile->get_header_value("Content-Type"), "image/jpeg");
  EXPECT_EQ(tile->get_header_value_count("Cache-Control"), 1u);
  EXPECT_THAT(tile->get_header_value("Cache-Control"), HasSubstr("immutable"));
  EXPECT_TRUE(tile->body == *large_);
  const std::string etag = tile->get_header_value("ETag");
  EXPECT_EQ(etag, "\"tile-1\"");
  const auto again = Client().Get(base_ + "/tile?x=1", httplib::Headers{{"If-None-Match", etag}});
  ASSERT_TRUE(again);
  EXPECT_EQ(again->status, 304);
  EXPECT_EQ(again->body, "");
  EXPECT_EQ(GetStatus(base_ + "/tile?x=1", {{"If-None-Match", "\"tile-2\""}}), 200);
  EXPECT_EQ(GetStatus(base_ + "/tile?x=7"), 404);
  const auto head = Client().Head(base_ + "/tile?x=1");
  ASSERT_TRUE(head);
  EXPECT_EQ(head->get_header_value("Content-Length"), std::to_string(large_->size()));
}

TEST_F(ServedPage, EveryAnswerKeepsTheBrowserCareful) {
  const auto check = [](const httplib::Result& answer) {
    ASSERT_TRUE(answer);
    EXPECT_THAT(answer->get_header_value("Content-Security-Policy"),
                HasSubstr("default-src 'self'"));
    EXPECT_EQ(answer->get_header_value("X-Content-Type-Options"), "nosniff");
    EXPECT_EQ(answer->get_header_value("Referrer-Policy"), "no-referrer");
    EXPECT_EQ(answer->get_header_value("Cross-Origin-Opener-Policy"), "same-origin");
    EXPECT_EQ(answer->get_header_value("Cross-Origin-Resource-Policy"), "same-origin");
    EXPECT_EQ(answer->get_header_value("X-Frame-Options"), "DENY");
    EXPECT_EQ(answer->get_header_value("Cache-Control"), "no-store");
    EXPECT_FALSE(answer->has_header("Access-Control-Allow-Origin"));
  };
  check(Client().Get(base_ + "/"));
  check(Client().Get("/"));
  check(Client().Get(base_ + "/nothing"));
  check(Client().Post(base_ + "/echo", {{"Origin", origin_}}, std::string(2 << 20, 'x'),
                      "application/json"));
}

TEST_F(ServedPage, LargeBodiesAreRefusedBeforeTheyAreKept) {
  const httplib::Headers ours = {{"Origin", origin_}};
  const std::string most = '"' + std::string((1 << 20) - 2, 'x') + '"';
  EXPECT_EQ(PostStatus(ours, most), 200);
  EXPECT_EQ(PostStatus(ours, most + " "), 413);
  const std::string start = "POST " + base_ + "/echo HTTP/1.1\r\n" + HostLine() +
                            "Origin: " + origin_ + "\r\nContent-Type: application/json\r\n";
  EXPECT_THAT(SendRaw(port_, start + "Content-Length: 99999999999999999999\r\n\r\n"),
              StartsWith("HTTP/1.1 413"));
  EXPECT_THAT(SendRaw(port_, start + "Content-Length: -1\r\n\r\n"), StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(SendRaw(port_, start + "Content-Length: 2\r\nContent-Length: 3\r\n\r\n{}"),
              StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(SendRaw(port_, start + "Transfer-Encoding: chunked\r\n\r\n2\r\n{}\r\n0\r\n\r\n"),
              StartsWith("HTTP/1.1 411"));
  EXPECT_THAT(SendRaw(port_, start + "Content-Encoding: gzip\r\nContent-Length: 2\r\n\r\n{}"),
              StartsWith("HTTP/1.1 415"));
  EXPECT_EQ(num_posts_, 1);
}

TEST_F(ServedPage, LargeAndBrokenHeadersAreRefused) {
  const std::string start = "GET " + base_ + "/ HTTP/1.1\r\n" + HostLine();
  EXPECT_THAT(SendRaw(port_, std::string(100000, 'x')), StartsWith("HTTP/1.1 431"));
  EXPECT_THAT(SendRaw(port_, start + "X: " + std::string(20000, 'x') + "\r\n\r\n"),
              StartsWith("HTTP/1.1 431"));
  std::string many;
  for (int i = 0; i < 200; ++i) many += "X" + std::to_string(i) + ": y\r\n";
  EXPECT_THAT(SendRaw(port_, start + many + "\r\n"), StartsWith("HTTP/1.1 431"));
  for (const char* line : {"no colon\r\n", " folded: x\r\n", ": empty\r\n", "a b: x\r\n",
                           "X: a\x01"
                           "b\r\n",
                           "X: a\nHost: evil\r\n"}) {
    EXPECT_THAT(SendRaw(port_, start + line + "\r\n"), StartsWith("HTTP/1.1 400")) << line;
  }
  EXPECT_THAT(SendRaw(port_, "\r\n\r\n"), StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(SendRaw(port_, "NONSENSE / HTTP/1.1\r\nConnection: close\r\n\r\n"),
              StartsWith("HTTP/1.1 400"));
  EXPECT_EQ(SendRaw(port_, "GET / HT"), "");  // hung up in the middle
  EXPECT_EQ(GetStatus(base_ + "/"), 200);
}

TEST_F(ServedPage, TheBodyOfARefusedRequestIsNeverTakenForARequest) {
  const std::string inner = "GET " + base_ + "/sum?a=1&b=2 HTTP/1.1\r\n" + HostLine() + "\r\n";
  const std::string answer = SendRaw(
      port_, "POST / HTTP/1.1\r\n" + HostLine() +
                 "Origin: http://evil.example\r\nContent-Length: " + std::to_string(inner.size()) +
                 "\r\nConnection: close\r\n\r\n" + inner);
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(answer, Not(HasSubstr("HTTP/1.1 200")));
}

TEST_F(ServedPage, TextIsCompressedForThoseWhoTakeIt) {
  const std::string get = "GET " + base_ + "/sum?a=1&b=2 HTTP/1.1\r\n" + HostLine();
  const std::string close = "Connection: close\r\n\r\n";
  EXPECT_THAT(SendRaw(port_, get + "Accept-Encoding: br, gzip\r\n" + close),
              HasSubstr("Content-Encoding: gzip"));
  EXPECT_THAT(SendRaw(port_, get + "Accept-Encoding: br\r\n" + close), HasSubstr("{\"sum\":3}"));
}

TEST_F(ServedPage, NoBytesBringTheServerDown) {
  const std::string whole = "POST " + base_ + "/echo?a=%41&b HTTP/1.1\r\n" + HostLine() +
                            "Origin: " + origin_ +
                            "\r\nContent-Type: application/json\r\nContent-Length: 9\r\n"
                            "Accept-Encoding: gzip\r\nIf-None-Match: \"x\"\r\n\r\n{\"a\":[1]}";
  EXPECT_THAT(SendRaw(port_, whole), StartsWith("HTTP/1.1 200"));
  std::mt19937 random(1);
  for (int i = 0; i < 600; ++i) {
    std::string bytes = whole;
    const int num_changes = 1 + static_cast<int>(random() % 4);
    for (int k = 0; k < num_changes && !bytes.empty(); ++k) {
      const size_t at = random() % bytes.size();
      switch (random() % 4) {
        case 0:
          bytes[at] = static_cast<char>(random());
          break;
        case 1:
          bytes.erase(at, 1 + random() % 20);
          break;
        case 2:
          bytes.insert(at, bytes.substr(random() % bytes.size(), random() % 40));
          break;
        default:
          bytes.resize(at);
          break;
      }
    }
    const std::string answer = SendRaw(port_, bytes);
    EXPECT_THAT(answer, testing::AnyOf("", StartsWith("HTTP/1.1 ")));
  }
  EXPECT_EQ(GetStatus(base_ + "/"), 200);
}

TEST_F(ServedPage, OneConnectionTakesSeveralRequests) {
  const std::string get = "GET " + base_ + "/sum?a=1&b=2 HTTP/1.1\r\n" + HostLine();
  const std::string answer =
      SendRaw(port_, get + "\r\n" + get + "\r\n" + get + "Connection: close\r\n\r\n");
  size_t count = 0;
  for (size_t at = answer.find("{\"sum\":3}"); at != std::string::npos;
       at = answer.find("{\"sum\":3}", at + 1)) {
    ++count;
  }
  EXPECT_EQ(count, 3u);
}

TEST(LocalServer, SlowRequestsAreGivenUp) {
  LocalServerOptions options = AnyPort();
  options.request_seconds = 0.1;
  options.idle_seconds = 0.1;
  LocalServer server(options);
  server.Start(false);
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(server.port()));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  ASSERT_EQ(connect(socket, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  ASSERT_EQ(send(socket, "GET / HT", 8, 0), 8);
  char block[100] = "";
  ASSERT_GT(recv(socket, block, sizeof block - 1, 0), 0);
  EXPECT_THAT(block, StartsWith("HTTP/1.1 408"));
  close(socket);
}

// A handler that waits until the test lets it go.
class Gate {
 public:
  void Arrive() {
    std::unique_lock<std::mutex> lock(mutex_);
    ++num_waiting_;
    changed_.notify_all();
    changed_.wait(lock, [&] { return open_; });
  }
  // Whether so many wait at the same time, within 10 s.
  bool WaitFor(int count) {
    std::unique_lock<std::mutex> lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(10), [&] { return num_waiting_ >= count; });
  }
  void Open() {
    const std::lock_guard<std::mutex> lock(mutex_);
    open_ = true;
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  int num_waiting_ = 0;
  bool open_ = false;
};

TEST(LocalServer, RequestsAreAnsweredInParallelAndFinishedWhenStopping) {
  Gate gate;
  LocalServer server(AnyPort());
  server.AddJson("/wait", [&](const LocalServer::Query&) {
    gate.Arrive();
    return Json(server.stopping());
  });
  server.Start(false);
  const std::string url = server.Url();
  const std::string path = url.substr(url.find('/', 7)) + "wait";
  std::vector<std::thread> clients;
  std::atomic<int> num_right{0};
  for (int i = 0; i < 6; ++i) {
    clients.emplace_back([&] {
      httplib::Client client("127.0.0.1", server.port());
      const auto answer = client.Get(path);
      if (answer && answer->status == 200 && answer->body == "true") ++num_right;
    });
  }
  EXPECT_TRUE(gate.WaitFor(6));
  EXPECT_FALSE(server.stopping());
  server.RequestStop();
  std::atomic<bool> stopped{false};
  std::thread waiter([&] {
    server.Wait();
    stopped = true;
  });
  std::this_thread::sleep_for(milliseconds(50));
  EXPECT_FALSE(stopped);  // six answers are still to be given
  gate.Open();
  waiter.join();
  for (std::thread& client : clients) client.join();
  EXPECT_EQ(num_right, 6);
  EXPECT_FALSE(httplib::Client("127.0.0.1", server.port()).Get(path));
}

TEST(LocalServer, IdleConnectionsDoNotHoldUpTheStop) {
  LocalServer server(AnyPort());
  server.AddAsset("/", "text/html", "page");
  server.Start(false);
  httplib::Client client("127.0.0.1", server.port());
  client.set_keep_alive(true);
  ASSERT_TRUE(client.Get("/"));
  const auto begin = std::chrono::steady_clock::now();
  server.RequestStop();
  server.Wait();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, milliseconds(1000));
}

TEST(LocalServer, StopsFromAHandler) {
  LocalServer server(AnyPort());
  server.AddPost("/quit", [&](const Json&) {
    server.RequestStop();
    return Json("bye");
  });
  server.Start(false);
  const std::string origin = "http://127.0.0.1:" + std::to_string(server.port());
  const std::string path = server.Url().substr(origin.size()) + "quit";
  httplib::Client client("127.0.0.1", server.port());
  const auto answer = client.Post(path, {{"Origin", origin}}, "", "application/json");
  server.Wait();
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->body, "\"bye\"");
}

TEST(LocalServer, MayBeDestroyedWithoutAStart) { LocalServer server(AnyPort()); }

TEST(LocalServer, SignalsEndTheProcessCleanly) {
  for (const int signal : {SIGINT, SIGTERM}) {
    int ready[2];
    ASSERT_EQ(pipe(ready), 0);
    const pid_t child = fork();
    if (child == 0) {
      std::signal(SIGINT, SIG_DFL);
      LocalServer server(AnyPort());
      server.Start(true);
      if (write(ready[1], "x", 1) != 1) _exit(98);
      server.Wait();
      _exit(0);
    }
    close(ready[1]);
    char byte;
    EXPECT_EQ(read(ready[0], &byte, 1), 1);
    close(ready[0]);
    kill(child, signal);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  }
}

#define EXPECT_USAGE_ERROR(statement, text)                  \
  try {                                                      \
    statement;                                               \
    ADD_FAILURE() << "no UsageError from " #statement;       \
  } catch (const UsageError& error) {                        \
    EXPECT_THAT(std::string(error.what()), HasSubstr(text)); \
  }

TEST_F(ServedPage, TakenPortIsNamed) {
  LocalServerOptions options;
  options.port = port_;
  LocalServer second(options);
  EXPECT_USAGE_ERROR(second.Start(false),
                     "--port " + std::to_string(port_) + ": the port is taken on 127.0.0.1");
  server_.reset();
  LocalServer third(options);  // at once, without waiting for old connections
  third.Start(false);
  EXPECT_EQ(third.port(), port_);
}

TEST(LocalServer, RemoteHostsNeedAWord) {
  for (const char* host : {"0.0.0.0", "::", "192.0.2.7"}) {
    LocalServerOptions options = AnyPort();
    options.host = host;
    EXPECT_USAGE_ERROR(LocalServer server(options), "--allow_remote 1");
    options.allow_remote = true;
    EXPECT_TRUE(options.Problems().empty()) << host;
  }
  for (const char* host : {"127.0.0.1", "127.0.0.2", "localhost", "::1"}) {
    LocalServerOptions options;
    options.host = host;
    EXPECT_TRUE(options.Problems().empty()) << host;
  }
}

TEST(LocalServer, RemoteOneIsReachedByItsAddressesButNotByForeignNames) {
  LocalServerOptions options = AnyPort();
  options.host = "0.0.0.0";
  options.allow_remote = true;
  LocalServer server(options);
  server.AddAsset("/", "text/html", "page");
  server.Start(false);
  EXPECT_THAT(server.Url(), Not(HasSubstr("0.0.0.0")));
  EXPECT_THAT(server.SshLine(), HasSubstr(":127.0.0.1:"));
  const std::string path = server.Url().substr(server.Url().find('/', 7));
  const std::string port = ":" + std::to_string(server.port());
  const auto status = [&](const std::string& host) {
    httplib::Client client("127.0.0.1", server.port());
    const auto answer = client.Get(path, httplib::Headers{{"Host", host}});
    return answer ? answer->status : -1;
  };
  EXPECT_EQ(status("192.168.1.5" + port), 200);
  EXPECT_EQ(status("[fe80::1]" + port), 200);
  EXPECT_EQ(status("127.0.0.1" + port), 200);
  EXPECT_EQ(status(server.Url().substr(7, server.Url().find('/', 7) - 7)), 200);
  EXPECT_EQ(status("evil.example" + port), 403);
  EXPECT_EQ(status("192.168.1.5"), 403);
}

TEST(LocalServer, OptionsThatCannotBeMeantAreRefused) {
  LocalServerOptions options;
  options.host = "no such host";
  options.port = 70000;
  options.max_body_bytes = 0;
  options.num_threads = 0;
  options.idle_seconds = 0;
  EXPECT_EQ(options.Problems().size(), 5u);
  EXPECT_USAGE_ERROR(LocalServer server(options), "--port must be between 0");
}

TEST(LocalServer, OptionsOfACommandArriveAndTheHelpKnowsTheDefaults) {
  for (const bool help : {false, true}) {
    LocalServerOptions options;
    Command command("roomtex-test", "Serves.", "roomtex-test");
    AddLocalServerOptions(&options, &command);
    std::vector<std::string> words = {"roomtex-test",   "--host", "::1", "--port", "0",
                                      "--allow_remote", "--open", "1"};
    if (help) words = {"roomtex-test", "--help"};
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    testing::internal::CaptureStdout();
    EXPECT_EQ(
        command.Run(static_cast<int>(argv.size()), argv.data(), [](const Command::Context&) {}),
        kExitDone);
    const std::string out = testing::internal::GetCapturedStdout();
    if (help) {
      EXPECT_THAT(out, HasSubstr("127.0.0.1"));
      EXPECT_THAT(out, HasSubstr("8080"));
    } else {
      EXPECT_EQ(options.host, "::1");
      EXPECT_EQ(options.port, 0);
      EXPECT_TRUE(options.allow_remote);
      EXPECT_TRUE(options.open);
    }
  }
}

}  // namespace
}  // namespace roomtex
