// How a local server starts and stops, who may reach it, and its options.

#include <chrono>
#include <condition_variable>
#include <csignal>
#include <mutex>
#include <thread>

#include <gmock/gmock.h>
#include <sys/wait.h>

#include "core/command_line.h"
#include "core/local_server.h"
#include "core/option_fields.h"
#include "tests/core/served_page.h"

namespace roomtex {
namespace {
using std::chrono::milliseconds;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

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

TEST(LocalServerPort, GivesWayOnlyWhenNobodyAskedForIt) {
  const auto given = [](std::vector<const char*> line) {
    LocalServerOptions options;
    LetPortDiffer(static_cast<int>(line.size()), const_cast<char**>(line.data()), &options);
    return !options.port_may_differ;
  };
  EXPECT_FALSE(given({"roomtex-view", "--input_path", "x"}));
  EXPECT_TRUE(given({"roomtex-view", "--port", "8080"}));
  EXPECT_TRUE(given({"roomtex-view", "--port=8080"}));
  LocalServerOptions options;
  options.port_may_differ = true;
  LocalServer first(options), second(options);
  first.Start(false);
  second.Start(false);
  EXPECT_NE(first.port(), second.port());
  EXPECT_NE(second.port(), options.port);
  EXPECT_THAT(second.Url(), HasSubstr(":" + std::to_string(second.port()) + "/"));
  options.port = first.port() == options.port ? second.port() : first.port();
  LocalServer third(options);  // not the default, so somebody asked for it: in a file, say
  EXPECT_USAGE_ERROR(third.Start(false), "is taken");
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
    command.Add(FieldsOf(&options));
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
