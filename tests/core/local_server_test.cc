#include "core/local_server.h"

#include <chrono>
#include <random>
#include <thread>

#include <gmock/gmock.h>

#include "core/command_line.h"
#include "core/local_server_key.h"
#include "tests/core/served_page.h"

namespace roomtex {
namespace {
using testing::HasSubstr;
using testing::MatchesRegex;
using testing::Not;
using testing::StartsWith;

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

TEST_F(ServedPage, TellsAPersonWithALinkOfAnEarlierRunWhatToDo) {
  const httplib::Headers browser = {{"Accept", "text/html,application/xhtml+xml,*/*;q=0.8"}};
  const auto answer = Client().Get("/0123456789012345678901234567890123456789/", browser);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, 403);
  EXPECT_THAT(answer->get_header_value("Content-Type"), StartsWith("text/html"));
  EXPECT_THAT(answer->body, HasSubstr("Start the command again"));
  EXPECT_THAT(answer->body, Not(HasSubstr(base_.substr(1))));
  const auto program = Client().Get("/0123/");
  ASSERT_TRUE(program);
  EXPECT_THAT(program->get_header_value("Content-Type"), HasSubstr("json"));
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
  // httplib ends a line at a line feed.
  EXPECT_THAT(SendRaw(port_, "GET " + base_ + "/ HTTP/1.1\n" + HostLine() + "\r\n"),
              StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(SendRaw(port_, "GET " + base_ + "/ HTTP/1.1\r\n" + HostLine() + HostLine() + "\r\n"),
              StartsWith("HTTP/1.1 400"));
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

// The next server at the same address may have something else there.
TEST_F(ServedPage, WhatOutlivesTheServerIsAskedForAgain) {
  LocalServerOptions options = AnyPort();
  options.token = MakeToken();
  std::string etag;
  for (int run = 0; run < 2; ++run) {
    Start(options);
    const auto piece = Client().Get(base_ + "/piece", httplib::Headers{{"If-None-Match", etag}});
    ASSERT_TRUE(piece);
    EXPECT_EQ(piece->status, 200);
    EXPECT_TRUE(piece->body == *large_);
    EXPECT_EQ(piece->get_header_value("Cache-Control"), "private, no-cache");
    EXPECT_NE(piece->get_header_value("ETag"), etag);
    etag = piece->get_header_value("ETag");
    EXPECT_EQ(GetStatus(base_ + "/piece", {{"If-None-Match", etag}}), 304);
  }
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

// Answers with and without a body, bodies that nobody reads: each ends where the next begins.
TEST_F(ServedPage, AnswersOfOneConnectionDoNotRunIntoEachOther) {
  const auto request = [&](const std::string& line, const std::string& fields,
                           const std::string& body) {
    return line + " HTTP/1.1\r\n" + HostLine() + fields +
           "Content-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body;
  };
  const std::string sum = "GET " + base_ + "/sum?a=1&b=2", tile = base_ + "/tile?x=1";
  const std::string json = "Content-Type: application/json\r\n";
  const std::string large(1 << 19, 'x');
  const std::string answer = SendRaw(
      port_, request("HEAD " + tile, "", "") + request(sum, "", large) +
                 request("GET " + tile, "If-None-Match: \"tile-1\"\r\n", "") +
                 request(sum, "", "") +
                 request("POST " + base_ + "/echo", json, request(sum, "", "") + large) +
                 request("POST " + base_ + "/echo", "Origin: " + origin_ + "\r\n" + json, "[4]") +
                 request(sum, "Connection: close\r\n", ""));
  std::string statuses;
  for (size_t at = answer.find("HTTP/1.1 "); at != std::string::npos;
       at = answer.find("HTTP/1.1 ", at + 1)) {
    statuses += answer.substr(at + 9, 3) + " ";
  }
  EXPECT_EQ(statuses, "200 200 304 200 403 200 200 ");
  EXPECT_THAT(answer, HasSubstr("\r\n\r\n[4]HTTP/1.1 200"));
  EXPECT_THAT(answer, HasSubstr("Keep-Alive: timeout=10, max=1000"));
  EXPECT_EQ(num_posts_, 1);
}

}  // namespace
}  // namespace roomtex
