#include "core/child_program.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::ElementsAre;
using testing::HasSubstr;

ChildRun RunShell(const std::string& script, const ChildSettings& settings = {}) {
  return RunChild({"/bin/sh", "-c", script}, settings);
}

TEST(RunChild, TellsEveryLineOfBothStreamsAndKeepsTheLastOnes) {
  std::vector<std::string> lines;
  ChildSettings settings;
  settings.on_line = [&](const std::string& line) { lines.push_back(line); };
  const ChildRun run = RunShell("echo one; echo two >&2; printf 'a\\rb'", settings);
  EXPECT_TRUE(run.success);
  EXPECT_EQ(run.failure, "");
  EXPECT_THAT(lines, ElementsAre("one", "two", "a", "b"));
  EXPECT_EQ(run.LastLines(), "one | two | a | b");
  EXPECT_GT(run.peak_memory_bytes, 0);
}

TEST(RunChild, KeepsTheReasonBeforeAStackTrace) {
  const ChildRun run = RunShell(
      "echo 'Check failed: a > b'; echo '*** Check failure stack trace: ***'; "
      "for i in 1 2 3 4 5 6 7 8 9 10 11 12; do echo '    @  0x7fe6  main'; done; exit 1");
  EXPECT_EQ(run.LastLines(), "Check failed: a > b");
}

TEST(RunChild, TellsHowItEnded) {
  const ChildRun failed = RunShell("exit 4");
  EXPECT_FALSE(failed.success);
  EXPECT_EQ(failed.exit_code, 4);
  EXPECT_EQ(failed.failure, "ended with exit code 4");
  const ChildRun killed = RunShell("kill -9 $$");
  EXPECT_EQ(killed.exit_code, 137);
  EXPECT_EQ(killed.failure, "was killed by signal 9");
}

TEST(RunChild, AppendsToALogThatBeginsWithTheCommand) {
  const TempFolder folder;
  ChildSettings settings;
  settings.log_path = folder / "log";
  RunShell("echo one", settings);
  RunShell("echo two", settings);
  const std::string log = ReadBytes(folder / "log");
  EXPECT_THAT(log, HasSubstr("$ /bin/sh -c 'echo one'\none\n"));
  EXPECT_THAT(log, HasSubstr("$ /bin/sh -c 'echo two'\ntwo\n"));
}

TEST(FindProgram, LooksOnThePathAndSaysWhatIsWrong) {
  EXPECT_THAT(FindProgram("sh", "Install it"), HasSubstr("/sh"));
  EXPECT_EQ(FindProgram("/bin/sh", "Install it"), "/bin/sh");
  EXPECT_INPUT_ERROR(FindProgram("no-such-program", "Install it"),
                     "is not on the PATH. Install it");
  EXPECT_INPUT_ERROR(FindProgram("/no/such/program", "Install it"), "does not exist");
  EXPECT_INPUT_ERROR(FindProgram("/tmp", "Install it"), "is not a program");
}

TEST(CommandText, QuotesWhatAShellWouldTakeApart) {
  EXPECT_EQ(CommandText({"a", "--b", "c d", "it's", "", "$(rm x)", "e.f/g#2", "#2"}),
            "a --b 'c d' 'it'\\''s' '' '$(rm x)' e.f/g#2 '#2'");
}

}  // namespace
}  // namespace roomtex
