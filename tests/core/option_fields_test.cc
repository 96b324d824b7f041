#include "core/option_fields.h"

#include <cmath>
#include <functional>
#include <limits>

#include <gmock/gmock.h>

#include "core/command_line.h"
#include "core/error.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct TestOptions {
  bool enabled = true;
  int rounds = 5;
  int scale = 0;
  double spread = 0.05;
  double share = 0.5;
  double tolerance = -1;
  double beta = 0;
  double low = 1, high = 2;
  std::string mode = "match";
  std::string name;
  std::string folder;
  int buffer = 1;

  void Declare(OptionFields* fields) {
    fields->Bool("Test.enabled", &enabled, "Whether.");
    fields->Int("Test.rounds", &rounds, "How often.").Within(1, 100);
    fields->Int("Test.scale", &scale, "How fine.").ZeroIs("auto").Within(0, 16, "texels");
    fields->Number("Test.spread", &spread, "How far.").Positive();
    fields->Number("Test.share", &share, "How much.").Between(0, 1);
    fields->Number("Test.tolerance", &tolerance, "How tolerant.").NotNegative().Or(-1);
    fields->Number("Test.beta", &beta, "Weight.").NotNegative().Finite();
    const std::string order = "--Test.low must be positive and not above --Test.high";
    fields->Number("Test.low", &low, "From.").Positive().SaysSentence(order);
    fields->Number("Test.high", &high, "To.");
    fields->Require(high >= low, order);
    fields->Choice("Test.mode", &mode, {"exif", "match", "none"}, "Which.").Also(mode.empty());
    fields->Text("name", &name, "Of whom.").Required();
    fields->InputPath("folder", &folder, "Where.");
    fields->Int("buffer", &buffer, "Of programs.").AtLeast(1).Internal();
  }
  std::vector<std::string> Problems() const { return ProblemsOf(*this); }
};

TEST(OptionFields, HaveNoProblemsWithTheDefaults) {
  EXPECT_THAT(TestOptions().Problems(), IsEmpty());
}

TEST(OptionFields, SayEverythingThatIsWrongOnceAndInOrder) {
  TestOptions options;
  options.rounds = 101;
  options.scale = 17;
  options.spread = 0;
  options.share = 1;
  options.tolerance = -2;
  options.beta = kInfinity;
  options.low = 0;
  options.high = -1;
  options.mode = "off";
  options.buffer = 0;
  EXPECT_THAT(
      options.Problems(),
      ElementsAre("--Test.rounds must be 1 to 100", "--Test.scale must be 0 to 16 texels",
                  "--Test.spread must be positive", "--Test.share must lie between 0 and 1",
                  "--Test.tolerance must not be negative", "--Test.beta must not be negative",
                  "--Test.low must be positive and not above --Test.high",
                  "--Test.mode must be exif, match or none, is off", "buffer must be at least 1"));
}

TEST(OptionFields, RefuseWhatIsNoNumber) {
  TestOptions options;
  options.spread = options.share = options.tolerance = options.beta = options.low = kNan;
  EXPECT_EQ(options.Problems().size(), 5u);
  options = TestOptions();
  options.spread = kInfinity;  // a limit that is none
  options.mode = "";           // allowed by Also()
  EXPECT_THAT(options.Problems(), IsEmpty());
}

TEST(OptionFields, SayBoundsAsTheyAre) {
  double x = 0;
  const auto sentence = [&x](const std::function<void(OptionField*)>& bound) {
    OptionFields fields;
    bound(&fields.Number("x", &x, "A number."));
    return fields.Sentences().at(0);
  };
  EXPECT_EQ(sentence([](OptionField* f) { f->Above(1); }), "--x must be greater than 1");
  EXPECT_EQ(sentence([](OptionField* f) { f->AtLeast(2.5); }), "--x must be at least 2.5");
  EXPECT_EQ(sentence([](OptionField* f) { f->Below(3); }), "--x must be below 3");
  EXPECT_EQ(sentence([](OptionField* f) { f->AtMost(1e6); }), "--x must be at most 1000000");
  EXPECT_EQ(sentence([](OptionField* f) { f->Finite(); }), "--x must be a finite number");
  EXPECT_EQ(sentence([](OptionField* f) { f->Within(-0.2, 0.2, "m"); }),
            "--x must be -0.2 to 0.2 m");
  EXPECT_EQ(sentence([](OptionField* f) { f->Above(0).AtMost(30).Says("must suit"); }),
            "--x must suit");
}

