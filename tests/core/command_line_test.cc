#include "core/command_line.h"

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <new>
#include <stdexcept>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/error.h"
#include "core/output_file.h"
#include "core/partial_path.h"
#include "core/set_journal.h"
#include "tests/core/failing_calls.h"
#include "tests/core/test_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

// Wrong usage: exit 2, nothing done, nothing on stdout, and `finding` on stderr without any C++.
void ExpectUsageError(const std::vector<std::string>& arguments, const std::string& finding) {
  TestCommand test;
  EXPECT_EQ(test.RunWithInput(arguments), kExitUsage) << testing::PrintToString(arguments);
  EXPECT_EQ(test.num_runs, 0);
  EXPECT_THAT(test.out, IsEmpty());
  EXPECT_THAT(test.err, StartsWith("roomtex-test: "));
  EXPECT_THAT(test.err, HasSubstr(finding));
  EXPECT_THAT(test.err, HasSubstr("See roomtex-test --help"));
}

TEST(CommandLine, HelpStartsWithTheExampleAndShowsUnitsAndDefaults) {
  for (const char* help : {"--help", "-h"}) {
    TestCommand test;
    EXPECT_EQ(test.Run({help}), kExitDone);
    EXPECT_EQ(test.num_runs, 0);
    EXPECT_THAT(test.err, IsEmpty());
    const size_t example = test.out.find("roomtex-test --input_path a --output_path b");
    ASSERT_NE(example, std::string::npos);
    EXPECT_LT(example, 20u);
    for (const char* text :
         {"Does nothing.", "--input_path PATH (required)", "--detail 1|0 (1)", "--count INT (7)",
          "--Group.ratio NUMBER (0.25)", "--range NUMBER (inf)", "How much, metres.",
          "--title TEXT (a title)", "--mode exif|match|none (exif)", "--Mapper.*",
          "--quiet 1|0 (0)", "--num_threads INT (-1)", "--random_seed INT (0)",
          "--project_path PATH", "--report_path PATH", "--help", "--version", "May be repeated"}) {
      EXPECT_THAT(test.out, HasSubstr(text));
    }
  }
}

TEST(CommandLine, VersionIsOneLine) {
  TestCommand test;
  EXPECT_EQ(test.Run({"--version"}), kExitDone);
  EXPECT_EQ(test.out, std::string("roomtex-test ") + Version() + "\n");
}

TEST(CommandLine, GivesDefaultsWhenNothingIsSaid) {
  TestCommand test;
  ASSERT_EQ(test.RunWithInput({}), kExitDone);
  EXPECT_EQ(test.num_runs, 1);
  EXPECT_TRUE(test.detail);
  EXPECT_EQ(test.count, 7);
  EXPECT_EQ(test.ratio, 0.25);
  EXPECT_EQ(test.title, "a title");
  EXPECT_EQ(test.mode, "exif");
  EXPECT_FALSE(test.common.quiet);
  EXPECT_EQ(test.common.num_threads, -1);
  EXPECT_EQ(test.common.random_seed, 0);
}

TEST(CommandLine, TakesEveryKindOfValueWithSpaceOrEqualsSign) {
  for (const bool equals : {false, true}) {
    std::vector<std::string> arguments;
    for (const auto& [name, value] :
         {std::pair("--detail", "0"), std::pair("--count", "-12"),
          std::pair("--Group.ratio", "-2.5e-3"), std::pair("--range", "30"),
          std::pair("--title", "two words = one"), std::pair("--mode", "match"),
          std::pair("--output_path", "-odd-name.ply"), std::pair("--random_seed", "42")}) {
      if (equals) {
        arguments.push_back(std::string(name) + "=" + value);
      } else {
        arguments.insert(arguments.end(), {name, value});
      }
    }
    TestCommand test;
    ASSERT_EQ(test.RunWithInput(arguments), kExitDone) << test.err;
    EXPECT_FALSE(test.detail);
    EXPECT_EQ(test.count, -12);
    EXPECT_EQ(test.ratio, -2.5e-3);
    EXPECT_EQ(test.range, 30);
    EXPECT_EQ(test.title, "two words = one");
    EXPECT_EQ(test.mode, "match");
    EXPECT_EQ(test.output, "-odd-name.ply");
    EXPECT_EQ(test.common.random_seed, 42);
  }
}

