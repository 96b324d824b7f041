// roomtex-view as a user calls it. What its page does: tests/browser/view.test.mjs.

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/support/folders.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"
#include "tests/texture/view/view_scene.h"

namespace roomtex {
namespace {
using testing::HasSubstr;

class ViewCommand : public testing::Test {
 protected:
  void SetUp() override { WriteViewFolder(TwoWallsScan(40, 30), folder_.path()); }
  const TempFolder folder_;
};

TEST_F(ViewCommand, SaysWhatIsWrongWithItsInput) {
  const auto expect = [](const std::string& line, int code, const std::string& text) {
    const CommandResult result = RunCommandLine("roomtex-view --port 0 " + line);
    EXPECT_EQ(result.exit_code, code) << line << result.err;
    EXPECT_THAT(result.err, HasSubstr(text)) << line;
    EXPECT_EQ(result.out, "") << line;
  };
  const TempFolder empty;
  expect("--input_path " + (folder_ / "nowhere"), 3, "does not exist");
  expect("--input_path " + empty.path(), 3, "neither model.glb nor model.ply");
  expect("--input_path " + folder_.path() + " --aligned " + empty.path(), 3, empty.path());
  expect("--input_path " + folder_.path() + " --host 0.0.0.0", 2, "--allow_remote 1");
  expect("", 2, "input_path");
  const std::string bytes = ReadBytes(folder_ / "model.glb");
  WriteBytes(folder_ / "model.glb", bytes.substr(0, bytes.size() / 2));
  expect("--input_path " + folder_.path(), 3, "does not fit into the file");
}

TEST_F(ViewCommand, RefusesAModelWithoutImages) {
  const TempFolder model;
  std::ofstream(model / "cameras.txt") << "1 PINHOLE 100 80 90 90 50 40\n";
  std::ofstream(model / "images.txt") << "# none\n";
  std::ofstream(model / "points3D.txt") << "# none\n";
  const CommandResult result = RunCommandLine("roomtex-view --port 0 --input_path " +
                                              folder_.path() + " --aligned " + model.path());
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_THAT(result.err, HasSubstr("holds no registered photo"));
}

TEST_F(ViewCommand, PrintsItsAddressAndEndsOnCtrlC) {
  const std::string out = folder_ / "out";
  const pid_t pid = fork();
  ASSERT_GE(pid, 0);
  if (pid == 0) {
    (void)!freopen(out.c_str(), "w", stdout);
    (void)!freopen("/dev/null", "w", stderr);
    const std::string command = BinFolder() + "/roomtex-view";
    execl(command.c_str(), "roomtex-view", "--input_path", folder_.path().c_str(), "--port", "0",
          static_cast<char*>(nullptr));
    _exit(127);
  }
  std::string text;
  for (int i = 0; i < 1000 && std::count(text.begin(), text.end(), '\n') < 2; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    text = ReadBytes(out);
  }
  kill(pid, SIGINT);
  int status = 0;
  waitpid(pid, &status, 0);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_THAT(text, testing::MatchesRegex("http://127\\.0\\.0\\.1:[0-9]+/[0-9a-f]+/\n"
                                          "ssh -L [0-9]+:127\\.0\\.0\\.1:[0-9]+ .+\n"));
}

}  // namespace
}  // namespace roomtex