struct Outcome {
  int exit_code = -1;
  std::string out, err;
  Json report;
};

Outcome RunWith(const OptionFields& fields, std::vector<std::string> words) {
  const TempFolder folder;
  const std::string report_path = folder / "report.json";
  Command command("roomtex-test", "Does nothing.", "roomtex-test --name it");
  command.Add(fields);
  words.insert(words.begin(), "roomtex-test");
  words.insert(words.end(), {"--report_path", report_path});
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  Outcome outcome;
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  outcome.exit_code =
      command.Run(static_cast<int>(argv.size()), argv.data(), [](const Command::Context&) {});
  outcome.out = testing::internal::GetCapturedStdout();
  outcome.err = testing::internal::GetCapturedStderr();
  if (outcome.exit_code == kExitDone && outcome.out.empty()) {
    outcome.report = Json::parse(ReadBytes(report_path));
  }
  return outcome;
}

TEST(OptionFields, BecomeOptionsOfACommand) {
  TestOptions options;
  const Outcome help = RunWith(FieldsOf(&options), {"--help"});
  for (const char* text :
       {"--Test.enabled 1|0 (1)\n      Whether.\n", "--Test.rounds INT (5)\n      How often.\n",
        "--Test.scale TEXT (auto)\n", "--Test.spread NUMBER (0.05)\n",
        "--Test.mode exif|match|none (match)\n", "--name TEXT (required)\n", "--folder PATH\n"}) {
    EXPECT_THAT(help.out, HasSubstr(text));
  }
  EXPECT_THAT(help.out, Not(HasSubstr("buffer")));

  const Outcome run =
      RunWith(FieldsOf(&options),
              {"--name", "it", "--Test.enabled", "0", "--Test.rounds", "7", "--Test.scale", "3",
               "--Test.spread", "0.5", "--Test.mode", "exif", "--folder", "in"});
  ASSERT_EQ(run.exit_code, kExitDone) << run.err;
  EXPECT_FALSE(options.enabled);
  EXPECT_EQ(options.rounds, 7);
  EXPECT_EQ(options.scale, 3);
  EXPECT_EQ(options.spread, 0.5);
  EXPECT_EQ(options.mode, "exif");
  EXPECT_EQ(options.name, "it");
  EXPECT_EQ(run.report["options"]["Test.scale"], "3");
  EXPECT_EQ(run.report["options"]["Test.rounds"], 7);
  EXPECT_EQ(run.report["inputs"]["folder"], "in");
  EXPECT_EQ(run.report["inputs"].size(), 1u);
}

TEST(OptionFields, ZeroHasAWord) {
  for (const char* text : {"auto", "0"}) {
    TestOptions options;
    options.scale = 5;
    const Outcome run = RunWith(FieldsOf(&options), {"--name", "it", "--Test.scale", text});
    ASSERT_EQ(run.exit_code, kExitDone) << run.err;
    EXPECT_EQ(options.scale, 0);
    EXPECT_EQ(run.report["options"]["Test.scale"], "auto");
  }
  TestOptions options;
  const Outcome run = RunWith(FieldsOf(&options), {"--name", "it", "--Test.scale", "fine"});
  EXPECT_EQ(run.exit_code, kExitUsage);
  EXPECT_THAT(run.err, HasSubstr("--Test.scale is \"fine\", expected a whole number"));
}

TEST(OptionFields, SomeMayStandApart) {
  TestOptions options;
  const OptionFields all = FieldsOf(&options);
  const auto names = [](const OptionFields& fields) {
    std::vector<std::string> found;
    for (const OptionField& field : fields.fields()) found.push_back(field.name());
    return found;
  };
  EXPECT_THAT(names(all.Only({"name", "Test.scale"})), ElementsAre("Test.scale", "name"));
  EXPECT_EQ(names(all.Without({"name"})).size(), all.fields().size() - 1);
}

}  // namespace
}  // namespace roomtex