TEST(CommandLine, QuietMayStandAlone) {
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{{"--quiet"},
                                             {"--quiet", "1"},
                                             {"--quiet=1"},
                                             {"--quiet", "true"},
                                             {"--quiet", "--count", "7"}}) {
    TestCommand test;
    ASSERT_EQ(test.RunWithInput(arguments), kExitDone) << test.err;
    EXPECT_TRUE(test.common.quiet);
    EXPECT_THAT(test.err, IsEmpty());
  }
  TestCommand test;
  ASSERT_EQ(test.RunWithInput({"--quiet", "0"}), kExitDone);
  EXPECT_FALSE(test.common.quiet);
  ExpectUsageError({"--quiet", "yes please"}, "--quiet is \"yes please\", expected 1 or 0");
}

TEST(CommandLine, WholeNumbersAreWhole) {
  for (const auto& [text, value] : {std::pair("+5", 5), std::pair("1e3", 1000),
                                    std::pair("010", 10), std::pair("-2147483648", INT32_MIN)}) {
    TestCommand test;
    ASSERT_EQ(test.RunWithInput({"--count", text}), kExitDone) << test.err;
    EXPECT_EQ(test.count, value);
  }
  for (const char* text : {"1.5", "abc", "", " ", "5x", "nan", "inf", "1e9999", "2147483648", "5e9",
                           "0x10", "--", "1 2"}) {
    ExpectUsageError({std::string("--count=") + text},
                     std::string("--count is \"") + text + "\", expected a whole number");
  }
}

TEST(CommandLine, NumbersAreNumbers) {
  for (const auto& [text, value] : {std::pair("1e9", 1e9), std::pair("-5", -5.0),
                                    std::pair("+.5", 0.5), std::pair("3.", 3.0)}) {
    TestCommand test;
    ASSERT_EQ(test.RunWithInput({"--Group.ratio", text}), kExitDone) << test.err;
    EXPECT_EQ(test.ratio, value);
  }
  TestCommand test;
  test.range = 1;
  ASSERT_EQ(test.RunWithInput({"--range", "inf"}), kExitDone) << test.err;
  EXPECT_EQ(test.range, std::numeric_limits<double>::infinity());
  for (const char* text : {"nan", "-nan", "", "abc", "1,5", "5 m", "1e999", "0x10"}) {
    ExpectUsageError({std::string("--Group.ratio=") + text},
                     std::string("--Group.ratio is \"") + text + "\", expected a number");
  }
}

TEST(CommandLine, ChoicesAreNamed) {
  ExpectUsageError({"--mode", "off"}, "--mode is \"off\", expected exif, match or none");
}

TEST(CommandLine, WrongOptionsAreUsageErrors) {
  ExpectUsageError({"--unknown", "1"}, "--unknown is not an option of roomtex-test");
  ExpectUsageError({"--unknown=1"}, "--unknown is not an option of roomtex-test");
  ExpectUsageError({"--conut", "1"}, "Did you mean --count?");
  ExpectUsageError({"--photograph", "1"},
                   "Its files are --input_path, --output_path, --scan_path.");
  ExpectUsageError({"-x"}, "-x is not an option of roomtex-test");
  ExpectUsageError({"stray"}, "\"stray\" does not belong to an option");
  ExpectUsageError({"--count"}, "--count needs a value");
  ExpectUsageError({"--count", "--detail", "1"}, "--count needs a value");
  ExpectUsageError({"--output_path", "--count", "3"}, "--output_path needs a value");
  ExpectUsageError({"--count", "3", "--count", "4"}, "--count is given twice");
  ExpectUsageError({"--input_path", "other"}, "--input_path is given twice");
  ExpectUsageError({"--output_path="}, "--output_path needs a value");
  ExpectUsageError({"--"}, "\"--\" does not belong to an option");
  ExpectUsageError({"--num_threads", "0"}, "--num_threads must be -1 (all) or positive");
  ExpectUsageError({"--num_threads", "-2"}, "--num_threads must be -1 (all) or positive");
}

