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

// What the page makes of it: tests/browser/view.test.mjs.
TEST_F(ViewCommand, WritesAFolderToGiveAway) {
  const std::string out = folder_ / "give away";
  const std::string line =
      "roomtex-view --input_path '" + folder_.path() + "' --output_path '" + out + "'";
  const CommandResult result = RunCommandLine(line);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.out, out + "/index.html\n");
  const std::string page = ReadBytes(out + "/index.html");
  EXPECT_LT(page.find("data/folder.js"), page.find("view.js"));
  const std::string scene = ReadBytes(out + "/data/scene.js");
  EXPECT_THAT(scene, testing::StartsWith("roomtexGive(\"scene\",{"));
  EXPECT_THAT(scene, testing::Not(HasSubstr(folder_.path())));  // where it was made
  EXPECT_THAT(ReadBytes(out + "/data/chunk.id-0.level-2.js"),
              testing::EndsWith("\",\"application/octet-stream\");\n"));
  EXPECT_TRUE(std::filesystem::exists(out + "/data/evidence_chunk.id-0.level-0.js"));
  EXPECT_TRUE(std::filesystem::exists(out + "/data/texture.page-0.max-1024.js"));
  // Written again it is replaced as a whole, and what is not ours stays.
  std::ofstream(out + "/data/chunk.id-7.level-2.js") << "of an earlier room";
  EXPECT_EQ(RunCommandLine(line).exit_code, 0);
  EXPECT_FALSE(std::filesystem::exists(out + "/data/chunk.id-7.level-2.js"));
  EXPECT_EQ(ReadBytes(out + "/data/scene.js"), scene);
  std::ofstream(out + "/notes.txt") << "mine";
  EXPECT_EQ(RunCommandLine(line).exit_code, 3);
  EXPECT_EQ(ReadBytes(out + "/notes.txt"), "mine");
  std::filesystem::remove(out + "/notes.txt");
  const CommandResult refused = RunCommandLine("roomtex-view --input_path '" + folder_.path() +
                                               "' --output_path '" + folder_.path() + "'");
  EXPECT_NE(refused.exit_code, 0);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "model.glb"));
  // No room to put the pieces aside.
  const CommandResult full = RunProgram("TMPDIR=/nowhere " + BinFolder() + "/" + line);
  EXPECT_EQ(full.exit_code, 3) << full.err;
  EXPECT_THAT(full.err, HasSubstr("Set TMPDIR"));
}

// Of what is shown, and of nothing that lies where the command is called.
TEST_F(ViewCommand, WarnsOfDoubtsInWhatItShows) {
  const TempFolder elsewhere;
  const auto warnings = [&](const std::string& model) {
    const CommandResult result =
        RunProgram("cd " + elsewhere.path() + " && " + BinFolder() + "/roomtex-view --input_path " +
                   model + " --output_path " + (elsewhere / "given"));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.err;
  };
  WriteBytes(elsewhere / "alignment.json", R"({"trusted": false, "reason": "of another room"})");
  EXPECT_THAT(warnings(folder_.path()), testing::Not(HasSubstr("not to be trusted")));
  for (const char* name : {"report.json", "joined.json"}) {
    WriteBytes(folder_ / name, R"({"trusted": false, "reason": "The loops do not close."})");
    for (const std::string& model : {folder_.path(), folder_ / "model.glb"}) {
      EXPECT_THAT(warnings(model), HasSubstr("not to be trusted. The loops do not close.")) << name;
    }
    std::filesystem::remove(folder_ / name);
  }
}

TEST_F(ViewCommand, WritesNothingWhereTheReportCannotBeWritten) {
  const std::string out = folder_ / "given";
  const auto refused = [&](const std::string& report_path, int code) {
    const CommandResult result =
        RunCommandLine("roomtex-view --input_path " + folder_.path() + " --output_path " + out +
                       " --report_path " + report_path);
    EXPECT_EQ(result.exit_code, code) << report_path << result.err;
    EXPECT_THAT(result.err, HasSubstr(report_path));
  };
  for (const std::string earlier : {"", "an earlier page"}) {
    refused(out + "/index.html", 2);
    refused(out + "/report.json", 2);  // says no more than whose folder it is
    refused(folder_ / "nowhere/report.json", 3);
    refused(folder_.path(), 3);
    for (const char* name : {"index.html", "view.js", "data"}) {
      EXPECT_EQ(std::filesystem::exists(out + "/" + name),
                !earlier.empty() && std::string(name) == "index.html");
    }
    if (!earlier.empty()) {
      EXPECT_EQ(ReadBytes(out + "/index.html"), earlier);
    }
    WriteBytes(out + "/index.html", "an earlier page");
    WriteBytes(out + "/report.json", R"({"command": "roomtex-view"})");
  }
}

TEST_F(ViewCommand, PrintsItsAddressAndEndsOnCtrlC) {
  const std::string out = folder_ / "out";
  const pid_t pid = fork();
  ASSERT_GE(pid, 0);
  if (pid == 0) {
    std::signal(SIGINT, SIG_DFL);  // ignored when the tests run in the background
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
