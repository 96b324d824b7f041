// Exit codes and reports.

#include <new>
#include <stdexcept>

#include <gmock/gmock.h>

#include "core/error.h"
#include "core/output_file.h"
#include "tests/core/test_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

class CommandReport : public testing::Test {
 protected:
  int Run(const std::function<void(const Command::Context&)>& body) {
    const int exit_code = test_.Run({"--input_path", "in.rtpi", "--report_path", path_}, body);
    report_ = Json::parse(ReadBytes(path_));
    return exit_code;
  }
  TempFolder folder_;
  const std::string path_ = folder_ / "report.json";
  TestCommand test_;
  Json report_;
};

TEST_F(CommandReport, HoldsEveryKeyOfTheContract) {
  ASSERT_EQ(Run([](const Command::Context& context) {
              context.progress.Stage("read", 2);
              context.progress.Tick();
              context.progress.Stage("write");
              context.progress.Stage("read");
              context.Warn("be careful");
              context.report["num_vertices"] = 12;
              context.report["nothing"] = std::numeric_limits<double>::quiet_NaN();
            }),
            kExitDone);
  EXPECT_EQ(report_["command"], "roomtex-test");
  EXPECT_EQ(report_["version"], Version());
  EXPECT_EQ(report_["options"]["count"], 7);
  EXPECT_EQ(report_["options"]["Group.ratio"], 0.25);
  EXPECT_EQ(report_["options"]["detail"], true);
  EXPECT_EQ(report_["options"]["random_seed"], 0);
  EXPECT_EQ(report_["options"]["input_path"], "in.rtpi");
  EXPECT_EQ(report_["inputs"]["input_path"], "in.rtpi");
  EXPECT_FALSE(report_["inputs"].contains("scan_path"));
  EXPECT_GE(report_["seconds"]["read"], 0.0);
  EXPECT_GE(report_["seconds"]["write"], 0.0);
  EXPECT_GT(report_["peak_memory_bytes"], 1 << 20);
  EXPECT_EQ(report_["warnings"], Json({"be careful"}));
  EXPECT_EQ(report_["trusted"], true);
  EXPECT_EQ(report_["reason"], "");
  EXPECT_EQ(report_["num_vertices"], 12);
  EXPECT_TRUE(report_["nothing"].is_null());
  EXPECT_THAT(test_.out, IsEmpty());
  EXPECT_THAT(test_.err, HasSubstr("warning: be careful"));
  EXPECT_THAT(test_.err, HasSubstr("read"));
}

TEST_F(CommandReport, IsWrittenWithTheExitCodeOfEveryKindOfFailure) {
  struct Case {
    std::function<void()> fail;
    int exit_code;
    const char* message;
  };
  const Case cases[] = {
      {[] { throw UsageError("--a and --b do not go together"); }, kExitUsage, "--a and --b"},
      {[] { throw InputError("in.rtpi", "byte 7", "is odd", "Make it even"); }, kExitInput,
       "in.rtpi: byte 7: is odd. Make it even."},
      {[] { throw std::runtime_error("surprise"); }, kExitInternalError,
       "internal error: surprise"},
      {[] { throw std::bad_alloc(); }, kExitInput, "out of memory"},
      {[] { throw 42; }, kExitInternalError, "internal error"},
  };
  for (const Case& c : cases) {
    EXPECT_EQ(Run([&](const Command::Context& context) {
                context.progress.Stage("started");
                context.report["half_done"] = 1;
                c.fail();
              }),
              c.exit_code);
    EXPECT_EQ(report_["trusted"], false);
    EXPECT_THAT(report_["reason"].get<std::string>(), HasSubstr(c.message));
    EXPECT_EQ(report_["half_done"], 1);
    EXPECT_TRUE(report_["seconds"].contains("started"));
    EXPECT_THAT(test_.err, HasSubstr(c.message));
    EXPECT_THAT(test_.out, IsEmpty());
  }
}

TEST_F(CommandReport, UntrustedAnswersExitWithFour) {
  EXPECT_EQ(Run([](const Command::Context& context) {
              context.report.SetUntrusted("Two views cannot tell.");
              context.report.SetUntrusted("And it is dark.");
            }),
            kExitUntrusted);
  EXPECT_EQ(report_["trusted"], false);
  EXPECT_EQ(report_["reason"], "Two views cannot tell. And it is dark.");
  EXPECT_THAT(test_.err, HasSubstr("not to be trusted: Two views cannot tell."));
}

TEST_F(CommandReport, CopiesAreWrittenOnlyWhenTheCommandRanToItsEnd) {
  const std::string copy = folder_ / "alignment.json";
  EXPECT_EQ(Run([&](const Command::Context& context) {
              context.report.AddCopy(copy);
              throw InputError("in", "", "is odd", "");
            }),
            kExitInput);
  EXPECT_FALSE(std::filesystem::exists(copy));
  EXPECT_EQ(Run([&](const Command::Context& context) { context.report.AddCopy(copy); }), kExitDone);
  EXPECT_EQ(ReadBytes(copy), ReadBytes(path_));
}