TEST(CommandLine, MissingRequiredOptionIsNamed) {
  TestCommand test;
  EXPECT_EQ(test.Run({"--count", "3"}), kExitUsage);
  EXPECT_THAT(test.err, HasSubstr("--input_path is required"));
}

TEST(CommandLine, AllThatIsWrongWithValuesIsSaidAtOnce) {
  TestCommand test;
  EXPECT_EQ(test.Run({"--count", "three", "--mode", "off", "--output_path="}), kExitUsage);
  EXPECT_THAT(test.err, HasSubstr("--count is \"three\""));
  EXPECT_THAT(test.err, HasSubstr("--mode is \"off\""));
  EXPECT_THAT(test.err, HasSubstr("--output_path needs a value"));
  EXPECT_THAT(test.err, HasSubstr("--input_path is required"));
}

TEST(CommandLine, EmptyTextIsAValue) {
  TestCommand test;
  ASSERT_EQ(test.RunWithInput({"--title", ""}), kExitDone) << test.err;
  EXPECT_EQ(test.title, "");
  ASSERT_EQ(TestCommand().RunWithInput({"--title="}), kExitDone);
}

TEST(CommandLine, PathsMayBeRepeatedOrListed) {
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{{"--scan_path", "x", "--scan_path", "y"},
                                             {"--scan_path=x", "--count", "3", "--scan_path=y"},
                                             {"--scan_path", "x", "y"}}) {
    TestCommand test;
    ASSERT_EQ(test.RunWithInput(arguments), kExitDone) << test.err;
    EXPECT_THAT(test.scans, ElementsAre("x", "y"));
  }
}

TEST(CommandLine, HandsOnTheOptionsOfAnotherProgram) {
  TestCommand test;
  ASSERT_EQ(
      test.RunWithInput({"--Mapper.a", "1", "--Mapper.b=x=y", "--count", "3", "--Mapper.c", "-1"}),
      kExitDone)
      << test.err;
  EXPECT_THAT(test.mapper, ElementsAre("--Mapper.a", "1", "--Mapper.b", "x=y", "--Mapper.c", "-1"));
  EXPECT_EQ(test.count, 3);
  ExpectUsageError({"--Mapper.a"}, "--Mapper.a needs a value");
  ExpectUsageError({"--Mapper.a", "--count", "3"}, "--Mapper.a needs a value");
}

// Project files.

class ProjectFile : public testing::Test {
 protected:
  int Run(const std::string& text, std::vector<std::string> arguments = {}) {
    WriteBytes(path_, text);
    arguments.insert(arguments.begin(), {"--project_path", path_});
    return test_.Run(arguments);
  }
  TempFolder folder_;
  const std::string path_ = folder_ / "project.ini";
  TestCommand test_;
};

TEST_F(ProjectFile, GivesOptionsAndSections) {
  ASSERT_EQ(Run("# a comment\r\n; another\r\ninput_path = some folder/in.rtpi\r\n\ncount=3\n  "
                "detail = 0\n"
                "scan_path=x\nscan_path=y # z\n[Group]\nratio=0.5\n[Mapper]\nmin_num_matches=10\n"),
            kExitDone)
      << test_.err;
  EXPECT_EQ(test_.input, "some folder/in.rtpi");
  EXPECT_EQ(test_.count, 3);
  EXPECT_FALSE(test_.detail);
  EXPECT_EQ(test_.ratio, 0.5);
  EXPECT_THAT(test_.scans, ElementsAre("x", "y # z"));
  EXPECT_THAT(test_.mapper, ElementsAre("--Mapper.min_num_matches", "10"));
}

TEST_F(ProjectFile, CommandLineWins) {
  ASSERT_EQ(Run("input_path=in\ncount=3\nscan_path=x\n[Group]\nratio=0.5\n[Mapper]\na=1\nb=2\n",
                {"--count", "4", "--scan_path", "z", "--Group.ratio=2", "--Mapper.a=5"}),
            kExitDone)
      << test_.err;
  EXPECT_EQ(test_.input, "in");
  EXPECT_EQ(test_.count, 4);
  EXPECT_EQ(test_.ratio, 2);
  EXPECT_THAT(test_.scans, ElementsAre("z"));
  EXPECT_THAT(test_.mapper, ElementsAre("--Mapper.b", "2", "--Mapper.a", "5"));
}

