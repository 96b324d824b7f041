// roomtex-pick as a user runs it.

#include <chrono>
#include <csignal>
#include <filesystem>
#include <thread>

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>

#include "tests/align/pick/pick_page.h"
#include "tests/support/folders.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

extern char** environ;

namespace roomtex {
namespace {

using testing::HasSubstr;
using testing::MatchesRegex;
using testing::StartsWith;

std::string Options(const std::string& picks_path) {
  const PickSceneInput input = ThePickRoom().input();
  return "--input_path " + input.input_paths[0] + " --image_path " + input.image_path +
         " --scan_path " + input.scan_paths[0] + " --output_path " + picks_path;
}

// The command in the background; ended at the latest with this.
class Running {
 public:
  Running(const std::string& options, const std::string& folder) : folder_(folder) {
    const std::string line = "exec " + BinFolder() + "/roomtex-pick " + options + " >" + folder +
                             "/out 2>" + folder + "/err </dev/null";
    std::string shell = "/bin/sh", c = "-c", text = line;
    char* arguments[] = {shell.data(), c.data(), text.data(), nullptr};
    // SIGINT is ignored when the tests run in the background.
    posix_spawnattr_t attributes;
    sigset_t interrupt;
    sigemptyset(&interrupt);
    sigaddset(&interrupt, SIGINT);
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setsigdefault(&attributes, &interrupt);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF);
    EXPECT_EQ(posix_spawn(&pid_, "/bin/sh", nullptr, &attributes, arguments, environ), 0);
    posix_spawnattr_destroy(&attributes);
    for (int i = 0; i < 400 && Lines() < 2; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(25));
    }
  }
  ~Running() {
    if (pid_ == 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }

  std::string out() const { return ReadBytes(folder_ + "/out"); }
  std::string err() const { return ReadBytes(folder_ + "/err"); }
  std::string url() const { return out().substr(0, out().find('\n')); }
  int port() const { return std::stoi(url().substr(url().find(':', 6) + 1)); }
  pid_t pid() const { return pid_; }
  int Interrupt() {
    kill(pid_, SIGINT);
    int status = 0;
    waitpid(pid_, &status, 0);
    pid_ = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }

 private:
  long Lines() const {
    const std::string text = out();
    return std::count(text.begin(), text.end(), '\n');
  }
  std::string folder_;
  pid_t pid_ = 0;
};

TEST(PickCommand, PrintsWhereItServesSavesAndEndsOnCtrlC) {
  const TempFolder folder;
  Running command(
      Options(folder / "picks.csv") + " --port 0 --report_path " + (folder / "report.json"),
      folder.path());
  EXPECT_THAT(command.out(),
              MatchesRegex("http://127\\.0\\.0\\.1:[0-9]+/[0-9a-f]{40}/\nssh -L .*\n"));
  httplib::Client client("127.0.0.1", command.port());
  const std::string base = command.url().substr(command.url().find('/', 7));
  const auto page = client.Get(base);
  ASSERT_TRUE(page);
  EXPECT_EQ(page->status, 200);
  EXPECT_THAT(page->body, HasSubstr("<html"));
  SessionPick pick = ThePickRoom().SmoothPicks(ThePickRoom().clicked_photo(), 1)[0];
  const Json put = {
      {"revision", 1},
      {"picks",
       {{{"image_name", pick.image_name},
         {"img", {pick.x_in_img->x(), pick.x_in_img->y()}},
         {"point", {pick.x_in_scan->x(), pick.x_in_scan->y(), pick.x_in_scan->z()}}}}}};
  const httplib::Headers headers = {
      {"Origin", "http://127.0.0.1:" + std::to_string(command.port())}};
  EXPECT_EQ(client.Put(base + "picks", headers, put.dump(), "application/json")->status, 200);
  EXPECT_EQ(command.Interrupt(), 0) << command.err();
  EXPECT_THAT(command.err(), HasSubstr("6 of 8 photos cannot be shown. The first: There is no"));
  const std::vector<Pick> picks = ReadPicks(folder / "picks.csv");
  ASSERT_EQ(picks.size(), 1u);
  EXPECT_EQ(picks[0].x_in_scan, *pick.x_in_scan);
  const Json report = Json::parse(ReadBytes(folder / "report.json"));
  EXPECT_EQ(report["command"], "roomtex-pick");
  EXPECT_EQ(report["num_picks"], 1);
  // Who asks again continues.
  const TempFolder second_folder;
  Running second(Options(folder / "picks.csv") + " --port 0", second_folder.path());
  httplib::Client again("127.0.0.1", second.port());
  const auto state = again.Get(second.url().substr(second.url().find('/', 7)) + "state");
  ASSERT_TRUE(state);
  EXPECT_EQ(Json::parse(state->body)["session"]["picks"].size(), 1u);
}

TEST(PickCommand, APortThatIsTakenIsSaidUnlessItWasNotAskedFor) {
  const TempFolder folder;
  LocalServerOptions options;
  options.port = 0;
  LocalServer other(options);
  other.Start(false);
  const CommandResult taken = RunCommandLine("roomtex-pick " + Options(folder / "picks.csv") +
                                             " --port " + std::to_string(other.port()));
  EXPECT_EQ(taken.exit_code, 2);
  EXPECT_THAT(taken.err, HasSubstr("is taken"));
  // Two without --port stand side by side.
  const TempFolder a, b;
  Running first(Options(a / "picks.csv"), a.path()), second(Options(b / "picks.csv"), b.path());
  EXPECT_THAT(first.out(), StartsWith("http://"));
  ASSERT_THAT(second.out(), StartsWith("http://")) << second.err();
  EXPECT_NE(first.port(), second.port());
  EXPECT_THAT(second.err(), HasSubstr("is taken: using"));
  EXPECT_EQ(first.Interrupt(), 0);
  EXPECT_EQ(second.Interrupt(), 0);
}

TEST(PickCommand, RefusesWhatCannotBeServed) {
  const TempFolder folder;
  const std::string good = Options(folder / "picks.csv");
  const auto expect = [](const std::string& options, int exit_code, const std::string& text) {
    const CommandResult result = RunCommandLine("roomtex-pick " + options);
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    EXPECT_THAT(result.err, HasSubstr(text));
    EXPECT_EQ(result.out, "");
  };
  expect(good + " --host 0.0.0.0", 2, "--allow_remote");
  expect(good + " --port 70000", 2, "--port");
  expect(good + " --image_name photo_0000.jpg", 3, "(nearest name: photo_000.jpg)");
  expect(good + " --azimuth up", 2, "azimuth");
  expect(Options(folder / "no/picks.csv"), 3, "no such folder");
  expect(Options(folder.path()), 3, "is a folder");
  // Said before anybody picks: no file can be made there, not even by root.
  expect(Options("/sys/picks.csv"), 3, "/sys/picks.csv: cannot be written");
  WriteBytes(folder / "broken.csv", "image_name,x\n");
  expect(Options(folder / "broken.csv"), 3, "line 1");
  EXPECT_EQ(ReadBytes(folder / "broken.csv"), "image_name,x\n");
  expect("--output_path x.csv", 2, "--image_path");
  expect(good + " --camera_params 500,300,200,0", 2, "photos without a sparse model");
  std::string elsewhere = Options(folder / "picks.csv");
  const std::string images = ThePickRoom().input().image_path;
  elsewhere.replace(elsewhere.find(images), images.size(), folder.path());
  expect(elsewhere, 3, "none of the sparse model's 8 photos can be shown");
  const CommandResult help = RunCommandLine("roomtex-pick --help");
  EXPECT_EQ(help.exit_code, 0);
  for (const char* option : {"--image_name", "--aligned_path", "--scan_poses", "--azimuth",
                             "--host", "--port", "--allow_remote", "--open"}) {
    EXPECT_THAT(help.out, HasSubstr(option));
  }
}

TEST(PickCommand, ServesOnWithoutABrowser) {
  const TempFolder folder;
  const std::string old_path = getenv("PATH");
  setenv("PATH", folder.path().c_str(), 1);  // no xdg-open there
  Running command(Options(folder / "picks.csv") + " --port 0 --open 1", folder.path());
  setenv("PATH", old_path.c_str(), 1);
  EXPECT_THAT(command.out(), StartsWith("http://"));
  EXPECT_EQ(command.Interrupt(), 0);
  EXPECT_THAT(command.err(), HasSubstr("no browser could be started"));
}

}  // namespace
}  // namespace roomtex