TEST_F(CommandReport, ReplacesAReportAndNothingElse) {
  WriteBytes(path_, "a thesis");
  EXPECT_EQ(test_.Run({"--input_path", "in", "--report_path", path_}), kExitUsage);
  EXPECT_THAT(test_.err, HasSubstr("is there already and is no report"));
  EXPECT_EQ(ReadBytes(path_), "a thesis");
  for (const char* earlier : {"", "{}"}) {
    WriteBytes(path_, earlier);
    EXPECT_EQ(test_.Run({"--input_path", "in", "--report_path", path_}), kExitDone);
    EXPECT_THAT(ReadBytes(path_), HasSubstr("roomtex-test"));
  }
}

// What is wrong with the options is found before anything runs; the report of the run before must
// not stand for this one.
TEST_F(CommandReport, IsWrittenForOptionsThatCannotBeRead) {
  WriteBytes(folder_ / "options.ini", "report_path=" + path_ + "\ntypo=1\n");
  const std::vector<std::vector<std::string>> wrong = {
      {"--typo", "1", "--report_path", path_},
      {"--report_path=" + path_, "--mode", "off"},
      {"--report_path", path_, "stray"},
      {"--report_path", path_, "--project_path", folder_ / "options.ini"},
      {"--project_path", folder_ / "options.ini"}};
  for (const std::vector<std::string>& arguments : wrong) {
    ASSERT_EQ(test_.Run({"--input_path", "in", "--report_path", path_}), kExitDone);
    EXPECT_EQ(test_.Run(arguments), kExitUsage) << testing::PrintToString(arguments);
    const Json report = Json::parse(ReadBytes(path_));
    EXPECT_EQ(report["trusted"], false) << testing::PrintToString(arguments);
    EXPECT_THAT(test_.err, HasSubstr(report["reason"].get<std::string>()));
  }
  ASSERT_TRUE(std::filesystem::remove(path_));
  EXPECT_EQ(test_.Run({"--typo", "1", "--report_path", path_}), kExitUsage);
  EXPECT_EQ(Json::parse(ReadBytes(path_))["command"], "roomtex-test");
}

// It is not known what is an input, and what lies in a folder of results belongs to them.
TEST_F(CommandReport, OfOptionsThatCannotBeReadReplacesNothingElse) {
  for (const char* other : {"{}", "a thesis", R"({"command": "roomtex-align"})"}) {
    WriteBytes(path_, other);
    EXPECT_EQ(test_.Run({"--typo", "1", "--report_path", path_}), kExitUsage);
    EXPECT_EQ(ReadBytes(path_), other);
  }
  std::filesystem::remove(path_);
  ASSERT_EQ(test_.Run({"--input_path", "in", "--report_path", path_}), kExitDone);
  const std::string before = ReadBytes(path_);
  for (const std::vector<std::string>& more : std::vector<std::vector<std::string>>{
           {"--output_path", folder_.path()}, {"--scan_path=" + path_}, {"--input_path", path_}}) {
    std::vector<std::string> arguments = {"--typo", "1", "--report_path", path_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    EXPECT_EQ(test_.Run(arguments), kExitUsage);
    EXPECT_EQ(ReadBytes(path_), before) << more[0];
    EXPECT_THAT(test_.err, HasSubstr("stays as it was, the report of an earlier run")) << more[0];
  }
}

TEST_F(CommandReport, UnfinishedIsNotTrustedButDone) {
  EXPECT_EQ(Run([](const Command::Context& context) {
              context.report.SetUnfinished("Only some of the steps were asked for.");
            }),
            kExitDone);
  EXPECT_EQ(report_["trusted"], false);
  EXPECT_EQ(report_["reason"], "Only some of the steps were asked for.");
}

TEST_F(CommandReport, HoldsOptionsOfAnotherProgramByTheirNames) {
  ASSERT_EQ(test_.Run({"--input_path", "in", "--report_path", path_, "--Mapper.x", "1"}),
            kExitDone);
  const Json options = Json::parse(ReadBytes(path_))["options"];
  EXPECT_EQ(options["Mapper.x"], "1");
  EXPECT_FALSE(options.contains("Mapper.*"));
}

TEST_F(CommandReport, UnwritableReportIsSaid) {
  EXPECT_EQ(test_.Run({"--input_path", "in", "--report_path", folder_ / "no/such/folder.json"}),
            kExitInput);
  EXPECT_THAT(test_.err, HasSubstr("no/such/folder.json: cannot be written"));
}

}  // namespace
}  // namespace roomtex