TEST_F(ProjectFile, MistakesAreNamedWithTheirLine) {
  EXPECT_EQ(Run("input_path=in\nconut=3\n"), kExitUsage);
  EXPECT_THAT(test_.err, HasSubstr(path_ + ": line 2: conut is not an option of roomtex-test"));
  EXPECT_EQ(Run("input_path=in\n[Group]\nratios=3\n"), kExitUsage);
  EXPECT_THAT(test_.err, HasSubstr("line 3: Group.ratios is not an option"));
  EXPECT_EQ(Run("input_path=in\nthis is no option\n"), kExitInput);
  EXPECT_THAT(test_.err, HasSubstr(path_ + ": line 2: is not a line of an ini file"));
  EXPECT_EQ(Run("input_path=in\n[Group\nratio=1\n"), kExitInput);
  EXPECT_THAT(test_.err, HasSubstr("line 2"));
  EXPECT_EQ(Run("input_path=in\ncount=three\n"), kExitUsage);
  EXPECT_THAT(test_.err, HasSubstr("--count is \"three\", expected a whole number"));
  EXPECT_EQ(Run("input_path=in\ncount=3\ncount=4\n"), kExitUsage);
  EXPECT_THAT(test_.err, HasSubstr("--count is given twice"));
  EXPECT_EQ(Run("input_path=in\nproject_path=other.ini\n"), kExitUsage);
  EXPECT_THAT(test_.err, HasSubstr("line 2: project_path stands on the command line only"));
  EXPECT_EQ(Run(std::string("i\0n\0", 4)), kExitInput);
  EXPECT_THAT(test_.err, HasSubstr("line 1: holds a zero byte, as text in UTF-16 does"));
  EXPECT_EQ(test_.num_runs, 0);
}

TEST_F(ProjectFile, MayComeFromWindows) {
  EXPECT_EQ(Run("\xef\xbb\xbfinput_path=in\r\ncount=3\r\n"), kExitDone);
  EXPECT_EQ(test_.count, 3);
}

TEST_F(ProjectFile, MissingFileIsAnInputError) {
  EXPECT_EQ(test_.RunWithInput({"--project_path", folder_ / "missing.ini"}), kExitInput);
  EXPECT_THAT(test_.err, HasSubstr("missing.ini: does not exist"));
  EXPECT_EQ(test_.RunWithInput({"--project_path=" + folder_.path()}), kExitInput);
  EXPECT_THAT(test_.err, HasSubstr("is a folder"));
}

TEST(CommandLine, QuietSaysErrorsButNothingElse) {
  TestCommand test;
  EXPECT_EQ(test.Run({"--input_path", "in", "--quiet"},
                     [](const Command::Context& context) {
                       context.progress.Stage("read", 3);
                       context.progress.Note("a note");
                       context.Warn("a warning");
                     }),
            kExitDone);
  EXPECT_THAT(test.err, IsEmpty());
  EXPECT_EQ(test.Run({"--input_path", "in", "--quiet"},
                     [](const Command::Context&) { throw InputError("in", "", "is odd", ""); }),
            kExitInput);
  EXPECT_EQ(test.err, "roomtex-test: in: is odd.\n");
}

// The command in a process of its own, whose standard output is what `prepare` makes of it.
int ExitCodeWith(const std::function<void()>& prepare, const std::string& output_path = "") {
  const pid_t child = fork();
  if (child == 0) {
    prepare();
    Command command("roomtex-test", "Tests.", "roomtex-test");
    char name[] = "roomtex-test";
    char* arguments[] = {name};
    const int code = command.Run(1, arguments, [&](const Command::Context&) {
      std::printf("the answer\n");
      if (output_path.empty()) return;
      OutputFile file(output_path);
      std::fflush(stdout);
      file.stream() << "the file";
      file.Commit();
    });
    _exit(code);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

TEST(CommandLine, AnAnswerThatCannotBeWrittenIsNoEndWithZero) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "this system has no /dev/full";
  EXPECT_EQ(ExitCodeWith([] { dup2(open("/dev/full", O_WRONLY), STDOUT_FILENO); }), kExitInput);
  EXPECT_EQ(ExitCodeWith([] { dup2(open("/dev/null", O_WRONLY), STDOUT_FILENO); }), kExitDone);
}

TEST(CommandLine, WhatIsToldDoesNotGetIntoFilesIfStandardFilesAreClosed) {
  const TempFolder folder;
  const std::string path = folder / "file";
  EXPECT_EQ(ExitCodeWith(
                [] {
                  for (const int file : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) close(file);
                },
                path),
            kExitDone);
  EXPECT_EQ(ReadBytes(path), "the file");
}

TEST(CommandLine, AFolderThatIsGoneIsSaid) {
  const TempFolder folder;
  const pid_t child = fork();
  if (child == 0) {
    std::filesystem::create_directory(folder / "gone");
    std::filesystem::current_path(folder / "gone");
    std::filesystem::remove(folder / "gone");
    TestCommand relative, absolute;
    const bool is_said = relative.Run({"--input_path", "in"}) == kExitInput &&
                         relative.err.find(
                             "in: is looked for in the folder that you work in, "
                             "which is gone") != std::string::npos;
    _exit(is_said && absolute.Run({"--input_path", "/in"}) == kExitDone ? 0 : 1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
}

// What a run was killed at that moved "in" to its place; gives the folder of its files.
std::string LeaveHalfMoved(const std::string& folder) {
  WriteBytes(folder + "/in", "old");
  const std::string set = folder + "/" + kPartialPrefix + "1";
  std::filesystem::create_directory(set);
  WriteBytes(set + "/in", "new");
  WriteSetJournal({{"in"}, {}}, set);
  return set;
}

TEST(CommandLine, FinishesWhatAKilledRunBeganBeforeAnInputIsRead) {
  const TempFolder folder;
  const std::string in = folder / "in";
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"--input_path", in},
        {"--input_path", folder.path()},
        {"--input_path", in + "#scan 1"},
        {"--input_path", "x", "--output_path", folder / "out"}}) {
    const std::string set = LeaveHalfMoved(folder.path());
    TestCommand test;
    std::string read;
    EXPECT_EQ(test.Run(arguments, [&](const Command::Context&) { read = ReadBytes(in); }),
              kExitDone);
    EXPECT_EQ(read, "new") << testing::PrintToString(arguments);
    EXPECT_FALSE(std::filesystem::exists(set));
  }
}

TEST(CommandLine, WarnsOfWhatItCannotFinishAndGoesOn) {
  const TempFolder folder;
  const std::string set = LeaveHalfMoved(folder.path());
  FailingCalls calls;
  calls.on_rename = [](const std::string&, const std::string&) { return ENOSPC; };
  TestCommand test;
  EXPECT_EQ(test.Run({"--input_path", folder / "in"}), kExitDone);
  EXPECT_THAT(test.err, HasSubstr(set + ": finished files of an earlier run"));
  EXPECT_THAT(test.err, HasSubstr("No space left"));
  EXPECT_EQ(ReadBytes(set + "/in"), "new");
}

TEST(CommandLine, MemoryThatRunsOutIsSaidWithStageAndInputs) {
  const TempFolder folder;
  const std::string in = folder / "in";
  WriteBytes(in, std::string(2500000, 'x'));
  TestCommand test;
  EXPECT_EQ(test.Run({"--input_path", in, "--scan_path", folder.path()},
                     [](const Command::Context& context) {
                       context.progress.Stage("colour");
                       throw std::bad_alloc();
                     }),
            kExitInput);
  for (const std::string& part :
       {std::string("in the stage \"colour\""), "--input_path " + in + " (3 MB)",
        "--scan_path " + folder.path() + " (1 files, 3 MB)", std::string("fewer samples")}) {
    EXPECT_THAT(test.err, HasSubstr(part));
  }
}

}  // namespace
}  // namespace roomtex
